"""How much of a bus `document` gets right, and whether it invents anything.

    python benchmarks/score_document.py [--buses 30] [--devices 4] [--rounds 60] [--first-seed 9000] [--layouts FOLDER]

Buses are made of devices from layouts (`register_series`) at moved addresses, polled in a drawn order; one unit never
answers, one poll is refused, the fastest unit's setpoint is never written. A fact is a slot of the round in its place,
the refusal, the silent unit, or a register that moved: integer or float, width and word order. A number whose width the
description leaves open (the register beside it was always zero) is right where its own reading is among those told; how
many are so only by the less likely one is counted. So it is where two readings are told because a register never or
hardly moved, and it is one of them. Invented is what is said otherwise than it is; what is said to be not known is
missed, and not invented. Ranges and the round's period are counted beside the facts. Numbers are told with how sure
they are: beside the wrong ones stands how many these confidences foretell. Beside what is told stands what is called
likely, and what nobody can tell: numbers whose first register never moved. A manual with one planted contradiction is
held against each bus.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import cast

import numpy as np
from register_series import layouts, moved

import captures
from analyzer.registers.hypotheses import numbers
from analyzer.registers.roles import OtherReading, RegisterValue
from analyzer.reports.description import BusDescription, describe
from analyzer.reports.description.model import DescribedRegister
from analyzer.simulation.mapped.client import MappedClient
from analyzer.simulation.mapped.device import MappedDevice
from dissectors.crc import crc_bytes
from dissectors.maps import RegisterMap, read_map
from dissectors.maps.files import UnitMaps
from dissectors.maps.model import MapArea, MappedValue
from dissectors.values import Order

_READ = {"holding": 3, "input": 4}
_CHARACTER_NS = 286_458  # 38400 bit/s, 11 bits
_DEAD, _REFUSED = 246, 60_000
_BEGUN_NS = 10**18
_WIDEST = 4  # registers of a number


@dataclass(slots=True)
class Score:
    """Facts that were due, told rightly, and told wrongly."""

    due: int = 0
    right: int = 0
    invented: int = 0
    slots: int = 0
    slots_right: int = 0
    foretold: float = 0.0  # wrong types, by their own confidences
    likely: int = 0  # types called likely
    likely_right: int = 0
    by_either: int = 0  # right as one of the two readings told
    by_number: int = 0  # right as a number, and told with the width that it has as the less likely one
    ranges: int = 0  # least, greatest and last readings of numbers that are told
    ranges_right: int = 0
    periods_right: int = 0  # within a hundredth
    still: int = 0  # numbers whose first register never moved

    def add(self, right: bool, invented: bool = False) -> None:
        self.due += 1
        self.right += right
        self.invented += invented


class WrittenBus:
    """Devices, the polls of a round in order, and the capture of so many rounds."""

    def __init__(self, random: Random, charts: Mapping[str, RegisterMap], devices: int, rounds: int) -> None:
        units = random.sample(range(1, 240), devices)
        self.devices: list[MappedDevice] = []
        self.polls: list[
            tuple[MappedDevice | None, int, int, int, int]
        ] = []  # device, unit, function, address, quantity
        for unit in units:
            client = MappedClient(random, [(unit, moved(charts[random.choice(sorted(charts))], random))], 0.2)
            self.devices.append(client.devices[0])
            blocks = dict.fromkeys((poll.area, poll.address, poll.quantity) for poll in client.polls)
            self.polls += [
                (client.devices[0], unit, _READ[area], address, quantity)
                for area, address, quantity in blocks
                if area in _READ
            ]
        self.polls += [(None, _DEAD, 3, 0, 1), (None, units[0], 3, _REFUSED, 1)]
        random.shuffle(self.polls)
        self.seen: dict[tuple[int, str, int], list[int]] = {}
        self.lines = [json.dumps({"format": "serial-chunks", "version": 1, "baud": 38400, "char_bits": 11})]
        self.t_ns, self.rounds = _BEGUN_NS, rounds
        for _ in range(rounds):
            self._round(random)

    def _round(self, random: Random) -> None:
        for each in self.devices:
            each.step()
        for device, unit, function, address, quantity in self.polls:
            self._put(bytes((unit, function)) + address.to_bytes(2) + quantity.to_bytes(2), random.randrange(5, 8))
            if unit == _DEAD:
                self.t_ns += 200_000_000
            elif device is None:
                self._put(bytes((unit, function | 0x80, 2)), 4)
            else:
                area: MapArea = "holding" if function == 3 else "input"
                words = device.read(area, address, quantity)
                for at, word in enumerate(words):
                    self.seen.setdefault((unit, area, address + at), []).append(word)
                octets = b"".join(word.to_bytes(2) for word in words)
                self._put(bytes((unit, function, len(octets))) + octets, random.randrange(3, 12))
        self.t_ns += 500_000_000

    def _put(self, body: bytes, pause_ms: int) -> None:
        frame = body + crc_bytes(body)
        self.t_ns += pause_ms * 1_000_000 + len(frame) * _CHARACTER_NS
        self.lines.append(json.dumps({"t_ns": self.t_ns, "hex": frame.hex()}))

    def moved_rows(self, device: MappedDevice) -> list[MappedValue]:
        """The numbers of a device that were asked for whole, and of which a word moved."""
        rows = []
        for row in device.chart.rows:
            series = [self.seen.get((device.unit, row.area, at)) for at in range(row.address, row.end)]
            whole = row.area in _READ and all(series) and row.type != "text" and not row.other.get("form")
            if whole and any(len(set(each or ())) > 1 for each in series):
                rows.append(row)
        return rows


def scored(bus: WrittenBus, told: BusDescription, score: Score) -> None:
    """Enter one bus."""
    slots = [] if told.round is None else [slot.poll for slot in told.round.slots]
    due: list[tuple[int | None, ...]] = [poll[1:] for poll in bus.polls]
    first = due.index(tuple(slots[0])) if slots and tuple(slots[0]) in due else 0
    turned = due[first:] + due[:first]
    score.slots += len(due)
    score.slots_right += sum(tuple(one) == other for one, other in zip(slots, turned, strict=False))
    for at, poll in enumerate(turned):
        said = tuple(slots[at]) if at < len(slots) else None
        score.add(said == poll, said is not None and said != poll)
    period_ns = (bus.t_ns - _BEGUN_NS) / bus.rounds
    score.periods_right += told.round is not None and abs((told.round.period_ns or 0) / period_ns - 1) < 0.01
    units = {unit.unit: unit for unit in told.units}
    score.add(not units[_DEAD].answered and not units[_DEAD].registers, bool(units[_DEAD].registers))
    refused = [unit.unit for unit in told.units if any(code == 2 for _, code, *_ in unit.exceptions)]
    score.add(refused == [bus.devices[0].unit], bool(set(refused) - {bus.devices[0].unit}))
    for device in bus.devices:
        registers = {(each.value.area, each.value.address): each for each in units[device.unit].registers}
        held = [_is_in_range(bus, each) for each in units[device.unit].registers if each.is_known]
        score.ranges += sum(right is not None for right in held)
        score.ranges_right += sum(right is True for right in held)
        for row in bus.moved_rows(device):
            answer = _answer(row, registers)
            score.still += len(set(bus.seen[device.unit, row.area, row.address])) == 1
            if answer is not None and answer.either is not None:
                right = _is_right(row, answer.value) or _is_right(row, answer.either)
                score.add(right, not right)
                score.by_either += right
                score.foretold += 1 - answer.value.confidence - answer.either.confidence
            elif answer is None or not answer.is_known:
                score.add(right=False)
                if answer is not None and answer.is_likely:
                    score.likely += 1
                    score.likely_right += _is_right(row, answer.value)
            else:
                score.foretold += 1 - answer.value.number_confidence
                exact = _is_right(row, answer.value)
                right = exact or _is_among(row, answer)
                score.add(right, not right)
                score.by_number += right and not exact


def _is_in_range(bus: WrittenBus, register: DescribedRegister) -> bool | None:
    """Whether what is told of the readings of a number is so; None where requests that overlap read its registers."""
    value = register.value
    series = [bus.seen[value.unit, value.area, value.address + n] for n in range(value.words)]
    if len(set(map(len, series))) > 1 or value.kind == "text":
        return None
    order = cast(Order, value.order or "ABCD")
    words = np.array(series, np.uint16).T
    read = numbers(words, order, is_float=value.kind == "float", signed=value.signed)
    told = np.array((value.minimum, value.maximum, value.last), np.float64)
    return bool(np.allclose(told, (np.nanmin(read), np.nanmax(read), read[-1]), rtol=1e-6, atol=1e-6, equal_nan=True))


def _answer(row: MappedValue, registers: Mapping[tuple[MapArea, int], DescribedRegister]) -> DescribedRegister | None:
    """What is said at the place of a number, or of that place as another reading of a number that is known."""
    here = registers.get((row.area, row.address))
    if here is None or not (here.is_known or here.either):
        near = (registers.get((row.area, at)) for at in range(row.address - _WIDEST + 1, row.end))
        return next((each for each in near if each and _is_among(row, each)), here)
    return here


def _is_right(row: MappedValue, value: RegisterValue | OtherReading) -> bool:
    if row.type == "bits" and value.kind == "bits":
        return True  # each flag has its register and its bit, however many registers are called one field
    order = row.order if row.length > 1 else None
    told = value.address, value.words, value.order, value.kind == "float"
    return told == (row.address, row.length, order, row.is_float)


def _is_among(row: MappedValue, answer: DescribedRegister) -> bool:
    """Whether it is one of the readings that are told to give the same number."""
    order = row.order if row.length > 1 else None
    if answer.either is not None:
        return _is_right(row, answer.either)
    return (
        answer.is_known
        and not row.is_float
        and any(
            (each.address, each.words, each.order) == (row.address, row.length, order)
            for each in answer.value.same_number
        )
    )


def planted(bus: WrittenBus, random: Random) -> UnitMaps | None:
    """A manual in which one number of two registers is of another type than it is; None where there is none."""
    rows = [
        (device, row)
        for device in bus.devices
        for row in bus.moved_rows(device)
        if row.length == 2 and row.type in ("u32", "s32", "f32")
    ]
    if not rows:
        return None
    device, row = random.choice(rows)
    wrong = replace(
        row, type="u32" if row.is_float else "f32", minimum=None, maximum=None, scale=1.0, scale_address=None
    )
    return UnitMaps({device.unit: RegisterMap(device="a manual", rows=(wrong,))})


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--buses", type=int, default=30)
    parser.add_argument("--devices", type=int, default=4, help="of a bus, at the most")
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--first-seed", type=int, default=9000)
    parser.add_argument("--layouts", type=Path, help="a folder of maps, instead of all that there are")
    arguments = parser.parse_args()
    charts = layouts() if arguments.layouts is None else {p.stem: read_map(p) for p in arguments.layouts.glob("*.csv")}
    score, manuals, found = Score(), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.buses):
            random = Random(seed)
            bus = WrittenBus(random, charts, random.randint(2, arguments.devices), arguments.rounds)
            path = Path(folder) / f"{seed}.jsonl"
            path.write_text("\n".join(bus.lines) + "\n")
            scored(bus, describe(captures.open(path)), score)
            manual = planted(bus, random)
            if manual is not None:
                manuals += 1
                held = describe(captures.open(path), maps=manual).contradictions
                found += any(each.frames for each in held)
            path.unlink()
    print(f"facts: {score.right} of {score.due} right ({score.right / score.due:.3f}), {score.invented} invented")
    print(f"of them right as numbers, of which the width is the less likely of those told: {score.by_number}")
    print(f"of them right as one of two readings told: {score.by_either}")
    print(f"wrong ones that their confidences foretell: {score.foretold:.1f}")
    told = score.right + score.likely_right
    likely = f"{score.likely_right} of {score.likely} right"
    print(f"types called likely: {likely}; with them {told / score.due:.3f} of the facts")
    print(f"numbers whose first register never moved: {score.still}")
    print(f"ranges of numbers that are told: {score.ranges_right} of {score.ranges} right")
    print(f"periods: {score.periods_right} of {arguments.buses} right within a hundredth")
    print(f"slots of the round: {score.slots_right} of {score.slots} in their place")
    print(f"planted contradictions: {found} of {manuals} found with frames")


if __name__ == "__main__":
    main()
