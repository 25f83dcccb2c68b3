"""Learns the tables of log odds by which registers are inferred, and writes them with their provenance.

    python benchmarks/fit_registers.py [--folds N] [--seeds N] [--rounds N] [-o FILE]

A conditional model of how blocks of registers are cut into values, fitted by gradient on devices made from the open
layouts. With `--folds` families of makers are held out in turn and scored; the temperature comes from those. The tables
that are written are fitted on all.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from register_habits import habit_device, habit_devices
from register_makers import physical_devices, physical_layouts
from register_scores import Tally, tallied
from register_series import MadeDevice, composed_devices, devices, family, layouts, true_cut
from register_strangers import strangers

from analyzer.registers.evidence import DEVICE_ORDERS, TABLES, Weights, neighbour_codes, order_codes
from analyzer.registers.hypotheses import FAMILY_OF, HYPOTHESES, ChainSums, chain_sums
from analyzer.registers.runs import Run, run_pass, runs_of, second_codes

Floats = NDArray[np.float64]
Learnt = NDArray[np.bool_]
OUT = Path(__file__).resolve().parents[1] / "analyzer" / "registers" / "weights.json"
STARTS = dict(zip(TABLES, np.cumsum([0, *TABLES.values()])[:-1].tolist(), strict=True))
TOTAL = sum(TABLES.values())
_GAINS = (-3, -2, -1, -0.5, 0, 0.3, 0.8, 1.2, 1.8, 2.4, 3, 3.5, 4, 4)
_CARRIES = (0, 2, 3.5, 5, 2, 0, 0, 0, -1, -2, -0.5, -2, -2)
_AGREED = (0, 1.2, 3, 5, -1)
_IN_FOURS = (0, -0.7, -1.5, 1, 0, -0.7, 2, 1, 0, 2.5, 1.5, 0.5)
HELD: dict[str, tuple[float, ...]] = {
    # lengths are log odds: 0.69 nats a bit, less where they are many
    "i32 gain": tuple(np.repeat(_GAINS, 2).tolist()), "i64 gain": _GAINS,
    # a carry at the right time is no chance, nor is one that is missing
    "i32 wraps": _CARRIES, "i64 wraps": _CARRIES,
    # of whole numbers that large one in a hundred looks like a usual float
    "i32 as float": (*(0,) * 16, -4, -4, *(0,) * 14),
    # a counter's low word grows while its high word stays: half a chance each time
    "i32 agreed": _AGREED, "i64 agreed": _AGREED,
    # values of 64 bits stand in rows; where they do not, other things do
    "i64 in line": tuple(np.repeat(_IN_FOURS, 2).tolist()),
    # a high word that stands still in each of two sisters and differs, their low words far apart, is no spare register
    "i32 sisters": (0, 0, 0, 0, 0, 0, 0, 0, 0, 0.8, 0, 0),
    # seconds since 1970: a word that stands still before one that does, that grows, that does not
    "i32 epoch": (0, 1, 3, 0),
    # below a high word of 0, FFFF or another: a word that is negative, one that crosses zero and would take it along
    "i32 negative": (0, 0, -1.5, 0, 2, -2, 0, 0, -1),
    # nothing that is measured goes evenly through all that 16 bits can hold; no half of a wider number keeps to 9999
    "i16 even": (0, 0, -0.5, -1.5, -3, 0), "i32 even": 4 * (0, 0, 0, 0, 0, -3), "f32 even": 2 * (0, 0, 0, 0, 0, -3),
    # nor has any quantity such sizes
    "f32 value": (0, 0, 0, 0, 0, 0, 0, 0, *3 * (0, 0, 0, 0, 0, 0, -1, -4)),
}  # fmt: skip
"""What is held before anything is learnt (log odds in nats), of what a fit to some layouts hardly ever sees."""
FIRM: dict[str, tuple[float, ...]] = {
    "i32 as float": (*(0,) * 16, -1, -1, *(0,) * 14), "i32 epoch": (0, 0, 2, 0),
    "i32 sisters": (0, 0, 0, 0, 0, 0, 0, 0, 0, 0.4, 0, 0),
}  # fmt: skip
"""What is added when all is learnt: clocks, lone floats and sisters are rarer where one learns than on a bus."""
_HABIT = np.array([0.4, -0.4])  # log odds: two layouts of three have the high word first
BUCKETS = (4, 10, 25, 60, 130)


@dataclass(slots=True, eq=False)
class Example:
    """A run with its true segments, and its codes as entries of one flat table (TOTAL: none)."""

    run: Run
    cut: NDArray[np.int64]
    entries: list[NDArray[np.int64]]  # by hypothesis, (T, K)
    device: int
    order: int  # of the device, a number of DEVICE_ORDERS


def example(run: Run, device: MadeDevice, number: int) -> Example | None:
    """None where the truth of a run is not one block's."""
    for area, address, quantity, rows in device.truth:
        if (area, address, quantity) == (run.area, run.address, run.length):
            cut = true_cut(address, quantity, rows)
            order = DEVICE_ORDERS.index(device.order)
            return Example(run, cut, entries_of(run.codes, run.length), number, order)
    return None


