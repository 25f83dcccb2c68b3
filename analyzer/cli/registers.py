"""`rtuscope registers`: what the registers mean, told from what they were; `--like`: which one showed this number."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ..languages import counted, register_words
from ..words import shortened
from .commands import DONE, FAILED, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    add_map_argument,
    chosen_charts,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
    unit_number,
)
from .terminal import Progress, interruptible, tell_user

if TYPE_CHECKING:
    from captures import Capture

    from ..options import Options
    from ..registers.like import Match
    from ..registers.readings import RegisterReadings
    from ..registers.recognition import Recognised, UnitTexts
    from ..registers.requests import AskedRequests
    from ..registers.roles import RegisterValue


EXAMPLE = """\
rtuscope simulate meter.jsonl --map eastron-sdm630@1
rtuscope registers meter.jsonl
rtuscope registers meter.jsonl --json
rtuscope registers meter.jsonl --map eastron-sdm630@1
rtuscope registers meter.jsonl --like 0.9"""
_WIDEST: Final = 40  # signs of a text in the table; --json has it whole
HEADINGS: Final = ("unit", "register", "type", "order", "role", "min", "max", "last", "sure", "why")


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument("--unit", type=unit_number, action="append", metavar="N", help="only this unit; repeatable")
    add_map_argument(parser)
    parser.add_argument("--recognise", action="store_true", help="use the maps of recognised devices")
    parser.add_argument(
        "--like", metavar="VALUE|FILE", help="find the register that showed this number, or a table of times and values"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object per line")
    parser.add_argument("--all", action="store_true", help="also list registers that never changed")
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what was inferred, or found."""
    load_functions(arguments)
    limits = chosen_limits(arguments)
    charts = chosen_charts(arguments)
    capture = open_capture(arguments)
    if arguments.like is not None:
        return find_like(arguments, capture, limits)
    from ..registers.drafting import with_own_words
    from ..registers.inference import infer
    from ..registers.recognition import recognised

    traffic = gathered(capture, arguments.capture, limits)
    readings, units = traffic.readings, traffic.units
    listed = ", ".join(map(str, units))
    if arguments.unit and units and not set(arguments.unit) & set(units):
        raise UsageError(f"--unit: {arguments.capture} has no values for it: units with values: {listed}")
    for unit in sorted(set(charts) - set(units) if units else ()):
        tell_user(f"--map: {arguments.capture} has no values for unit {unit}: units with values: {listed}")
    named, words = charts.of(units), own_words_of(arguments.capture)
    values = infer(readings, units=arguments.unit, charts=with_own_words(named, words))
    devices: list[Recognised] = []
    if len(named) < len(units) and (arguments.recognise or not arguments.json):
        free = values if not named and not words else infer(readings, units=arguments.unit)
        devices = [
            one
            for one in recognised(readings, traffic.texts, free)
            if one.unit not in named and (not arguments.unit or one.unit in arguments.unit)
        ]
    if arguments.recognise and devices:
        every_chart = {**{one.unit: one.chart for one in devices}, **named}
        values = infer(readings, units=arguments.unit, charts=with_own_words(every_chart, words))
    if arguments.json:
        _print_json(values)
    else:
        sys.stdout.write(_table(values, everything=arguments.all))
        sys.stdout.write(_devices(devices, used=arguments.recognise))
    return _status(arguments, traffic, values)


def own_words_of(capture: str) -> dict[tuple[int, str, int], str]:
    """What the user said of registers in the interface, kept beside the capture."""
    from pathlib import Path

    from ..model.registers import own_words
    from ..usernotes import Notes, NotesError

    try:
        return own_words(Notes.beside(None if capture == "-" else Path(capture)).types)
    except NotesError as error:
        tell_user(str(error))
        return {}


