"""`rtuscope plot`: one register over time, drawn in the terminal or as a picture."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ..languages import register_words, tr
from .commands import DONE, UsageError
from .inputs import (
    add_capture_arguments,
    add_map_argument,
    chosen_charts,
    load_functions,
    open_capture,
    tell_damage,
    unit_number,
)
from .registers import own_words_of
from .terminal import add_overwrite_argument, tell_user, to_be_overwritten

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from captures import Capture
    from dissectors.maps.model import RegisterMap

    from ..analysis import Analysis
    from ..registers.roles import RegisterValue

EXAMPLE = """\
rtuscope simulate meter.jsonl --map eastron-sdm630@1
rtuscope plot meter.jsonl unit 1 30001 --map eastron-sdm630@1"""
_AREAS: Final = ("holding", "input", "coil", "discrete")
_PICTURES: Final = (".png", ".svg", ".pdf")
_LINES: Final = 12  # of a curve that moves
_LABEL: Final = 12  # columns left of the curve
_NARROWEST: Final = 20  # columns of the curve


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument("word", metavar="unit", choices=("unit",), help="the word `unit`, followed by its number")
    parser.add_argument("unit", type=unit_number, metavar="N", help="the unit's number")
    parser.add_argument(
        "address", metavar="ADDRESS", help="40108, 400108 or 4x108 as manuals count; below 10000 as on the wire, from 0"
    )
    parser.add_argument("--area", choices=_AREAS, help="the area, if several areas have this wire address")
    parser.add_argument("-o", "--output", metavar="FILE", help="a picture: .png, .svg or .pdf (needs matplotlib)")
    add_overwrite_argument(parser, "FILE")
    add_map_argument(parser)
    parser.add_argument("--raw", action="store_true", help="draw the register's own word, whatever value it is part of")


def run(arguments: argparse.Namespace) -> int:
    """Draw it."""
    from dissectors.maps.files import UnitMaps

    from ..analysis import Analysis
    from ..registers.drafting import drafted_map
    from ..registers.watch import is_sure

    picture = _picture(arguments.output)
    load_functions(arguments)
    area, address = place_of(arguments.address)
    capture = open_capture(arguments)
    if not capture.timed:
        raise UsageError(f"{arguments.capture}: a capture without timestamps cannot be plotted")
    unit, charts = arguments.unit, chosen_charts(arguments)
    told: list[RegisterValue] = []
    if arguments.raw:
        charts = UnitMaps()
    elif charts.get(unit) is None:
        told = _told(capture, arguments, address)
        charts = UnitMaps({**charts, unit: drafted_map([each for each in told if is_sure(each)], "", "")}, charts.other)
    chart = charts.get(unit)
    readings = _readings(Analysis(capture, maps=charts or None), unit, address, chart)
    tell_damage(arguments.capture, capture)
    area = _area(area or arguments.area, readings, unit, address)
    times, numbers, name = readings[area]
    value = next((each for each in told if each.area == area), None)
    place, note = _meaning(area, address, name, value)
    title = register_words("unit {unit} {place}", unit=unit, place=place)
    if note:
        tell_user(note)
    if picture is None:
        _draw(title, times, numbers)
        return DONE
    from ..exports.sink import output
    from ..plots import drawn_series

    to_be_overwritten(arguments.output, overwrite=arguments.overwrite, source=capture.path)
    try:
        row = None if chart is None else chart.at(area, address)
        measure = "raw value" if row is None else row.unit or "value"
        drawn = drawn_series(picture.suffix[1:].lower(), {name or area: (times, numbers)}, title, measure)
    except ImportError as error:
        raise UsageError(str(error)) from error
    with output(picture) as file:
        file.write(drawn)
    return DONE


def place_of(text: str) -> tuple[str | None, int]:
    """Area (None: not said) and address from 0 of a register as people write it; UsageError for what is none."""
    from dissectors.values import ValueFormError, physical

    from ..exports.records import AREA_NAMES
    from ..tables.columns import AREA_CODES

    if text.isascii() and text.isdecimal() and len(text) < 5:
        return None, int(text)
    try:
        area, address = physical(text)
    except ValueFormError:
        raise UsageError(
            f"{text!r} is not an address: use 40108, 400108 or 4x108, or count from 0 as on the wire"
        ) from None
    return AREA_NAMES[AREA_CODES[area]], address


def _picture(text: str | None) -> Path | None:
    if text is None:
        return None
    path = Path(text)
    if path.suffix.lower() not in _PICTURES:
        raise UsageError(f"{text}: a picture's name must end in {', '.join(_PICTURES)}")
    return path


Reading = tuple["NDArray[np.int64]", "NDArray[np.float64]", str | None]


def _told(capture: Capture, arguments: argparse.Namespace, address: int) -> list[RegisterValue]:
    """The values that have this address, one an area, as far as readings and the user's own words tell."""
    from ..core import deframe
    from ..registers.drafting import with_own_words
    from ..registers.inference import infer
    from ..registers.readings import RegisterReadings

    readings = RegisterReadings()
    for batch in deframe(capture):
        readings.feed(batch)
    own_words = with_own_words({}, own_words_of(str(arguments.capture)))
    values = infer(readings, units=[arguments.unit], charts=own_words)
    there = (value for value in values if value.address <= address < value.address + value.words)
    return list({value.area: value for value in there}.values())


