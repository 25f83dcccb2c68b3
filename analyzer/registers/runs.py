"""Runs of neighbouring registers of one unit, and how each is cut into values.

The polled blocks are laid over each other, with the evidence of each. Where several blocks cover the same registers,
the one with most readings speaks. A value lies within one request, so registers that no block covers together are never
one value.

From shares to answers: the segments that stand, how sure each is, and what else it may be. Answers do not overlap. The
cut is the one in which most of what moved is read right in expectation, which is not always the likeliest cut as a
whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.maps.model import MapArea

from .company import Mask, pair_codes, pooled, sister_runs
from .counting import NONE, Codes
from .evidence import (
    DEVICE_ORDERS,
    BlockEvidence,
    Weights,
    block_evidence,
    device_codes,
    device_counts,
    padded,
    way_codes,
    way_counts,
    zero_codes,
    zero_counts,
)
from .hypotheses import HYPOTHESES, IMPOSSIBLE, WORDS, best_cut, chain_sums, moved_registers
from .readings import BlockReadings, Words

Floats = NDArray[np.float64]
_TOGETHER: Final = 0.5  # what counts of a device's values for its word order: pairs in a row say one thing, not many


@dataclass(slots=True, eq=False)
class Run:
    """T neighbouring registers of one unit and area, from `address` on.

    `codes[h]` are the tables' entries of hypothesis h, `fits` (T, H) where it can stand, `moved` (T) which registers
    moved, `words` (T) what they held at first, `source` (T, H) the number of the block that
    speaks of a segment, `series` the readings of each block; `sisters` are the runs of other units that speak for these
    registers too, by number, and where they do.
    """

    unit: int
    area: MapArea
    address: int
    blocks: list[BlockReadings]
    series: list[tuple[Words, int]]
    codes: list[Codes]
    fits: NDArray[np.bool_]
    moved: NDArray[np.bool_]
    words: Ints
    source: Ints
    sisters: list[tuple[int, Mask]] = field(default_factory=list)

    @property
    def length(self) -> int:
        return len(self.moved)

    def source_of(self, at: int, words: int, number: int) -> tuple[BlockReadings, Ints]:
        """The block that speaks of a segment under a hypothesis, and its columns there."""
        which = int(self.source[at, number])
        block = self.blocks[which if which >= 0 else int(self.source[at, 0])]
        begin = self.address + at - block.address
        return block, np.arange(begin, begin + words)


def runs_of(blocks: Iterable[BlockReadings]) -> list[Run]:
    """The runs of registers (not of coils and inputs) in these blocks, by unit, area and address."""
    words = [block for block in blocks if block.area in ("input", "holding")]
    series = {id(block): block.series for block in words}
    evidence = dict(zip(series, block_evidence(list(series.values())), strict=True))
    groups: dict[tuple[int, MapArea], list[BlockReadings]] = {}
    for block in words:
        groups.setdefault((block.unit, block.area), []).append(block)
    runs = []
    for members in groups.values():
        members.sort(key=lambda block: block.address)
        together: list[BlockReadings] = []
        end = -1
        for block in members:
            if together and block.address > end:
                runs.append(_run(together, series, evidence))
                together = []
            together.append(block)
            end = max(end, block.address + block.quantity) if len(together) > 1 else block.address + block.quantity
        runs.append(_run(together, series, evidence))
    for run, sisters in zip(runs, sister_runs(runs), strict=True):
        run.sisters = sisters
        kin = [runs[number] for number, _ in sisters]
        for number, hypothesis in enumerate(HYPOTHESES if kin and run.length > 1 else ()):
            if hypothesis.family == "i32":
                codes = padded(pair_codes(run, kin, reverse=hypothesis.order == "CDAB"), run.length)
                run.codes[number] = {**run.codes[number], "i32 sisters": np.where(run.fits[:, number], codes, NONE)}
    return runs


def _run(
    blocks: list[BlockReadings], series: Mapping[int, tuple[Words, int]], evidence: Mapping[int, BlockEvidence]
) -> Run:
    address = min(block.address for block in blocks)
    length = max(block.address + block.quantity for block in blocks) - address
    fits = np.zeros((length, len(HYPOTHESES)), np.bool_)
    source = np.full((length, len(HYPOTHESES)), -1, np.int64)
    moved, words = np.zeros(length, np.bool_), np.zeros(length, np.int64)
    codes: list[dict[str, Ints]] = [{} for _ in HYPOTHESES]
    ranked = sorted(range(len(blocks)), key=lambda number: (blocks[number].count, not blocks[number].written))
    for number in ranked:
        block = blocks[number]
        mine = evidence[id(block)]
        at = block.address - address
        moved[at : at + block.quantity] = mine.moved
        words[at : at + block.quantity] = series[id(block)][0][0]
        for hypothesis, by_table in enumerate(mine.codes):
            for name, values in by_table.items():
                column = codes[hypothesis].setdefault(name, np.full(length, NONE, np.int64))
                column[at : at + len(values)] = values
                fits[at : at + len(values), hypothesis] = ~mine.absurd[hypothesis]
                source[at : at + len(values), hypothesis] = number
    own = [series[id(block)] for block in blocks]
    return Run(blocks[0].unit, blocks[0].area, address, blocks, own, list(codes), fits, moved, words, source)


def run_posteriors(runs: Sequence[Run], weights: Weights) -> list[Floats]:
    """The share of each segment (T, H) of each run, in the light of its whole unit and of its sisters."""
    if not runs:
        return []
    kin = [run.sisters for run in runs]
    scores = [weights.scores(0, run.codes, run.length) for run in runs]
    first = run_pass(runs, weights, 0, pooled(scores, kin), 1.0)
    scores = [weights.scores(1, codes, run.length) for run, codes in zip(runs, second_codes(runs, first), strict=True)]
    return run_pass(runs, weights, 1, pooled(scores, kin), weights.temperature)


def second_codes(runs: Sequence[Run], first: Sequence[Floats]) -> list[list[Codes]]:
    """The codes of the second pass: those of the first, and what the unit's other values are by the first pass."""
    moved = [moved_registers(run.moved) > 0 for run in runs]
    counts_up = [run.codes[0]["i16 share"] % 3 == 1 for run in runs]
    counts: dict[int, Floats] = {}
    zeros: dict[int, Ints] = {}
    by_way: dict[int, Ints] = {}
    for run, own, moves, ups in zip(runs, first, moved, counts_up, strict=True):
        counts[run.unit] = counts.get(run.unit, 0) + device_counts(own, moves)
        zeros[run.unit] = zeros.get(run.unit, 0) + zero_counts(run.words, run.moved)
        by_way[run.unit] = by_way.get(run.unit, 0) + way_counts(run.words, run.moved, ups)
    extended: list[list[Codes]] = []
    for run, own, moves, ups in zip(runs, first, moved, counts_up, strict=True):
        pairs = [zero_codes(zeros[run.unit], run.words, run.moved, order) for order in DEVICE_ORDERS]
        ways = [way_codes(by_way[run.unit], run.words, run.moved, ups, order) for order in DEVICE_ORDERS]
        more = device_codes(counts[run.unit], own, moves, run.fits, pairs, ways)
        extended.append([{**one, **second} for one, second in zip(run.codes, more, strict=True)])
    return extended