def _status(arguments: argparse.Namespace, traffic: RegisterTraffic, values: list[RegisterValue]) -> int:
    if traffic.stopped:
        return INTERRUPTED
    if not traffic.readings.frames:
        tell_user(f"{arguments.capture}: no Modbus frame found")
        return NO_FRAME
    if not values:
        tell_user(f"{arguments.capture}: no response carries register values")
        return NO_FRAME
    return DONE


def _print_json(values: list[RegisterValue]) -> None:
    import json

    for value in values:
        print(json.dumps(value.to_json(), ensure_ascii=False, separators=(",", ":")))


def _table(values: list[RegisterValue], *, everything: bool) -> str:
    """The values as a table; those that never moved are counted, unless all are wanted."""
    from dissectors.values import harmless

    shown = [value for value in values if everything or value.changes or value.name or value.kind == "text"]
    rows = [tuple(map(register_words, HEADINGS)), *(_table_row(value) for value in shown)] if shown else []
    widths = [max((len(row[column]) for row in rows), default=0) for column in range(len(HEADINGS) - 1)]
    lines = []
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        lines.append(harmless("  ".join([*cells, row[-1]]).rstrip()))
    if len(shown) < len(values):
        still = len(values) - len(shown)
        registers = counted(still, "register", "registers")
        words = "{registers} never moved (--all lists {still:|it|them})"
        lines.append(register_words(words, registers=registers, still=still))
    return "".join(f"{line}\n" for line in lines)


def _devices(devices: list[Recognised], *, used: bool) -> str:
    """What was recognised, and how sure."""
    lines = []
    for one in devices:
        names = f"--map {one.name}@{one.unit}" if one.name else "--recognise"
        words = "unit {unit} looks like {device} ({sure:.0%}, {why})"
        looks = register_words(words, unit=one.unit, device=one.chart.called, sure=one.confidence, why=one.why)
        hint = register_words("its map is used") if used else register_words("{names} names its values", names=names)
        lines.append(f"{looks}: {hint}")
    return "".join(f"{line}\n" for line in lines)


def _table_row(value: RegisterValue) -> tuple[str, ...]:
    from ..registers.telling import place_cell
    from ..words import decimal

    kind = value.type if value.changes or value.name else value.kind
    why = f"{value.name}: {value.why}" if value.name else value.why
    scale = f" x{value.scale:g}" if value.scale not in (None, 1) else ""
    return (
        str(value.unit),
        place_cell(value.area, value.address, value.words),
        register_words(kind),
        value.order or "",
        register_words(value.role or ""),
        _value_cell(value.minimum),
        _value_cell(value.maximum),
        _value_cell(value.last) + scale + (f" {value.unit_of_measure}" if value.unit_of_measure else ""),
        decimal(f"{value.confidence:.0%}"),
        why,
    )


def _value_cell(value: float | str | None) -> str:
    text = "" if value is None else f"{value:.7g}" if isinstance(value, float) else str(value)
    return shortened(text, _WIDEST)


_ROWS: Final = 1 << 14  # readings of a block
_SHOWN: Final = 12
_LONGEST: Final = 16 << 20  # bytes of a table


def find_like(arguments: argparse.Namespace, capture: Capture, limits: Options) -> int:
    """Print the registers that showed it, best first."""
    from ..registers.inference import infer
    from ..registers.like import matches_of_series, matches_of_value
    from ..registers.panel import PanelError, read_panel

    wanted = str(arguments.like)
    table = None
    try:
        float(wanted.replace(",", "."))
    except ValueError:
        table = _table_text(wanted)
    readings = gathered(capture, arguments.capture, limits, most=_ROWS).readings
    values = infer(readings, units=arguments.unit)
    try:
        if table is None:
            matches = matches_of_value(readings, wanted, values, arguments.unit)
        else:
            matches = matches_of_series(readings, read_panel(table, wanted), values, arguments.unit)
    except PanelError as error:
        raise UsageError(f"--like: {error}") from error
    if arguments.json:
        import json

        for match in matches[: 10 * _SHOWN]:
            print(json.dumps(match.to_json(), separators=(",", ":")))
    else:
        sys.stdout.write(_matches_text(matches, wanted))
    return DONE if matches else FAILED