def entries_of(codes: Sequence[Mapping[str, NDArray[np.int64]]], longest: int) -> list[NDArray[np.int64]]:
    found = []
    for by_table in codes:
        columns = []
        for name, code in by_table.items():
            padded = np.full(longest, TOTAL, np.int64)
            padded[: len(code)] = np.where(code >= 0, code + STARTS[name], TOTAL)
            columns.append(padded)
        found.append(np.stack(columns, axis=1) if columns else np.full((longest, 1), TOTAL, np.int64))
    return found


def held_weights() -> Floats:
    """The weights from which learning starts, and to which they are drawn."""
    weights = np.zeros(TOTAL + 1)
    for name, values in HELD.items():
        weights[STARTS[name] : STARTS[name] + TABLES[name]] = values
    return weights


class Fit:
    """The gradient of one pass over all examples."""

    def __init__(self, examples: list[Example], strength: float) -> None:
        self.strength = strength
        self.buckets = []
        for low, high in zip((0, *BUCKETS), BUCKETS, strict=False):
            chosen = [e for e in examples if low < e.run.length <= high]
            if chosen:
                self.buckets.append(_Bucket(chosen))
        self.devices = 1 + max(e.device for e in examples)
        self.true = sum((bucket.true for bucket in self.buckets), np.zeros(TOTAL + 1))
        orders = {e.device: e.order for e in examples}
        for order in orders.values():
            self.true[STARTS["device order"] + order] += 1
        self.present = np.isin(np.arange(self.devices), list(orders))

    def expected(self, weights: Floats) -> Floats:
        """Expected counts under the weights, each device of either word order as likely as its runs make it."""
        totals = np.tile(weights[STARTS["device order"] : STARTS["device order"] + 2], (self.devices, 1))
        sums = []
        for bucket in self.buckets:
            scores = bucket.scores(weights)
            both = [bucket.sums(scores, weights, order) for order in range(2)]
            for order, one in enumerate(both):
                np.add.at(totals[:, order], bucket.devices, one.log_total)
            sums.append(both)
        shares = np.exp(totals - totals.max(axis=1, keepdims=True))
        shares /= shares.sum(axis=1, keepdims=True)
        found = np.zeros(TOTAL + 1)
        found[STARTS["device order"] : STARTS["device order"] + 2] = shares[self.present].sum(axis=0)
        for bucket, both in zip(self.buckets, sums, strict=True):
            found += bucket.expected(both, shares[bucket.devices])
        return found

    def run(self, rounds: int, start: Floats | None = None, learnt: Learnt | None = None) -> Floats:
        """Weights after so many rounds of Adam; where some tables alone are `learnt` the others stay as they are."""
        held = held_weights() if learnt is None or start is None else start
        weights = held.copy() if start is None else start.copy()
        mean, spread = np.zeros_like(weights), np.zeros_like(weights)
        for step in range(1, rounds + 1):
            expected = self.expected(weights)
            gradient = (self.true - expected) - self.strength * (weights - held)
            gradient[TOTAL] = 0
            if learnt is not None:
                gradient[~learnt] = 0
            mean = 0.9 * mean + 0.1 * gradient
            spread = 0.98 * spread + 0.02 * gradient**2
            rate = 0.12 * min(1.0, 4 * (1 - step / (rounds + 1)))
            weights += rate * (mean / (1 - 0.9**step)) / (np.sqrt(spread / (1 - 0.98**step)) + 1e-3)
        return weights