def _meaning(area: str, address: int, name: str | None, value: RegisterValue | None) -> tuple[str, str]:
    """What is drawn, and what is to be said of that: of which value the register is a part, and who says so."""
    from ..registers.telling import place_words
    from ..registers.watch import is_sure, typed

    if value is None or (value.words == 1 and value.kind != "int"):
        return name or place_words(area, address), ""
    place, sure = place_words(area, value.address, value.words), f"{value.confidence:.0%}"
    if is_sure(value):
        note = f"{place} is read as {typed(value)}, as its values tell ({sure} sure); --raw draws the word"
        return f"{place}, {typed(value)}", note if value.words > 1 or value.signed else ""
    if value.words == 1 or value.kind == "constant":
        return place_words(area, address), ""
    note = f"this is one word: {place} may be one value, {typed(value)} ({sure} sure); --map names its type"
    return place_words(area, address), note


def _readings(bus: Analysis, unit: int, address: int, chart: RegisterMap | None) -> dict[str, Reading]:
    """By area the times (ns, ascending), numbers and name of an address of a unit, or of the value that it is a part
    of."""
    import numpy as np

    from ..exports.records import AREA_NAMES

    rows = {} if chart is None else {area: chart.at(area, address) for area in AREA_NAMES.values()}
    begins = {area: address if row is None else row.address for area, row in rows.items()}
    found: dict[str, list[tuple[int, float, str | None]]] = {}
    for columns in bus.columns("values"):
        wanted = np.array([begins.get(area, address) for area in columns["area"]], np.int64)
        chosen = (np.array(columns["unit"]) == unit) & (np.array(columns["address"]) == wanted)
        for at in np.flatnonzero(chosen).tolist():
            number, raw = columns.get("value", columns["raw"])[at], columns["raw"][at]
            shown = raw if number is None else number
            name = columns["name"][at] if "name" in columns else None
            if isinstance(shown, int | float):
                found.setdefault(columns["area"][at], []).append((columns["t_ns"][at], float(shown), name))
    made: dict[str, Reading] = {}
    for area, known in found.items():
        known.sort(key=lambda reading: reading[0])
        name = next((name for *_, name in known if name), None)
        made[area] = np.array([t_ns for t_ns, *_ in known], np.int64), np.array([one for _, one, _ in known]), name
    return made


def _area(area: str | None, readings: dict[str, Reading], unit: int, address: int) -> str:
    """The area that is meant; UsageError where it has no reading, or where several have."""
    if area is None and len(readings) > 1:
        raise UsageError(f"unit {unit} has {address} in {' and '.join(readings)}: choose with --area")
    if area is None and readings:
        return next(iter(readings))
    if area not in readings:
        from ..registers.telling import place_words

        place = place_words(area, address) if area else f"address {address}"
        raise UsageError(f"unit {unit} has no readings of {place}: rtuscope registers lists what there is")
    return area


def _draw(title: str, times: NDArray[np.int64], numbers: NDArray[np.float64]) -> None:
    """The curve in braille, the ends of its scale beside it, the ends of its time below."""
    from ..tui.plot import Series, dots, told_apart
    from ..words import is_clock, moment, seconds, unit_word

    columns = max(_NARROWEST, shutil.get_terminal_size().columns - _LABEL - 2)
    series = Series(title, times, numbers)
    span = int(times[0]), int(times[-1])
    low, high = told_apart(*(series.scale or (0.0, 0.0)), _LABEL)
    lines = _LINES if low != high else 1
    least, most = told_apart(*(series.range or (0.0, 0.0)), _LABEL)
    print(tr("{title}, {count:,} readings from {low} to {high}", title=title, count=len(times), low=least, high=most))
    for row, cells in enumerate(dots(series, span, columns, lines).tolist()):
        label = high if row == 0 else low if row == lines - 1 else ""
        text = "".join(chr(0x2800 + cell) if cell else " " for cell in cells)
        print(f"{label:>{_LABEL}} {text}".rstrip())
    first, last = (moment(t_ns) if is_clock(t_ns) else f"{seconds(t_ns)} {unit_word('s')}" for t_ns in span)
    print(" " * (_LABEL + 1) + first + " " * max(2, columns - len(first) - len(last)) + last)