def _table_text(name: str) -> str:
    from dissectors.maps.files import decoded

    if not name.strip():
        raise UsageError("--like: expected a number, or a table of times and values")
    path = Path(name)
    try:
        with path.open("rb") as file:
            data = file.read(_LONGEST + 1)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise UsageError(f"--like {name}: neither a number nor a table of times and values: {reason}") from error
    text = decoded(data) if len(data) <= _LONGEST else None
    if text is None:
        raise UsageError(f"--like {name}: expected a CSV table of times and values")
    return text


def _matches_text(matches: list[Match], wanted: str) -> str:
    from ..registers.panel import HALF_HOUR_S
    from ..registers.telling import unit_place
    from ..words import decimal, duration, unit_word

    if not matches:
        return f"{register_words('no register showed {wanted}', wanted=wanted)}\n"
    lines = []
    ahead = matches[0].clock_s
    if ahead is not None:
        words = (
            "the clocks differ by {time}: the table's is ahead of the capture's"
            if ahead > 0
            else "the clocks differ by {time}: the table's is behind the capture's"
        )
        zone = f" {register_words('(a time zone, or summer time)')}" if ahead % HALF_HOUR_S == 0 else ""
        lines.append(f"{register_words(words, time=duration(round(abs(ahead) * 1e9)))}{zone}")
    for match in matches[:_SHOWN]:
        where = unit_place(match.unit, match.area, match.address)
        order = f" {match.order}" if match.order else ""
        scale = f" x{match.scale:g}" if match.scale != 1 else ""
        offset = f" {match.offset:+g}" if match.offset else ""
        lag = f", {decimal(f'{match.lag_s:+.1f}')} {unit_word('s')}" if match.lag_s is not None else ""
        words = "{where}: {reading} showed {value:g}{lag} ({score:.2f})"
        reading = f"{match.type}{order}{scale}{offset}"
        lines.append(register_words(words, where=where, reading=reading, value=match.value, lag=lag, score=match.score))
    if len(matches) > _SHOWN:
        words = "and {count} more (--json lists {count:|it|them})"
        lines.append(register_words(words, count=len(matches) - _SHOWN))
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class RegisterTraffic:
    """What the registers of a capture were, and what its units say of themselves."""

    readings: RegisterReadings
    texts: UnitTexts
    asked: AskedRequests
    stopped: bool
    """By Ctrl-C: it is what was read until then, which was said."""

    @property
    def units(self) -> list[int]:
        """Those whose answers carry values, in order."""
        return sorted({block.unit for block in self.readings})


def gathered(
    capture: Capture, name: str, limits: Options, *, command: str = "registers", most: int | None = None
) -> RegisterTraffic:
    """Read a capture through; `most`: readings of a block that are kept, where it is not the usual number."""
    from ..core import deframe
    from ..registers.readings import RegisterReadings
    from ..registers.recognition import UnitTexts
    from ..registers.requests import AskedRequests
    from ..tables.separatelines import SeparateLines

    asked, lines = AskedRequests(), SeparateLines()
    readings = RegisterReadings() if most is None else RegisterReadings(most)
    texts, progress = UnitTexts(), Progress(f"{command} {name}")
    with interruptible() as stop:
        octets = 0
        for batch in deframe(capture, limits):
            readings.feed(batch)
            texts.feed(batch)
            asked.feed(batch)
            lines.feed(batch.rows)
            octets += len(batch.data)
            progress(readings.frames, octets)
            if stop():
                break
    progress.clear()
    tell_damage(name, capture)
    if ports := lines.ports:
        listed = ", ".join(map(str, ports))
        tell_user(f"{name}: {len(ports)} separate lines (ports {listed}) read as one: choose one with --only-port")
    if stop():
        tell_user("interrupted; only the part read so far was used")
    return RegisterTraffic(readings, texts, asked, stop())
