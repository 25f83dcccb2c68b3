"""What is claimed of buses of several hands, with what is so: by it is fitted how sure causes are (`fit_certainty`)."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

from heard_cases import HeardCase, heard
from nameless import is_fitted, nameless_cases
from nameless_drawn import DRAWN
from otherhand.kinds import OtherKind, every
from rtubench.adapters.rtuscope_cli import CAUSES
from rtubench.made import faults
from score_causes import NEAREST, is_right

import captures
from analyzer.causes.certainty import Clues, certainty
from analyzer.causes.evidence import Evidence
from analyzer.causes.ledger import Ledger, ledger_of
from analyzer.causes.reasoning import CauseClaim, claims_of
from analyzer.causes.registry import Cause, suspects
from analyzer.causes.traits import Traits
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

_TURNS = 5
_SHORT = 160  # rows
_LOOKED_AT = 3
_QUICK = 4  # seeds of lines that are made byte by byte, for each of those made bit by bit
_BENCH = 250, 3  # requests of a line, and lines of each fault
_STRUCK = 4
FOLDS = 3
TABLE = Path(__file__).parent / "data" / "claims.jsonl"


class Sort(Enum):
    """What is known of the fault that a claim is about."""

    KNOWN = "known"
    HIDDEN = "hidden"
    NAMELESS = "nameless"


class Claim(NamedTuple):
    """One claim of one capture."""

    cause: str
    clues: Clues
    traits: Traits
    right: bool
    case: str
    seed: int
    sort: Sort
    weight: float = 1.0  # among those of its sort
    hand: str = "field"

    @classmethod
    def of(cls, claim: CauseClaim, made: HeardCase, *, right: bool, sort: Sort = Sort.KNOWN) -> Claim:
        """With what is known of it."""
        return cls(claim.cause.cause, claim.clues, claim.traits, right, made.name, made.seed, sort)

    @property
    def said(self) -> float:
        """How sure it is told."""
        return certainty(self.cause, self.clues, self.traits)

    @classmethod
    def kept(cls, line: str) -> Claim:
        """From a line of the table."""
        told = json.loads(line)
        return cls(**told | {"clues": Clues(*told["clues"]), "sort": Sort(told["sort"]), "hand": "drawn"})

    @property
    def line(self) -> str:
        """For the table."""
        traits = {trait: {name: round(n, 1) for name, n in each.items() if n} for trait, each in self.traits.items()}
        told = self._asdict() | {"clues": [round(n, 3) for n in self.clues], "sort": self.sort.value, "traits": traits}
        del told["hand"]
        return json.dumps(told | {"weight": round(self.weight, 3)}, separators=(",", ":"))

    @property
    def where(self) -> tuple[str, int]:
        """The capture."""
        return self.case, self.seed

    @property
    def fold(self) -> int:
        """Which part of the captures it is of."""
        return crc32(f"{self.case} {self.seed}".encode()) % FOLDS


def claims(cases: list[str], seeds: range, taps: list[str], *, told: bool) -> Iterator[Claim]:
    """All claims on these seeds: with the whole vocabulary, and with the fifth hidden that has the case's cause; and on
    faults without a word, of the kinds that are `told` or of the others."""
    names = [suspect.cause for suspect in suspects()]
    for case in (field_cases()[name] for name in cases):
        for tap in (tap for tap in taps if tap in case.taps):
            for seed in seeds:
                made = heard(case, tap, seed)
                ledgers = [made.ledger()]
                if tap == taps[0] and len(made.parts):
                    ledgers.append(made.ledger(_SHORT))  # broken off, as many captures are
                for ledger in ledgers:
                    yield from claims_of_case(made, ledger, names)
                    if not told:
                        yield from _struck(made, ledger)
    more = range(seeds.start, seeds.start + _QUICK * len(seeds))
    yield from _of_others(more, told=told)
    yield from _of_bench(more)
    for name, case in nameless_cases().items():
        for tap in (tap for tap in (taps[:1] if name in DRAWN else taps) if tap in case.taps):
            for seed in seeds if is_fitted(name) != told else ():
                made = heard(case, tap, seed)
                for claim in claims_of(Evidence(made.ledger()))[:_LOOKED_AT]:
                    if claim.cause.severity != "note":
                        true = claim.cause.cause in made.expected.also
                        yield Claim.of(claim, made, right=true, sort=Sort.NAMELESS)


def _of_others(seeds: range, *, told: bool) -> Iterator[Claim]:
    """Of buses of another hand; with the causes that name the fault, and without these."""
    for made in every(seeds):
        kind, ledger = made.kind, _ledger(made.line, made.chunks)
        known = bool(kind.causes) or kind.healthy
        if not known and is_fitted(made.name) == told:
            continue

        def is_so(cause: Cause, kind: OtherKind = kind, at_fault: tuple[int, ...] = made.at_fault) -> bool:
            theirs = not at_fault or set(cause.units) <= set(at_fault)
            return cause.cause in kind.also or (cause.cause in kind.causes and theirs)

        where = made.name, made.seed
        yield from _told(ledger, (), is_so, where, Sort.KNOWN if known else Sort.NAMELESS, "otherhand")
        if kind.causes:
            near = [*kind.also, *(each for cause in kind.causes for each in NEAREST.get(cause, ()))]
            yield from _told(ledger, kind.causes, partial(_is_among, near), where, Sort.HIDDEN, "otherhand")


def of_folder(folder: Path) -> Iterator[Claim]:
    """Of captures with a `truth.json` beside them; with the causes of each, and without these."""
    for name, truth in json.loads((folder / "truth.json").read_text("utf-8")).items():
        capture = captures.open(folder / f"{name}.jsonl")
        ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
        near, faults, where = truth["let_pass"], truth["causes"], (name, 0)
        words = {each for fault in faults for each in fault["ids"]}

        def is_so(cause: Cause, near: list[str] = near, faults: list[dict[str, Any]] = faults) -> bool:
            mine = [fault for fault in faults if cause.cause in fault["ids"]]
            theirs = (not each["units"] or not cause.units or set(cause.units) & set(each["units"]) for each in mine)
            return cause.cause in near or any(theirs)

        yield from _told(ledger, (), is_so, where, Sort.KNOWN if words or truth["healthy"] else Sort.NAMELESS)
        if words:
            near = [*near, *(each for cause in words for each in NEAREST.get(cause, ()))]
            yield from _struck_in(ledger, words, partial(_is_among, near), where)


def _is_among(names: Collection[str], cause: Cause) -> bool:
    return cause.cause in names


def _of_bench(seeds: range) -> Iterator[Claim]:
    """Of the lines of RTUBench, likewise."""
    for item in (item for seed in seeds for item in faults.items(seed, *_BENCH)):
        line = LineSettings(item.baud, item.char_bits, tap=item.tap)
        ledger = _ledger(line, [Chunk(t_ns or 0, data) for t_ns, data in item.inputs["reads"]])
        words, units = item.truth["causes"], set(item.truth["units"])
        mine = [cause for cause, word in CAUSES.items() if word in words]
        where = f"rtubench {item.name.rpartition('-')[0]}", crc32(item.name.encode())

        def is_so(cause: Cause, mine: list[str] = mine, units: set[int] = units) -> bool:
            return cause.cause in mine and set(cause.units) <= (units or set(cause.units))

        yield from _told(ledger, (), is_so, where, Sort.KNOWN, "rtubench")
        if mine:
            yield from _told(ledger, mine, partial(_is_among, ()), where, Sort.HIDDEN, "rtubench")


def _ledger(line: LineSettings, chunks: list[Chunk]) -> Ledger:
    capture = Capture.of(line, chunks)
    return ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)


def _told(
    ledger: Ledger,
    hidden: Collection[str],
    is_so: Callable[[Cause], bool],
    where: tuple[str, int],
    sort: Sort,
    hand: str = "drawn",
) -> Iterator[Claim]:
    among = [suspect for suspect in suspects() if suspect.cause not in hidden]
    for each in claims_of(Evidence(ledger), among)[:_LOOKED_AT]:
        if each.cause.severity != "note":
            yield Claim(each.cause.cause, each.clues, each.traits, is_so(each.cause), *where, sort, hand=hand)


def claims_of_case(made: HeardCase, ledger: Ledger, names: list[str]) -> Iterator[Claim]:
    expected = made.expected
    faults = [expected, *([expected.beside] if expected.beside else [])]
    for claim in claims_of(Evidence(ledger))[:_LOOKED_AT]:
        if claim.cause.severity != "note" or expected.cause is not None:
            true = any(is_right(claim.cause, fault) for fault in faults) or claim.cause.cause in expected.also
            yield Claim.of(claim, made, right=true)
    if not expected.cause or expected.beside:
        return
    turn = names.index(expected.cause) % _TURNS
    among = [suspect for i, suspect in enumerate(suspects()) if i % _TURNS != turn]
    for claim in claims_of(Evidence(ledger), among)[:_LOOKED_AT]:
        near = claim.cause.cause in (*expected.also, *NEAREST.get(expected.cause, ()))
        yield Claim.of(claim, made, right=near, sort=Sort.HIDDEN)


def _struck(made: HeardCase, ledger: Ledger) -> Iterator[Claim]:
    """What is claimed with the cause of a case hidden, and then with the first of these claims hidden as well."""
    cause = made.expected.cause
    if cause and not made.expected.beside:
        near = (*made.expected.also, *NEAREST.get(cause, ()))
        struck = _struck_in(ledger, (cause,), partial(_is_among, near), (made.name, made.seed))
        yield from (each._replace(hand="field") for each in struck)


def _struck_in(
    ledger: Ledger, causes: Collection[str], is_so: Callable[[Cause], bool], where: tuple[str, int]
) -> Iterator[Claim]:
    found, hidden = list[Claim](), set(causes)
    for _ in range(_STRUCK):
        told = list(_told(ledger, hidden, is_so, where, Sort.HIDDEN))
        found += told
        if not told:
            break
        hidden.add(told[0].cause)
    yield from (each._replace(weight=min(1.0, _LOOKED_AT / len(found))) for each in found)
