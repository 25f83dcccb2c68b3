"""A scenario made real: the conversation, on its wire or with its defect, through its tap, with the truth beside it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from random import Random

import captures
from analyzer.simulation.conversation import Client, Habits
from analyzer.simulation.defects import defects
from analyzer.simulation.defects.stage import Stage
from analyzer.simulation.line import play
from analyzer.simulation.scenario import Scenario
from analyzer.simulation.taps import TAPS
from analyzer.simulation.truth import TruthFinding, TruthFrame
from analyzer.simulation.wires import WIRES


@dataclass(frozen=True, slots=True)
class Simulation:
    """What a tap would have delivered, with the line's settings; every frame that was really sent; what is wrong."""

    line: captures.LineSettings
    chunks: list[captures.Chunk]
    truth: tuple[TruthFrame, ...]
    findings: tuple[TruthFinding, ...] = ()


def simulate(scenario: Scenario) -> Simulation:
    """The scenario's capture and truth; ValueError for a wire, tap, defect or number that can't be."""
    _check(scenario)
    if scenario.defect is not None:
        return _with_defect(scenario, scenario.defect)
    wire, tap = WIRES[scenario.wire], TAPS[scenario.tap]
    random = Random(f"{scenario.wire} {scenario.tap} {scenario.seed}")
    baud = random.choice(tap.bauds) if scenario.baud is None else scenario.baud
    units = random.randint(3, 8) if scenario.units is None else scenario.units
    character_ns = scenario.char_bits / baud * 1e9
    habits = Habits(random.random() < wire.public, wire.vendor, wire.hostile, wire.broadcast)
    passed = play(Client(random, habits, units), wire, random, scenario.transactions, character_ns)
    return Simulation(
        line=captures.LineSettings(baud=baud, char_bits=scenario.char_bits, tap=scenario.tap),
        chunks=list(tap.deliver(passed.data, passed.times, random, character_ns)),
        truth=passed.frames,
    )


def _with_defect(scenario: Scenario, code: str) -> Simulation:
    tap, random = TAPS[scenario.tap], Random(f"{code} {scenario.tap} {scenario.seed}")
    baud = random.choice(tap.bauds) if scenario.baud is None else scenario.baud
    units = random.randint(5, 8) if scenario.units is None else scenario.units
    character_ns = scenario.char_bits / baud * 1e9
    stage = Stage(random, character_ns, units)
    defects()[code].put(stage, scenario.transactions)
    chunks = tap.deliver(bytes(stage.data), stage.times, random, character_ns)
    return Simulation(
        line=captures.LineSettings(baud=baud, char_bits=scenario.char_bits, tap=scenario.tap),
        chunks=list(_marked(chunks, stage.errors)),
        truth=tuple(stage.frames),
        findings=tuple(stage.findings),
    )


def _marked(chunks: Iterator[captures.Chunk], errors: Sequence[int]) -> Iterator[captures.Chunk]:
    """The chunks with the bytes marked that stand at these offsets of the stream."""
    start = 0
    for chunk in chunks:
        inside = tuple(at - start for at in errors if start <= at < start + len(chunk.data))
        yield replace(chunk, errors=inside) if inside else chunk
        start += len(chunk.data)


def write(scenario: Scenario, path: str | PathLike[str]) -> None:
    """Writes the capture to `path` (its suffix chooses the format) and the truth to the same name with `.truth.jsonl`.

    Raises ValueError as `simulate` does, CaptureError where a file can't be written.
    """
    path = Path(path)
    made = simulate(scenario)
    captures.write(path, made.chunks, line=made.line)
    with captures.replacing(path.with_suffix(".truth.jsonl")) as file:
        lines = [frame.to_json() for frame in made.truth] + [finding.to_json() for finding in made.findings]
        file.writelines(json.dumps(line).encode() + b"\n" for line in lines)


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
    known = defects()
    if code not in known:
        raise ValueError(f"no defect {code!r}: there are {', '.join(known)}")
    if scenario.wire != "clean":
        raise ValueError(f"a defect is put on the wire clean, not on {scenario.wire}")
    if scenario.units is not None and scenario.units < known[code].units:
        raise ValueError(f"{scenario.units} units: {code} needs at least {known[code].units}")
    if scenario.tap not in known[code].taps:
        raise ValueError(f"a tap {scenario.tap} cannot show {code}: one of {', '.join(known[code].taps)} can")