class _Bucket:
    def __init__(self, examples: list[Example]) -> None:
        self.lengths = np.array([e.run.length for e in examples])
        self.devices = np.array([e.device for e in examples])
        longest = int(self.lengths.max())
        self.entries = []
        for number in range(len(HYPOTHESES)):
            width = max(e.entries[number].shape[1] for e in examples)
            block = np.full((len(examples), longest, width), TOTAL, np.int64)
            for row, e in enumerate(examples):
                block[row, : e.run.length, : e.entries[number].shape[1]] = e.entries[number]
            self.entries.append(block)
        self.fits = np.zeros((len(examples), longest, len(HYPOTHESES)), np.bool_)
        for row, e in enumerate(examples):
            self.fits[row, : e.run.length] = e.run.fits
        self.true = np.zeros(TOTAL + 1)
        neighbours = neighbour_codes() + STARTS["neighbours"]
        for row, e in enumerate(examples):
            for at, number in e.cut.tolist():
                np.add.at(self.true, self.entries[number][row, at], 1)
            numbers = e.cut[:, 1]
            np.add.at(self.true, order_codes()[e.order][numbers] + STARTS["value order"], 1)
            np.add.at(self.true, neighbours[numbers[:-1], numbers[1:]], 1)
            self.true[STARTS["begin"] + FAMILY_OF[numbers[0]]] += 1
            self.true[STARTS["end"] + FAMILY_OF[numbers[-1]]] += 1

    def scores(self, weights: Floats) -> Floats:
        """Log odds of every segment, word orders left out."""
        return np.stack([weights[block].sum(axis=2) for block in self.entries], axis=-1)

    def sums(self, scores: Floats, weights: Floats, order: int) -> ChainSums:
        """Of devices that have this word order."""
        scores = scores + weights[order_codes()[order] + STARTS["value order"]]
        scores[~self.fits] = -1e9
        transitions = weights[neighbour_codes() + STARTS["neighbours"]]
        begin, end = weights[STARTS["begin"] + FAMILY_OF], weights[STARTS["end"] + FAMILY_OF]
        return chain_sums(scores, self.lengths, transitions, begin, end)

    def expected(self, both: Sequence[ChainSums], shares: Floats) -> Floats:
        """Expected counts, each run weighed by the share (runs, 2) of either order in its device."""
        by_order = [sums.posterior * shares[:, order, None, None] for order, sums in enumerate(both)]
        found = np.zeros(TOTAL + 1)
        for order, one in enumerate(by_order):
            np.add.at(found, order_codes()[order] + STARTS["value order"], one.sum(axis=(0, 1)))
        posterior = by_order[0] + by_order[1]
        for number, block in enumerate(self.entries):
            share = np.repeat(posterior[:, :, number].ravel(), block.shape[2])
            found += np.bincount(block.ravel(), share, TOTAL + 1)
        neighbours = sum(np.einsum("r,rij->ij", shares[:, order], sums.neighbours) for order, sums in enumerate(both))
        np.add.at(found, neighbour_codes() + STARTS["neighbours"], neighbours)
        np.add.at(found, STARTS["begin"] + FAMILY_OF, posterior[:, 0].sum(axis=0))
        last = np.zeros(len(HYPOTHESES))
        for number, hypothesis in enumerate(HYPOTHESES):
            at = self.lengths - hypothesis.words
            inside = at >= 0
            last[number] = posterior[np.flatnonzero(inside), at[inside], number].sum()
        np.add.at(found, STARTS["end"] + FAMILY_OF, last)
        return found