def run_pass(
    runs: Sequence[Run], weights: Weights, which: int, scores: list[Floats], temperature: float
) -> list[Floats]:
    """Shares of one pass: of a device with either word order, weighed by how well all its runs together bear it."""
    units = {unit: number for number, unit in enumerate(dict.fromkeys(run.unit for run in runs))}
    devices = np.array([units[run.unit] for run in runs])
    priors, by_order = weights.orders(which)
    totals = np.zeros((len(units), 2))
    posteriors = np.empty((len(runs), 2), object)
    transitions, begin, end = weights.chain(which)
    for part in _alike(runs):
        lengths = np.array([runs[number].length for number in part])
        padded = np.full((len(part), int(lengths.max()), len(HYPOTHESES)), IMPOSSIBLE)
        for row, number in enumerate(part):
            padded[row, : lengths[row]] = np.where(runs[number].fits, scores[number], IMPOSSIBLE)
        for order, bonus in enumerate(by_order):
            odds = (transitions / temperature, begin / temperature, end / temperature)
            sums = chain_sums((padded + bonus) / temperature, lengths, *odds)
            np.add.at(totals[:, order], devices[part], sums.log_total)
            for row, number in enumerate(part):
                posteriors[number, order] = sums.posterior[row, : lengths[row]]
    totals = _TOGETHER * totals + priors
    shares = np.exp(totals - totals.max(axis=1, keepdims=True))
    shares /= shares.sum(axis=1, keepdims=True)
    return [
        shares[device, 0] * both[0] + shares[device, 1] * both[1]
        for device, both in zip(devices, posteriors, strict=True)
    ]


