"""What the registers of a bus mean, from what they were.

    readings = RegisterReadings()
    for batch in analyzer.open("bus.mcap").batches():
        readings.feed(batch)
    for value in infer(readings):
        print(value.unit, value.address, value.type, value.confidence)

Theory: each polled block is cut into values. How likely each cut is follows from the description length of the series
under each reading, tables learnt on open layouts, and a second pass in the light of the whole device (all three:
`evidence`), and sums over all cuts (`hypotheses`). A map that is known decides for its registers and teaches the rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from dissectors.maps.model import MappedValue, RegisterMap
from dissectors.values import Order

from ..languages import register_words
from . import roles
from .company import asked_alike
from .drafting import SAID
from .evidence import Weights, shipped_weights
from .hypotheses import HYPOTHESES, patterns
from .looks import NO_VALUE
from .mixed import SHORT, UNSURE_AT_MOST, Block, doubtful_blocks
from .outsiders import bit_values, exclude, swapped_floats, text_value, texts_in
from .readings import BlockReadings, RegisterReadings
from .roles import OtherReading, RegisterValue, SeriesKey, reasons, with_relations
from .runs import LEAST_TOLD, Cut, Run, cut_of, run_posteriors, runs_of
from .spans import ReadSpan
from .telling import STILL

_CLOCK_S: Final = 5.0  # seconds, before a clock is told
_PAIRS: Final = [n for n, hypothesis in enumerate(HYPOTHESES) if hypothesis.family == "i32"]
_RELATED_BLOCKS: Final = 64  # blocks in which relations are sought
_MAPPED_KINDS: Final = {"bits": "bits", "enum": "enum", "time": "time"}  # of a map's types; the others are numbers
_NOTHING: Final = (0, *NO_VALUE)  # words that say nothing when they never move


def infer(
    readings: RegisterReadings,
    *,
    units: Sequence[int] | None = None,
    charts: Mapping[int, RegisterMap] | None = None,
    weights: Weights | None = None,
    alone: bool = False,
) -> list[RegisterValue]:
    """The values of all units, or of these, by unit, area and address; `charts` are the maps of units. Units are
    weighed together with their sisters; these with none but each other where they stand `alone`."""
    weights = weights or shipped_weights()
    charts = charts or {}
    blocks = list(readings)
    if units is not None:
        heard = set(units) if alone else asked_alike(blocks, units)
        blocks = [block for block in blocks if block.unit in heard]
    values, runs = _as_they_stand(blocks, charts, weights, ())
    turned = _turned(blocks, values, charts, weights)
    if turned:
        values, runs = _as_they_stand(blocks, charts, weights, turned)
        replaced = {(v.unit, v.area, v.address + n) for v in turned for n in range(v.words)}
        values = [value for value in values if value.key not in replaced] + turned
    if units is not None:
        values = [value for value in values if value.unit in units]
    values.sort(key=lambda value: value.key)
    return with_relations(values, _moved_series(runs, values))


def _turned(
    blocks: Sequence[BlockReadings],
    values: Sequence[RegisterValue],
    charts: Mapping[int, RegisterMap],
    weights: Weights,
) -> list[RegisterValue]:
    """Floats with swapped bytes, of units without a map."""
    turned: list[RegisterValue] = []
    for unit in {block.unit for block in blocks} - set(charts):
        turned += swapped_floats(
            [block for block in blocks if block.unit == unit],
            [value for value in values if value.unit == unit],
            lambda swapped: _as_they_stand(swapped, {}, weights, ())[0],
        )
    return turned


def _as_they_stand(
    blocks: Sequence[BlockReadings],
    charts: Mapping[int, RegisterMap],
    weights: Weights,
    turned: Sequence[RegisterValue],
) -> tuple[list[RegisterValue], list[Run]]:
    """The values of blocks, and their runs; where values are `turned` only single registers stand."""
    runs = runs_of(blocks)
    for value in turned:
        for run in runs:
            if (run.unit, run.area) == (value.unit, value.area):
                exclude(run, value.address, value.words)
    for run in runs:
        _settle_clocks(run)
        if run.unit in charts:
            _settle_mapped(run, charts[run.unit])
    doubts = doubtful_blocks(runs)
    cuts: dict[int, list[tuple[Run, list[Cut]]]] = {}
    for run, posterior in zip(runs, run_posteriors(runs, weights), strict=True):
        cuts.setdefault(run.unit, []).append((run, cut_of(run, posterior)))
    values: list[RegisterValue] = []
    for unit in sorted({block.unit for block in blocks}):
        chart = charts.get(unit)
        order = _device_order([cut for _, cut_list in cuts.get(unit, []) for cut in cut_list])
        for run, cut_list in cuts.get(unit, []):
            sisters = sorted({runs[number].unit for number, _ in run.sisters})
            values += (_claimed(value, run, chart, doubts) for value in _values(run, cut_list, chart, order, sisters))
        values += bit_values([block for block in blocks if block.unit == unit], chart)
    return values, runs


def _moved_series(
    runs: Sequence[Run], values: Sequence[RegisterValue]
) -> dict[SeriesKey, tuple[int, NDArray[np.float64]]]:
    """The readings of numbers that moved, each with the number of its block, of the first blocks that have several."""
    by_area: dict[tuple[int, str], list[Run]] = {}
    for run in runs:
        by_area.setdefault((run.unit, run.area), []).append(run)
    moved: dict[int, dict[SeriesKey, NDArray[np.float64]]] = {}
    for value in values:
        if not value.changes or value.kind not in ("int", "float") or value.words not in (1, 2, 4):
            continue
        inside = (r for r in by_area.get((value.unit, value.area), ()) if 0 <= value.address - r.address < r.length)
        owner = next(inside, None)
        if owner is None:
            continue
        order: Order = cast(Order, value.order or "ABCD")
        plain = {"BADC": "ABCD", "DCBA": "CDAB"}.get(value.order or "", value.order)
        number = next(
            n for n, h in enumerate(HYPOTHESES)
            if (h.words, h.is_float, h.order) == (value.words, value.kind == "float", plain)
        )  # fmt: skip
        span = ReadSpan.of(owner, value.address - owner.address, number)
        if id(span.block) in moved or len(moved) < _RELATED_BLOCKS:
            moved.setdefault(id(span.block), {})[value.key] = span.numbers(order, signed=value.signed)
    return {
        key: (number, floats) for number, by_key in moved.items() if len(by_key) > 2 for key, floats in by_key.items()
    }


def _settle_mapped(run: Run, chart: RegisterMap) -> None:
    """A mapped value excludes every other reading of its registers."""
    for row in chart.within(run.area, run.address, run.length):
        number = hypothesis_number(row)
        if number is not None and run.fits[row.address - run.address, number]:
            _settle(run, row.address - run.address, number)


def _settle_clocks(run: Run) -> None:
    """Two registers that count seconds since 1970 as fast as time passes are that, and nothing else."""
    for (words, _), block in zip(run.series, run.blocks, strict=True):
        if block.last_ns - block.first_ns < _CLOCK_S * 1e9 or block.quantity < 2:
            continue
        for number in _PAIRS:
            order: Order = HYPOTHESES[number].order or "ABCD"
            ends = np.stack((words[0], block.last))
            pairs = patterns(np.stack((ends[:, :-1], ends[:, 1:]), axis=-1), order)
            for at in np.flatnonzero((pairs[0] >= roles.EPOCH[0]) & (pairs[1] > pairs[0])).tolist():
                if roles.is_clock(pairs[:, at], block.first_ns, block.last_ns):
                    _settle(run, block.address - run.address + at, number)


def _settle(run: Run, begin: int, number: int) -> None:
    """Only this hypothesis stands for its registers."""
    end = begin + HYPOTHESES[number].words
    for rival, hypothesis in enumerate(HYPOTHESES):
        run.fits[max(0, begin - hypothesis.words + 1) : end, rival] = False
    run.fits[begin, number] = True


def hypothesis_number(row: MappedValue) -> int | None:
    """The hypothesis that a mapped value is, bytes swapped in its words or not; None where it is none of them."""
    order = {"BADC": "ABCD", "DCBA": "CDAB"}.get(row.order, row.order)
    for number, hypothesis in enumerate(HYPOTHESES):
        same = (hypothesis.words, hypothesis.is_float) == (row.length, row.is_float) and row.type != "text"
        if same and hypothesis.order in (None, order):
            return number
    return None


def _device_order(cuts: list[Cut]) -> str | None:
    """The word order of which the device's other values leave little doubt."""
    sums = {"ABCD": 0.0, "CDAB": 0.0}
    for cut in cuts:
        order = HYPOTHESES[cut.number].order
        if cut.moved and order:
            sums[order] += cut.confidence
    best, second = sorted(sums, key=lambda order: -sums[order])
    return best if sums[best] > 1.5 and sums[best] > 5 * sums[second] else None