def tables_of(weights: Floats) -> dict[str, Floats]:
    return {name: weights[STARTS[name] : STARTS[name] + size] for name, size in TABLES.items()}


def fitted(
    made: list[tuple[MadeDevice, list[Run]]], rounds: int, strength: float, known: KnownTables | None = None
) -> Weights:
    """Both passes, fitted on these devices; beside what is `known`, if anything is."""
    starts, learnt = (known.passes, known.learnt) if known is not None else ([None, None], None)
    groups = [
        [e for run in runs if (e := example(run, device, number)) is not None]
        for number, (device, runs) in enumerate(made)
    ]
    first = Fit([e for group in groups for e in group], strength).run(rounds, starts[0], learnt)
    halfway = Weights((tables_of(first), tables_of(first)), 1.0, {})
    second = []
    for (_, runs), group in zip(made, groups, strict=True):
        own = run_pass(runs, halfway, 0, [halfway.scores(0, run.codes, run.length) for run in runs], 1.0)
        codes = dict(zip(map(id, runs), second_codes(runs, own), strict=True))
        for e in group:
            entries = entries_of(codes[id(e.run)], e.run.length)
            second.append(Example(e.run, e.cut, entries, e.device, e.order))
    last = Fit(second, strength).run(rounds, first if starts[1] is None else starts[1], learnt)
    return Weights((tables_of(first), tables_of(last)), 1.0, {})


def shy(weights: Weights, lone: float) -> Weights:
    """The same, so much against integers of 32 bits of which one word moved (cases 1 and 2 of four), with what is
    firmly held, and as sure of a word order beforehand as makers' habits allow: devices of either were taken alike."""
    first, last = ({**tables, "device order": _HABIT} for tables in weights.passes)
    last["i32"] = last["i32"] - lone * np.array([0, 1, 1, 0])
    for name, more in FIRM.items():
        first[name], last[name] = first[name] + more, last[name] + more
    return Weights((first, last), weights.temperature, weights.provenance)


@dataclass(frozen=True, slots=True, eq=False)
class KnownTables:
    """Weights of each pass as they were fitted before, and which of them are learnt anew."""

    passes: Sequence[Floats | None]
    learnt: Learnt

    @classmethod
    def of(cls, path: Path, lone: float, names: Sequence[str]) -> KnownTables:
        """Those of a file that was written here, less what `shy` added; tables that it lacks are as held."""
        passes = []
        for number, tables in enumerate(json.loads(path.read_text())["passes"]):
            weights = held_weights()
            for name, values in tables.items():
                weights[STARTS[name] : STARTS[name] + TABLES[name]] = np.array(values) - FIRM.get(name, 0.0)
            weights[STARTS["device order"] : STARTS["device order"] + 2] = 0.0
            weights[STARTS["i32"] : STARTS["i32"] + 4] += number * lone * np.array([0, 1, 1, 0])
            passes.append(weights)
        learnt = np.zeros(TOTAL + 1, np.bool_)
        for name in names:
            learnt[STARTS[name] : STARTS[name] + TABLES[name]] = True
        return cls(passes, learnt)


def training(seeds: int, thin: int = 1) -> list[tuple[MadeDevice, list[Run]]]:
    """Devices of all layouts, as they are, in finer steps and stirred up, and those of a third hand, with runs."""
    kinds: tuple[tuple[int, range, dict[str, Any]], ...] = (  # polls, seeds, chances
        (60, range(seeds), {"refine": 0.0}),
        (60, range(400, 400 + seeds), {"another": 1.0}),
        (60, range(200, 202), {"refine": 1.0}),
        (60, range(300, 302), {"stir": 1.0}),
        (60, range(500, 502), {"another": 0.5, "sisters": 2}),
        (150, range(100, 101), {"refine": 0.0}),
    )
    made = [
        device for polls, numbers, chances in kinds for device in devices(numbers, polls, thin, widen=0.15, **chances)
    ]
    made += list(physical_devices(range(500, 506), flip=0.4, thin=thin))
    return [(device, runs_of(device.readings)) for device in made]