def _alike(runs: Sequence[Run]) -> list[list[int]]:
    """The runs in groups of about one length."""
    groups: dict[int, list[int]] = {}
    for number, run in enumerate(runs):
        groups.setdefault(run.length.bit_length(), []).append(number)
    return list(groups.values())


LEAST_TOLD: Final = 0.005  # the least share of another reading that is spoken of,
_LEAST_ALIKE: Final = 0.0001  # and of one that gives the same numbers: no reading can tell its width
_WHOLE: Final = frozenset(number for number, hypothesis in enumerate(HYPOTHESES) if not hypothesis.is_float)
_QUIET = 0.02  # what a register that never moved counts beside one that did
_LONE = 0.85  # and a moving one beside a quiet one as one value: in doubt it stands alone, which gives the same number


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A value at register `at` of a run under hypothesis `number`; `second` is (register, hypothesis, share) of the
    likeliest segment that this one excludes, `alike` those in which it is the same whole number, likeliest first."""

    run: Run
    at: int
    number: int
    confidence: float
    moved: bool
    second: tuple[int, int, float] | None
    alike: tuple[tuple[int, int, float], ...] = ()


def cut_of(run: Run, posterior: NDArray[np.float64]) -> list[Cut]:
    """The values of a run, by address."""
    registers = moved_registers(run.moved)
    moves = registers > 0
    lone = (registers == 1) & (WORDS == 2)
    counted = np.sqrt(registers) * np.where(lone, _LONE, 1.0) + _QUIET  # half way from values to registers
    gains = np.where(run.fits, posterior * counted, -np.inf)
    cuts = []
    for at, number in best_cut(gains):
        cuts.append(
            Cut(
                run,
                at,
                number,
                float(np.clip(posterior[at, number], 0.0, 1.0)),
                bool(moves[at, number]),
                _second(posterior, moves, at, number),
                _alike_numbers(run, posterior, at, number) if moves[at, number] and number in _WHOLE else (),
            )
        )
    return cuts


def _second(
    posterior: NDArray[np.float64], moves: NDArray[np.bool_], at: int, number: int
) -> tuple[int, int, float] | None:
    """The likeliest other segment that has a register in common with this one; one that moved, if this one did."""
    end = at + HYPOTHESES[number].words
    best: tuple[int, int, float] | None = None
    for rival, hypothesis in enumerate(HYPOTHESES):
        for begin in range(max(0, at - hypothesis.words + 1), min(end, len(posterior))):
            share = float(posterior[begin, rival])
            if (begin, rival) == (at, number) or share <= 0 or (moves[at, number] and not moves[begin, rival]):
                continue
            if best is None or share > best[2]:
                best = (begin, rival, share)
    return best


def _alike_numbers(
    run: Run, posterior: NDArray[np.float64], at: int, number: int
) -> tuple[tuple[int, int, float], ...]:
    """The other segments that give the same whole number: of another width, their further high words always zero."""
    core = _core(run, at, number)
    alike = [
        (begin, rival, float(posterior[begin, rival]))
        for rival in _WHOLE - {number}
        for begin in range(max(0, min(core) - int(WORDS[rival]) + 1), min(core) + 1)
        if posterior[begin, rival] >= _LEAST_ALIKE and _core(run, begin, rival) == core
    ]
    return tuple(sorted(alike, key=lambda each: -each[2]))


def _core(run: Run, at: int, number: int) -> list[int]:
    """The registers that make the number of a segment of integers, high word first, without those that are always zero
    before them."""
    registers = np.arange(at, at + WORDS[number])[:: -1 if HYPOTHESES[number].order == "CDAB" else 1]
    speaking = run.moved[registers] | (run.words[registers] != 0)
    return [int(register) for register in registers[int(speaking.argmax()) :]]