def _values(
    run: Run, cuts: list[Cut], chart: RegisterMap | None, order: str | None, sisters: Sequence[int]
) -> Iterator[RegisterValue]:
    texts = dict(texts_in(run))
    until = 0
    for cut in cuts:
        if cut.at < until:
            continue
        row = chart.at(run.area, run.address + cut.at) if chart is not None else None
        begins = row is not None and row.address == run.address + cut.at
        if row is not None and begins and row.type == "text" and row.end <= run.address + run.length:
            until = row.end - run.address
            yield text_value(run, cut.at, until, row)
            continue
        if cut.at in texts and row is None:
            until = texts[cut.at]
            yield text_value(run, cut.at, until, None)
            continue
        if cut.moved or row is not None or HYPOTHESES[cut.number].words == 1:
            yield _value(run, cut, row, order, sisters)
        else:  # nothing moved: each register for itself
            for at in range(cut.at, cut.at + HYPOTHESES[cut.number].words):
                lone = Cut(run, at, 0, 1 - cut.confidence, False, (cut.at, cut.number, cut.confidence))
                yield _value(run, lone, None, order, sisters)


def _claimed(value: RegisterValue, run: Run, chart: RegisterMap | None, doubts: Mapping[Block, str]) -> RegisterValue:
    """A value whose type is no surer than its readings can make it; a map needs none."""
    if value.confidence <= UNSURE_AT_MOST or (chart is not None and chart.at(value.area, value.address) is not None):
        return value
    own = (block for block in run.blocks if block.address <= value.address < block.address + block.quantity)
    short = register_words("too few readings to tell") * (value.readings < SHORT)
    still = value.why * (value.kind in STILL)
    why = next(filter(None, (*(doubts.get(block.key) for block in own), short, still)), None)
    if why is None:
        return value
    return replace(value, confidence=UNSURE_AT_MOST, bits=0.0, why=why, same_number=())


