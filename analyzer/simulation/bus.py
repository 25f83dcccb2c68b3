"""A scenario made real: the conversation, on its wire, through its tap, with the truth beside it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from random import Random

import captures
from analyzer.simulation.conversation import Client, Habits
from analyzer.simulation.line import play
from analyzer.simulation.scenario import Scenario
from analyzer.simulation.taps import TAPS
from analyzer.simulation.truth import TruthFrame
from analyzer.simulation.wires import WIRES


@dataclass(frozen=True, slots=True)
class Simulation:
    """What a tap would have delivered, with the line's settings, and every frame that was really sent."""

    line: captures.LineSettings
    chunks: list[captures.Chunk]
    truth: tuple[TruthFrame, ...]


def simulate(scenario: Scenario) -> Simulation:
    """The scenario's capture and truth; ValueError for a wire, tap or number that can't be."""
    _check(scenario)
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


def write(scenario: Scenario, path: str | PathLike[str]) -> None:
    """Writes the capture to `path` (its suffix chooses the format) and the truth to the same name with `.truth.jsonl`.

    Raises ValueError as `simulate` does, CaptureError where a file can't be written.
    """
    path = Path(path)
    made = simulate(scenario)
    captures.write(path, made.chunks, line=made.line)
    with captures.replacing(path.with_suffix(".truth.jsonl")) as file:
        file.writelines(json.dumps(frame.to_json()).encode() + b"\n" for frame in made.truth)


def _check(scenario: Scenario) -> None:
    if scenario.wire not in WIRES:
        raise ValueError(f"no wire {scenario.wire!r}: there are {', '.join(WIRES)}")
    if scenario.tap not in TAPS:
        raise ValueError(f"no tap {scenario.tap!r}: there are {', '.join(TAPS)}")
    if scenario.transactions < 1:
        raise ValueError(f"{scenario.transactions} transactions: at least 1 is needed")
    if scenario.baud is not None and not 50 <= scenario.baud <= 10_000_000:
        raise ValueError(f"{scenario.baud} baud: 50 to 10000000 are possible")
    if not 7 <= scenario.char_bits <= 13:
        raise ValueError(f"{scenario.char_bits} bits a character: 7 to 13 are possible")
    if scenario.units is not None and not 1 <= scenario.units <= 39:
        raise ValueError(f"{scenario.units} units: 1 to 39 are possible")
