"""A bus as values: devices, registers, the poll round, what is not known. Nothing is said that rows do not carry."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from dissectors.functions import exception_name

from ...languages import page_words
from ...options import Options
from ...registers.checking import MapRemark, check_map
from ...registers.inference import infer
from ...registers.readings import RegisterReadings
from ...registers.recognition import Recognised, UnitTexts, recognised
from ...registers.roles import OtherReading, RegisterValue
from .. import of_one_line, summarize
from ..hashes import capture_sha256
from ..heads import head_json, line_json
from ..model import Report, UnitRow
from .rounds import BusRound, RoundSlot, bus_round
from .sequence import KEPT, PollSequence
from .shown import Shown

if TYPE_CHECKING:
    from captures import Capture
    from dissectors.maps.files import UnitMaps
    from dissectors.maps.model import RegisterMap

    from ...core import Analysed

_SURE: Final = 0.95  # confidence below which a type is not known
_LIKELY: Final = 0.6  # and below which it is not even called likely
_NAMED: Final = 0.95  # confidence of a recognised device whose map may name registers
_READINGS: Final = 12  # of a register, before its type is told


@dataclass(frozen=True, slots=True)
class DescribedRegister:
    """A value of a unit. `is_known`: its numbers, type and role are, but for its width where others give the same
    numbers. Else it is as `value` says or as `either` does, where that is all it can be; or its registers were only
    seen, and `is_likely` says whether a type is likelier than not by much.

    `written_by`: functions by which the client writes it, so many times, first in frame `written_in`.
    """

    value: RegisterValue
    is_known: bool
    either: OtherReading | None
    is_likely: bool
    written_by: tuple[int, ...]
    writes: int
    written_in: int | None

    def to_json(self) -> dict[str, Any]:
        """As plain values; what is not known is null."""
        line = self.value.to_json()
        known = ("kind", "signed", "order", "role", "related", "same_number")
        if not self.is_known:
            line.update(dict.fromkeys(known))
        if not self.is_known and self.value.words > 1:
            line.update(dict.fromkeys(("min", "max", "last")))
        for name in ("bits", "runner_up", "why"):
            del line[name]
        type_name = self.value.type if self.is_known else None
        likely = {"type": self.value.type, "order": self.value.order} if self.is_likely else None
        either = self.either and [self._reading_json(self.value), self._reading_json(self.either)]
        return {
            **line,
            "number_confidence": round(self.value.number_confidence, 4),
            "type": type_name,
            "either": either,
            "likely": likely,
            "written_by": list(self.written_by),
            "writes": self.writes,
            "written_in": self.written_in,
        }

    @staticmethod
    def _reading_json(reading: RegisterValue | OtherReading) -> dict[str, Any]:
        names = ("address", "words", "kind", "order", "confidence")
        return {name: getattr(reading, name) for name in names}


@dataclass(frozen=True, slots=True)
class DescribedUnit:
    """A unit: what it says of itself with the frame that says it, what it looks like, its timing and registers."""

    row: UnitRow
    said: Mapping[str, int]
    looks: Recognised | None
    registers: tuple[DescribedRegister, ...]
    exceptions: tuple[tuple[int, int, int, int], ...]  # function, code, how often, first frame

    @property
    def unit(self) -> int:
        return self.row.unit

    @property
    def answered(self) -> bool:
        """Whether it ever answered, by an exception included."""
        return bool(self.row.counts.answered or self.row.counts.exceptions)

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        looks = self.looks
        return {
            "unit": self.unit,
            "answered": self.answered,
            "requests": self.row.counts.requests,
            "says": [{"text": text, "frame": frame} for text, frame in self.said.items()],
            "recognised": looks
            and {
                "map": looks.name or None,
                "device": looks.chart.called,
                "confidence": looks.confidence,
                "why": looks.why,
            },
            "times": self.row.times.to_json(),
            "exceptions": [
                {"function": function, "exception": code, "name": exception_name(code), "count": count, "frame": frame}
                for function, code, count, frame in self.exceptions
            ],
            "registers": [each.to_json() for each in self.registers],
        }


@dataclass(frozen=True, slots=True)
class Contradiction:
    """What a manual's map says otherwise than the bus; `frames`: answers that carry the registers, the first ones."""

    remark: MapRemark
    frames: tuple[int, ...]

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return {**self.remark.to_json(), "frames": list(self.frames)}


@dataclass(frozen=True, slots=True)
class BusDescription:
    """A bus described. `others`: what is asked besides the round, what is asked most first."""

    report: Report
    sha256: str | None
    units: tuple[DescribedUnit, ...]
    round: BusRound | None
    others: tuple[RoundSlot, ...]
    contradictions: tuple[Contradiction, ...]
    beyond: int  # requests whose order was not kept

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        report, turn = self.report, self.round
        return {
            **head_json(report, self.sha256),
            "line": line_json(report),
            "units": [unit.to_json() for unit in self.units],
            "round": turn
            and {
                "period_ns": turn.period_ns,
                "jitter_ns": turn.jitter_ns,
                "share": turn.share,
                "rounds": turn.rounds,
                "slots": [_slot_json(slot) for slot in turn.slots],
            },
            "others": [_slot_json(slot) for slot in self.others],
            "contradictions": [each.to_json() for each in self.contradictions],
            "not_known": list(not_known(self)),
        }


def _slot_json(slot: RoundSlot) -> dict[str, Any]:
    return {
        **slot.poll._asdict(),
        "every": slot.every or None,
        "offset_ns": slot.offset_ns,
        "count": slot.count,
        "frame": slot.frame,
    }