def _value(run: Run, cut: Cut, row: MappedValue | None, order: str | None, sisters: Sequence[int]) -> RegisterValue:
    span = ReadSpan.of(run, cut.at, cut.number)
    hypothesis, block, address = span.hypothesis, span.block, run.address + cut.at
    mapped = row if row is not None and (row.address, row.length) == (address, hypothesis.words) else None
    device_order = cast(Order, mapped.order) if mapped is not None else hypothesis.order or "ABCD"
    series = span.patterns(device_order)
    told_sign = mapped.is_signed if mapped is not None else roles.is_signed(series, hypothesis.words)
    signed = hypothesis.is_float or told_sign
    kind = _kind(span, series[: span.beginning], device_order, mapped)
    written = any(b.written and b.address <= address < b.address + b.quantity for b in run.blocks)
    written = written or (mapped is not None and mapped.writable)
    floats = span.numbers(device_order, signed=signed)[: span.beginning]
    low, high = span.extremes(device_order, signed=signed)
    second = None if mapped is not None else _runner_up(run, cut)
    confidence = cut.confidence if mapped is None else 1.0
    return RegisterValue(
        unit=run.unit,
        area=run.area,
        address=address,
        words=hypothesis.words,
        kind=kind,
        signed=signed,
        order=device_order if hypothesis.words > 1 else None,
        role=roles.role_of(kind, floats, moved=span.moved, written=written),
        confidence=round(confidence, 4),
        bits=round(_odds(confidence, second.confidence if second else 1 - confidence), 2),
        why=_why(span, cut, mapped, order, sisters),
        readings=block.count,
        changes=span.changes,
        minimum=low,
        maximum=high,
        last=span.last(device_order, signed=signed),
        runner_up=second,
        same_number=_same_number(run, cut, signed=signed),
        **_mapped_facts(mapped),
    )


