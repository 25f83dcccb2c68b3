"""A scenario made real: the conversation, on its wire or with its defect, through its tap, with the truth beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from os import PathLike
from pathlib import Path
from random import Random

import captures
from dissectors.maps import RegisterMap, map_for_unit

from .conversation import Client, Habits
from .defects import defects
from .defects.stage import Stage
from .line import WIRES, play
from .mapped.client import MappedClient
from .taps import TAPS, with_errors
from .truth import Scenario, TruthFinding, TruthFrame, TruthRegister


@dataclass(frozen=True, slots=True)
class Simulation:
    """What a tap would have delivered, with the line's settings; every frame that was really sent; what is wrong."""

    line: captures.LineSettings
    chunks: list[captures.Chunk]
    truth: tuple[TruthFrame, ...]
    findings: tuple[TruthFinding, ...] = ()
    registers: tuple[TruthRegister, ...] = ()


def simulate(scenario: Scenario) -> Simulation:
    """The scenario's capture and truth; ValueError for a wire, tap, defect or number that can't be."""
    played = _played(scenario)
    return Simulation(played.line, list(played.chunks), played.truth, played.findings, played.registers())


@dataclass(frozen=True, slots=True)
class _Played:
    """The same, its chunks made as they are taken; `registers` is asked when all are."""

    line: captures.LineSettings
    chunks: Iterator[captures.Chunk]
    truth: tuple[TruthFrame, ...]
    findings: tuple[TruthFinding, ...]
    registers: Callable[[], tuple[TruthRegister, ...]]


def _played(scenario: Scenario) -> _Played:
    _check(scenario)
    if scenario.defect is not None:
        return _with_defect(scenario, scenario.defect)
    wire, tap = WIRES[scenario.wire], TAPS[scenario.tap]
    random = Random(f"{scenario.wire} {scenario.tap} {scenario.seed}")
    baud = random.choice(tap.bauds) if scenario.baud is None else scenario.baud
    units = random.randint(3, 8) if scenario.units is None else scenario.units
    character_ns = scenario.char_bits / baud * 1e9
    habits = Habits(random.random() < wire.public, wire.vendor, wire.hostile, wire.broadcast)
    client = MappedClient(random, _charts(scenario.maps)) if scenario.maps else Client(random, habits, units)
    passed = play(client, wire, random, scenario.transactions, character_ns)
    return _Played(
        line=captures.LineSettings(baud=baud, char_bits=scenario.char_bits, tap=scenario.tap),
        chunks=tap.deliver(passed.data, passed.times, random, character_ns),
        truth=passed.frames,
        findings=(),
        registers=lambda: tuple(client.registers()) if isinstance(client, MappedClient) else (),
    )


def _charts(maps: Sequence[str]) -> list[tuple[int, RegisterMap]]:
    """The units and their maps; those without a unit get the lowest that are free."""
    named = [(chart, unit) for chart, unit in map(map_for_unit, maps)]
    free = (unit for unit in range(1, 248) if unit not in [number for _, number in named])
    return [(next(free) if unit is None else unit, chart) for chart, unit in named]


def _with_defect(scenario: Scenario, code: str) -> _Played:
    tap, random = TAPS[scenario.tap], Random(f"{code} {scenario.tap} {scenario.seed}")
    baud = random.choice(tap.bauds) if scenario.baud is None else scenario.baud
    units = random.randint(5, 8) if scenario.units is None else scenario.units
    character_ns = scenario.char_bits / baud * 1e9
    stage = Stage(random, character_ns, units)
    defects()[code].put(stage, scenario.transactions)
    chunks = tap.deliver(bytes(stage.data), stage.times, random, character_ns)
    return _Played(
        line=captures.LineSettings(baud=baud, char_bits=scenario.char_bits, tap=scenario.tap),
        chunks=with_errors(chunks, stage.errors),
        truth=tuple(stage.frames),
        findings=tuple(stage.findings),
        registers=tuple,
    )


def write(scenario: Scenario, path: str | PathLike[str]) -> None:
    """Writes the capture to `path` (its suffix chooses the format) and the truth to the same name with `.truth.jsonl`.

    With maps, what the polled registers mean goes to `.registers.jsonl`.

    Raises ValueError as `simulate` does, CaptureError where a file can't be written.
    """
    path = Path(path)
    played = _played(scenario)
    captures.write(path, played.chunks, line=played.line)
    with captures.replacing(truth_path(path)) as file:
        told: Iterable[TruthFrame | TruthFinding] = chain(played.truth, played.findings)
        lines = (each.to_json() for each in told)
        file.writelines(json.dumps(line).encode() + b"\n" for line in lines)
    if registers := played.registers():
        with captures.replacing(path.with_suffix(".registers.jsonl")) as file:
            file.writelines(json.dumps(register.to_json()).encode() + b"\n" for register in registers)


def truth_path(path: str | PathLike[str]) -> Path:
    """Where the truth of a capture stands."""
    return Path(path).with_suffix(".truth.jsonl")


def _check(scenario: Scenario) -> None:
    if scenario.wire not in WIRES:
        raise ValueError(f"no wire {scenario.wire!r}: there are {', '.join(WIRES)}")
    if scenario.tap not in TAPS:
        raise ValueError(f"no tap {scenario.tap!r}: there are {', '.join(TAPS)}")
    if scenario.defect is not None:
        _check_defect(scenario, scenario.defect)
    if scenario.transactions < 1:
        raise ValueError(f"{scenario.transactions} transactions: at least 1 is needed")
    if scenario.baud is not None and not 50 <= scenario.baud <= 10_000_000:
        raise ValueError(f"{scenario.baud} baud: 50 to 10000000 are possible")
    if not 7 <= scenario.char_bits <= 13:
        raise ValueError(f"{scenario.char_bits} bits a character: 7 to 13 are possible")
    if scenario.units is not None and not 1 <= scenario.units <= 39:
        raise ValueError(f"{scenario.units} units: 1 to 39 are possible")


def _check_defect(scenario: Scenario, code: str) -> None:
    declared = defects()
    if code not in declared:
        raise ValueError(f"no defect {code!r}: there are {', '.join(declared)}")
    if scenario.maps:
        raise ValueError("a defect is put on devices of the simulator's own, without --map")
    if scenario.wire != "clean":
        raise ValueError(f"a defect is put on the wire clean, not on {scenario.wire}")
    if scenario.units is not None and scenario.units < declared[code].units:
        raise ValueError(f"{scenario.units} units: {code} needs at least {declared[code].units}")
    if scenario.tap not in declared[code].taps:
        raise ValueError(f"a tap {scenario.tap} cannot show {code}: one of {', '.join(declared[code].taps)} can")