def describe(
    capture: Capture,
    *,
    source: str = "",
    maps: UnitMaps | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> BusDescription:
    """Read a capture through and describe its bus; `maps` are those of manuals, which it is held against."""
    readings, texts, sequence = RegisterReadings(), UnitTexts(), PollSequence()

    def watch(analysed: Analysed) -> None:
        readings.feed(analysed.batch)
        texts.feed(analysed.batch)
        sequence.feed(analysed)

    report = of_one_line(summarize(capture, source=source, options=options, progress=progress, stop=stop, watch=watch))
    named = {} if maps is None else maps.of(sorted({block.unit for block in readings}))
    remarks = [remark for remark in check_map(readings, named) if remark.kind == "contradiction"]
    looks = {one.unit: one for one in recognised(readings, texts, infer(readings))}
    values = infer(readings, charts=_charts(named, remarks, looks))
    shown = Shown(readings)
    registers = [_register(value, sequence, shown) for value in values]
    units = tuple(
        _unit(row, registers, looks.get(row.unit), report, sequence) for row in report.units if row.unit or values
    )
    turn = bus_round(sequence, timed=report.timed)
    return BusDescription(
        report,
        capture_sha256(capture),
        units,
        turn,
        _others(sequence, turn),
        tuple(
            Contradiction(each, tuple(sequence.answers_of(each.unit, each.area, each.address, each.words)))
            for each in remarks
        ),
        sequence.more,
    )


def _charts(
    named: Mapping[int, RegisterMap], remarks: list[MapRemark], looks: Mapping[int, Recognised]
) -> dict[int, RegisterMap]:
    """The maps that may name registers: no row of a manual's that the bus contradicts, no device that is unsure."""
    wrong = {(each.unit, each.area, each.address) for each in remarks}
    charts = {unit: one.chart for unit, one in looks.items() if one.confidence >= _NAMED}
    for unit, chart in named.items():
        rows = tuple(row for row in chart.rows if (unit, row.area, row.address) not in wrong)
        charts[unit] = replace(chart, rows=rows)
    return charts


def _unit(
    row: UnitRow,
    registers: list[DescribedRegister],
    looks: Recognised | None,
    report: Report,
    sequence: PollSequence,
) -> DescribedUnit:
    raised = [each for each in report.exceptions if each.unit == row.unit]
    return DescribedUnit(
        row,
        sequence.said.get(row.unit, {}),
        looks,
        tuple(register for register in registers if register.value.unit == row.unit),
        tuple(
            (each.function, each.exception, each.count, frame)
            for each in raised
            if (frame := sequence.exceptions.get((row.unit, each.function, each.exception))) is not None
        ),
    )


def _register(value: RegisterValue, sequence: PollSequence, shown: Shown) -> DescribedRegister:
    functions, count, first = sequence.writes_of(value.unit, value.area, value.address, value.words)
    moved = value.changes > 0 and value.readings >= _READINGS and value.kind not in ("constant", "unknown")
    told = value.name is not None or value.area in ("coil", "discrete")
    known = told or moved or value.kind == "text"
    sure = known and value.number_confidence >= _SURE and (told or shown(value))
    either = shown.either(value) if known and not sure else None
    likely = known and not sure and either is None and value.confidence >= _LIKELY
    return DescribedRegister(value, sure, either, likely, tuple(functions), count, first)


def _others(sequence: PollSequence, turn: BusRound | None) -> tuple[RoundSlot, ...]:
    within = {slot.poll for slot in turn.slots} if turn else set()
    rest = [(poll, held) for poll, held in sequence.polls.items() if poll not in within]
    rest.sort(key=lambda each: (-each[1].count, each[1].request))
    return tuple(RoundSlot(poll, 0, None, held.count, held.request) for poll, held in rest)


def not_known(description: BusDescription) -> Iterator[str]:
    """What this capture does not tell of the bus, in sentences."""
    report = description.report
    if report.partial:
        yield page_words("Reading stopped early: this page covers the part read.")
    if report.baud is None:
        yield page_words("The line's speed is not known (--baud).")
    if not report.timed:
        yield page_words("The capture has no times: periods, slots and response times are not known.")
    if description.round is None and report.frames:
        yield page_words("The client has no recurring poll cycle: its poll order is unknown.")
    silent = [str(unit.unit) for unit in description.units if not unit.answered and unit.unit]
    if silent:
        yield page_words("Units that never answered: {units}. Nothing is known about them.", units=", ".join(silent))
    yield from _untold([register for unit in description.units for register in unit.registers])
    if any(unit.answered and unit.looks is None and not unit.said for unit in description.units):
        yield page_words("Some units do not identify themselves and match no shipped map: their makers are unknown.")
    if description.beyond:
        yield page_words("The cycle, first frames and writes come from the first {count:,} requests.", count=KEPT)
    yield page_words("Registers that were never asked for are unknown.")


def _untold(registers: list[DescribedRegister]) -> Iterator[str]:
    """Of how many registers the type is not known, and of how many numbers the width."""
    told = {
        "Registers seen whose type cannot be derived from their values: {count:,}.": sum(
            each.value.words for each in registers if not each.is_known and each.either is None
        ),
        "Numbers with a neighbour that never changed by itself and may be their high word: {count:,}.": sum(
            each.either is not None for each in registers
        ),
        "Numbers with a neighbour that has always been 0 and may be their high word: {count:,}.": sum(
            bool(each.is_known and each.value.same_number) for each in registers
        ),
    }
    yield from (page_words(words, count=count) for words, count in told.items() if count)