def _mapped_facts(row: MappedValue | None) -> dict[str, Any]:
    """What only a map says of a value."""
    return {} if row is None else {"name": row.name or None, "scale": row.scale, "unit_of_measure": row.unit}


def _why(span: ReadSpan, cut: Cut, row: MappedValue | None, order: str | None, sisters: Sequence[int]) -> str:
    """Why a value is what it is said to be, in words."""
    if row is not None:
        return register_words("as you said" if SAID in row.other else "as the map has it")
    if not span.moved:
        return _constant_words(cut, int(span.words[0, 0]))
    shared = None
    if order and span.hypothesis.order == order:
        shared = register_words("{order} is the order of the other values", order=order)
    return reasons(cut, [span.words[0].tolist(), span.words[-1].tolist()], shared=shared, sisters=sisters)


def _kind(span: ReadSpan, series: NDArray[np.uint64], order: Order, row: MappedValue | None) -> str:
    words = span.hypothesis.words
    if span.hypothesis.is_float:
        return "float"
    if row is not None:
        return _MAPPED_KINDS.get(row.type, "bcd" if row.type.startswith("bcd") else "int")
    if not span.moved:
        return "unknown" if int(series[0]) in _NOTHING else "constant"
    if words == 1 and roles.is_bits(series):
        return "bits"
    if words == 1 and roles.is_enum(series):
        return "enum"
    if span.is_clock(order):
        return "time"
    return "bcd" if words <= 2 and roles.is_bcd(series, words) else "int"


def _runner_up(run: Run, cut: Cut) -> OtherReading | None:
    if cut.second is None or cut.second[2] < LEAST_TOLD:
        return None
    return _reading(run, *cut.second)


def _reading(run: Run, at: int, number: int, share: float) -> OtherReading:
    hypothesis = HYPOTHESES[number]
    kind = "float" if hypothesis.is_float else "int"
    return OtherReading(run.address + at, hypothesis.words, kind, hypothesis.order, round(share, 4))


def _same_number(run: Run, cut: Cut, *, signed: bool) -> tuple[OtherReading, ...]:
    """The readings of another width that give the same numbers: none is negative at its own width."""
    return tuple(_reading(run, *other) for other in cut.alike if signed is _is_negative(run, *other[:2]) is False)


def _is_negative(run: Run, at: int, number: int) -> bool:
    span = ReadSpan.of(run, at, number)
    return roles.is_signed(span.patterns(span.hypothesis.order or "ABCD"), span.hypothesis.words)


def _odds(confidence: float, rival: float) -> float:
    return max(math.log2(max(confidence, 1e-6) / max(rival, 1e-4)), 0.0)


def _constant_words(cut: Cut, word: int) -> str:
    text = register_words("has been {word} ({word:04X}) all the time", word=word)
    if cut.second and cut.second[1]:
        span = ReadSpan.of(cut.run, *cut.second[:2])
        value = span.last(span.hypothesis.order or "ABCD", signed=False)
        if span.hypothesis.is_float and isinstance(value, float) and 1e-6 < abs(value) < 1e9:
            words = "with its neighbour a float {order} of {value:g}, perhaps"
            text += f"; {register_words(words, order=span.hypothesis.order, value=value)}"
    return text
