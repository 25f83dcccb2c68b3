"""A scenario made real: the conversation, on its wire or with its defect, through its tap, with the truth beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Final

import captures
from dissectors.maps import RegisterMap, map_for_unit

from .chances import Chances
from .conversation import Client, Habits
from .defects import defects
from .defects.stage import Stage
from .line import WIRES, WireBytes, play
from .mapped.client import MappedClient
from .taps import TAPS, USUAL_BAUDS, SimulatedTap, with_errors
from .truth import Scenario, TruthFinding, TruthFrame, TruthRegister

_UNITS: Final = (5, 8)


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
    played = played_bus(scenario)
    frames: list[TruthFrame] = []
    chunks = list(played.chunks(frames.extend))
    return Simulation(played.line, chunks, tuple(frames), tuple(played.findings), played.registers())


@dataclass(frozen=True, slots=True)
class PlayedBus:
    """A bus that passes piece by piece; `findings`, `errors` and `registers` are complete when all pieces are taken."""

    line: captures.LineSettings
    pieces: Iterator[WireBytes]
    tap: SimulatedTap
    chances: Chances
    findings: Sequence[TruthFinding] = ()
    errors: Sequence[int] = ()
    registers: Callable[[], tuple[TruthRegister, ...]] = tuple

    def chunks(self, heard: Callable[[Iterable[TruthFrame]], object]) -> Iterator[captures.Chunk]:
        """What the tap delivers; `heard` gets the frames before any chunk that holds their bytes."""

        def octets() -> Iterator[tuple[int, float]]:
            for piece in self.pieces:
                heard(piece.frames)
                yield from zip(piece.data, piece.times, strict=True)

        return with_errors(self.tap.hears(octets(), self.chances.tap, self.line.character_ns or 0.0), self.errors)


def played_bus(scenario: Scenario) -> PlayedBus:
    """The scenario's bus, ready to be heard; ValueError as `simulate`."""
    _check(scenario)
    wire = WIRES.get(scenario.wire or "clean", WIRES["clean"])
    chances = Chances.of(scenario.seed, scenario.defect or scenario.wire or "nothing")
    bus = chances.bus
    drawn_baud, drawn_units, public = bus.choice(USUAL_BAUDS), bus.randint(*_UNITS), bus.random() < wire.public
    baud = drawn_baud if scenario.baud is None else scenario.baud
    units = drawn_units if scenario.units is None else scenario.units
    line = captures.LineSettings(baud=baud, char_bits=scenario.char_bits, tap=scenario.tap)
    character_ns = scenario.char_bits / baud * 1e9
    play_on = partial(PlayedBus, line, tap=TAPS[scenario.tap], chances=chances)
    if scenario.maps:
        polling = MappedClient(bus, _charts(scenario.maps))
        pieces = play(polling, wire, chances, scenario.transactions, character_ns)
        return play_on(pieces=pieces, registers=lambda: tuple(polling.registers()))
    if scenario.defect is None and scenario.wire is not None:
        habits = Habits(public, wire.vendor, wire.hostile, wire.broadcast)
        return play_on(pieces=play(Client(bus, habits, units), wire, chances, scenario.transactions, character_ns))
    stage = Stage(chances, character_ns, units)
    steps = stage.healthy(scenario.transactions)
    if scenario.defect is not None:
        steps = defects()[scenario.defect].put(stage, scenario.transactions)
    pieces = (stage.passing.taken() for _ in steps)
    return play_on(pieces=pieces, findings=stage.findings, errors=stage.errors)


def _charts(maps: Sequence[str]) -> list[tuple[int, RegisterMap]]:
    """The units and their maps; those without a unit get the lowest that are free."""
    named = [(chart, unit) for chart, unit in map(map_for_unit, maps)]
    free = (unit for unit in range(1, 248) if unit not in [number for _, number in named])
    return [(next(free) if unit is None else unit, chart) for chart, unit in named]


def write(scenario: Scenario, path: str | PathLike[str]) -> None:
    """Writes the capture to `path` (its suffix chooses the format) and the truth to the same name with `.truth.jsonl`.

    With maps, what the polled registers mean goes to `.registers.jsonl`. Frames are written as they are made: memory
    does not grow with their number.

    Raises ValueError as `simulate` does, CaptureError where a file can't be written.
    """
    path = Path(path)
    played = played_bus(scenario)
    with captures.replacing(truth_path(path)) as file:
        captures.write(path, played.chunks(lambda frames: file.writelines(_lines(frames))), line=played.line)
        file.writelines(_lines(played.findings))
    if registers := played.registers():
        with captures.replacing(path.with_suffix(".registers.jsonl")) as file:
            file.writelines(_lines(registers))


def _lines(told: Iterable[TruthFrame | TruthFinding | TruthRegister]) -> Iterator[bytes]:
    return (json.dumps(each.to_json()).encode() + b"\n" for each in told)


def truth_path(path: str | PathLike[str]) -> Path:
    """Where the truth of a capture stands."""
    return Path(path).with_suffix(".truth.jsonl")


def _check(scenario: Scenario) -> None:
    if scenario.wire is not None and scenario.wire not in WIRES:
        raise ValueError(f"no wire {scenario.wire!r}: choose from {', '.join(WIRES)}")
    if scenario.tap not in TAPS:
        raise ValueError(f"no tap {scenario.tap!r}: choose from {', '.join(TAPS)}")
    if scenario.defect is not None:
        _check_defect(scenario, scenario.defect)
    if scenario.transactions < 1:
        raise ValueError(f"{scenario.transactions} transactions: at least 1 is needed")
    if scenario.baud is not None and not 50 <= scenario.baud <= 10_000_000:
        raise ValueError(f"{scenario.baud} baud: must be 50 to 10000000")
    if not 7 <= scenario.char_bits <= 13:
        raise ValueError(f"{scenario.char_bits} bits per character: must be 7 to 13")
    if scenario.units is not None and not 1 <= scenario.units <= 39:
        raise ValueError(f"{scenario.units} units: must be 1 to 39")


def _check_defect(scenario: Scenario, code: str) -> None:
    declared = defects()
    if code not in declared:
        raise ValueError(f"no defect {code!r}: choose from {', '.join(declared)}")
    if scenario.maps:
        raise ValueError("--defect works on the simulator's own devices: leave out --map")
    if scenario.wire not in (None, "clean"):
        raise ValueError(f"--defect needs --wire clean, not {scenario.wire}")
    if scenario.units is not None and scenario.units < declared[code].units:
        raise ValueError(f"{scenario.units} units: {code} needs at least {declared[code].units}")
    if scenario.tap not in declared[code].taps:
        raise ValueError(f"a tap {scenario.tap} cannot show {code}: use one of {', '.join(declared[code].taps)}")