def folds(count: int) -> list[set[str]]:
    """Families held out, by fold."""
    names = sorted({family(chart) for chart in layouts().values()})
    return [set(names[number::count]) for number in range(count)]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folds", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--strength", type=float, default=3.0)
    parser.add_argument("--temperature", type=float, default=0.95)
    parser.add_argument("--lone", type=float, default=0.1, help="nats against 32 bits where one word moved")
    parser.add_argument("--composed", type=int, default=800, help="devices made of parts of several others")
    parser.add_argument("--habits", type=int, default=2500, help="devices of makers that are drawn")
    parser.add_argument("--strangers", type=int, default=600, help="devices of which no two registers are one value")
    parser.add_argument("--few", type=int, default=400, help="devices of makers that are drawn, polled a few times")
    parser.add_argument("--misses", action="store_true", help="print each miss of a held-out family")
    parser.add_argument("--only-fold", type=int)
    parser.add_argument("--beside", type=Path, metavar="FILE", help="tables that stay as they are, but for --learn")
    parser.add_argument("--learn", nargs="+", choices=TABLES, default=[], metavar="TABLE")
    parser.add_argument("--thin", type=int, default=1, help="each so many-th layout only")
    parser.add_argument("-o", default=str(OUT))
    parser.add_argument("--dry", action="store_true", help="write nothing")
    options = parser.parse_args(arguments)
    begin = time.perf_counter()
    made = training(options.seeds, options.thin)
    made += [(device, runs_of(device.readings)) for device in habit_devices(range(options.habits))]
    made += [(device, runs_of(device.readings)) for device in strangers(range(options.strangers))]
    for number in range(options.habits, options.habits + options.few):
        device = habit_device(number, 4 + number % 13)
        made.append((device, runs_of(device.readings)))
    print(f"{len(made)} devices, {time.perf_counter() - begin:.1f} s", file=sys.stderr)
    if options.folds:
        everything = Tally()
        fresh = list(devices(range(1000, 1003), 60, flip=0.0))
        for number, out in enumerate(folds(options.folds)):
            if options.only_fold not in (None, number):
                continue
            chosen = [pair for pair in made if pair[0].family not in out]
            chosen += [(d, runs_of(d.readings)) for d in composed_devices(options.composed, out)]
            weights = fitted(chosen, options.rounds, options.strength)
            weights = replace(shy(weights, options.lone), temperature=options.temperature)
            tally = Tally()
            for device in fresh:
                if device.family in out:
                    tallied(device, weights, tally)
                    tallied(device, weights, everything)
            if options.misses:
                print(*tally.misses, sep="\n")
            print(f"held out {', '.join(sorted(out))[:100]}\n  {tally}", flush=True)
        print(f"all held out\n  {everything}\n{everything.calibration()}")
    if not options.dry:
        made += [(d, runs_of(d.readings)) for d in composed_devices(options.composed)]
        known = KnownTables.of(options.beside, options.lone, options.learn) if options.beside else None
        weights = shy(fitted(made, options.rounds, options.strength, known), options.lone)
        names = ("seeds", "rounds", "strength", "lone", "composed", "habits", "strangers", "few", "thin")
        provenance = {
            "made_by": "benchmarks/fit_registers.py",
            "layouts": sorted({*layouts(), *(f"physics {name}" for name in physical_layouts())}),
            "devices": len(made),
            **{name: getattr(options, name) for name in names},
        }
        if options.beside:
            provenance |= {"learnt": options.learn, "beside": json.loads(options.beside.read_text())["provenance"]}
        content = {
            "provenance": provenance,
            "temperature": options.temperature,
            "passes": [{n: np.round(t, 3).tolist() for n, t in tables.items()} for tables in weights.passes],
        }
        Path(options.o).write_text(json.dumps(content, separators=(",", ":")).replace('],"', '],\n"') + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
