"""Causes and their suspects: each is declared once, by the words for people and the judge of its evidence.

    @suspect(
        "dead-unit", Severity.ERROR, blame="unit",
        text="unit {unit} never answers: {silent} of {asked} requests got no byte back",
        ...
    )
    def dead_unit(evidence: Evidence) -> Iterator[Suspicion]:
        ...

A module of `analyzer.causes.suspects` holds declarations; nothing lists the modules. A judge looks at all the evidence
that no other cause has explained yet and gives a `Suspicion` for each way in which its cause may be so, with its weight
in bits. Words are templates over the numbers of a suspicion, by name, so that a catalogue can translate them; filled,
they are a `Cause`. What a finding's code is a symptom of ties findings to the cause that explains them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Literal

from ..html_text import html_page, html_table
from ..languages import sentence
from ..registry import Registry
from ..tables.findings import Severity
from .sureness import how_sure

if TYPE_CHECKING:
    from .evidence import Evidence

Blame = Literal["unit", "master", "line", "tap", "nobody"]


class Symptom(Enum):
    """What may be wrong with the exchanges of a unit, or (unit None) with the bus; each is explained once."""

    SILENCE = "silence"  # requests without an answer
    DAMAGE = "damage"  # answers that are none
    LATENESS = "lateness"  # answers when nobody waits for them
    SHIFT = "shift"  # answers that the client takes for those to other requests
    DOUBLES = "doubles"  # second answers
    BEHIND = "behind"  # bytes behind good answers
    MARKS = "marks"  # good answers with marks of the UART
    REFUSAL = "refusal"  # exceptions
    TIMING = "timing"  # silences that are too short or too long
    VALUES = "values"
    REQUESTS = "requests"  # what the master asks, and how
    FRAMING = "framing"  # bytes in no frame


Explained = frozenset[tuple[Symptom, int | None]]


@dataclass(frozen=True, slots=True)
class Suspicion:
    """One way in which a cause may be so: whom it concerns, its weight, what it explains, and its numbers for people.

    `lost_answers` and `lost_ms` as in `Cause`; times are on the ledger's axis and become None without times.
    """

    units: tuple[int, ...]
    bits: float
    explains: Explained
    numbers: Mapping[str, Any] = field(default_factory=dict)
    since: int | None = None
    until: int | None = None
    period_s: float | None = None
    lost_answers: int | None = None
    lost_ms: float | None = None
    frames: tuple[int, ...] = ()
    severity: Severity | None = None  # another one than the cause usually has: what may well be meant is a note
    against: float = 0.0  # bits of what such a cause would not do: it is less sure then, however much else there is


Judge = Callable[["Evidence"], Iterable[Suspicion]]


@dataclass(frozen=True, slots=True)
class Foretold:
    """What a cause makes likely: of a symptom, the sorts of things that it may hang on (`analyzer.causes.contrasts`; a
    symptom that is not named may hang on anything), and whether the client loses what is damaged. `kind_of`: the cause
    that it is a special case of, and then it is no less sure than that one."""

    hangs_on: Mapping[Symptom, frozenset[str]] = field(default_factory=dict)
    client_loses: bool = False
    kind_of: str = ""


COMES_AND_GOES: Final = frozenset(("spells", "since", "unit-before", "outcome-before"))  # contrasts of time
LENGTHS: Final = frozenset(("answer-bytes", "quantity"))  # by which more is hit, whatever hits
ASKED_FOR: Final = frozenset(("function", "quantity", "answer-bytes", "address", "range-end", "poll"))  # of requests


OF_A_LINE: Final = Foretold(  # whose frames are spoilt, whoever was asked before
    {Symptom.DAMAGE: (COMES_AND_GOES - {"unit-before"}) | LENGTHS}, client_loses=True
)


@dataclass(frozen=True, eq=False)
class Suspect:
    """The declaration of a cause."""

    cause: str
    severity: Severity
    blame: Blame
    text: str
    share: str
    deciding_test: str
    remedy: str
    judge: Judge
    foretold: Foretold = Foretold()


_SUSPECTS: Final = Registry[Suspect]("analyzer.causes.suspects", "suspect")


def suspect(
    cause: str,
    severity: Severity,
    *,
    blame: Blame,
    text: str,
    remedy: str,
    share: str = "",
    deciding_test: str = "",
    foretold: Foretold = Foretold(),
) -> Callable[[Judge], Judge]:
    """Registers the judge of a cause."""

    def enter(judge: Judge) -> Judge:
        _SUSPECTS.enter(cause, Suspect(cause, severity, blame, text, share, deciding_test, remedy, judge, foretold))
        return judge

    return enter


@cache
def suspects() -> tuple[Suspect, ...]:
    """All suspects, in the order of their causes."""
    return tuple(_SUSPECTS.by_name().values())


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause that explains many findings.

    `units` the most concerned first; `blame`: unit, master, line or tap; `share` says of how many; `since_ns` and
    `until_ns` None without times, `period_s` None where it does not recur; `confidence` 0 to 1; `runner_up` the id of
    the next best explanation, or None; `lost_answers` and `lost_ms`, from each such request to the next one as findings
    count it, are None where nobody knows; `frames`: indices of a few requests or frames that show it; `bits`: how much
    likelier the capture is with it than without; `explains`: codes of findings with the unit each stands on (None: the
    bus), which follow from it.
    """

    cause: str
    severity: str
    units: tuple[int, ...]
    blame: str
    text: str
    share: str
    since_ns: int | None
    until_ns: int | None
    period_s: float | None
    confidence: float
    runner_up: str | None
    deciding_test: str
    remedy: str
    lost_answers: int | None
    lost_ms: float | None
    frames: tuple[int, ...]
    bits: float
    explains: frozenset[tuple[Symptom, int | None]] = frozenset()  # which findings point here
    numbers: Mapping[str, Any] = field(default_factory=dict, compare=False)  # that its words are filled with

    @property
    def sure(self) -> str:
        """How sure that is, in the language in use: a figure where it means something."""
        return how_sure(self.confidence)

    def _repr_html_(self) -> str:
        """For notebooks."""
        lines = [
            ("share", self.share),
            ("likely", self.sure + (f", else {self.runner_up}" if self.runner_up else "")),
            ("lost answers", self.lost_answers),
            ("to confirm", self.deciding_test),
            ("remedy", self.remedy),
            ("frames", ", ".join(map(str, self.frames))),
        ]
        told = [line for line in lines if line[1] not in (None, "")]
        return html_page(f"{self.severity}: {self.cause}: {self.text}", html_table((), told))

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        plain = {**asdict(self), "units": list(self.units), "frames": list(self.frames)}
        del plain["explains"], plain["numbers"]
        told = {name: self.numbers[name] for name in _OF_REQUESTS if name in self.numbers}
        return plain | {name: list(number) if isinstance(number, tuple) else number for name, number in told.items()}


@dataclass(frozen=True, slots=True)
class CauseWords:
    """The four things that people are told of a cause."""

    text: str
    share: str
    deciding_test: str
    remedy: str


_OF_REQUESTS: Final = ("reason", "ask_instead")  # numbers that a program may want of causes of requests


def words_of(suspect: Suspect, numbers: Mapping[str, Any]) -> CauseWords:
    """What a suspect says with these numbers."""
    parts = {"text": suspect.text, "share": suspect.share, "test": suspect.deciding_test, "remedy": suspect.remedy}
    return CauseWords(*(sentence(suspect.cause, part, english, numbers) for part, english in parts.items()))


def numbers_kept(numbers: Mapping[str, Any]) -> str:
    """The numbers of a cause as JSON, by which `told_again` tells it again."""
    return json.dumps(
        dict(numbers), ensure_ascii=False, default=lambda scalar: getattr(scalar, "item", scalar.__str__)()
    )


def told_again(cause: str, numbers: str | None) -> CauseWords | None:
    """A cause that was kept, in the language in use now; None where this version knows no such cause, or it had other
    numbers then."""
    known = next((each for each in suspects() if each.cause == cause), None)
    if known is None or numbers is None:
        return None
    try:
        kept = json.loads(numbers).items()  # in which a tuple is a list
        return words_of(known, {name: tuple(each) if isinstance(each, list) else each for name, each in kept})
    except (ValueError, LookupError, TypeError, AttributeError):
        return None


SYMPTOMS: Final[Mapping[Symptom, tuple[str, ...]]] = {
    Symptom.SILENCE: ("no-response", "retry"),
    Symptom.DAMAGE: (
        "bit-flip", "byte-extra", "byte-missing", "byte-count-mismatch", "bytes-repeated", "collision", "crc-error",
        "crc-variant", "flow-control-loss", "frame-too-long", "lrc-error", "response-mismatch", "truncated",
    ),
    Symptom.LATENESS: ("late-response", "slow-device", "unexpected-response"),
    Symptom.SHIFT: ("shifted-answer",),
    Symptom.DOUBLES: ("duplicate-response", "broadcast-answered"),
    Symptom.MARKS: ("parity-error",),
    Symptom.REFUSAL: ("exception",),
    Symptom.TIMING: ("gap-in-frame", "gap-too-short", "turnaround-short"),
    Symptom.REQUESTS: ("broadcast-read", "bus-saturated", "echo", "poll-waste"),
    Symptom.FRAMING: ("noise", "other-protocol"),
}  # fmt: skip
SYMPTOM_OF: Final = {code: symptom for symptom, codes in SYMPTOMS.items() for code in codes}


def cause_of(code: str, unit: int | None, causes: Sequence[Cause]) -> int | None:
    """The number of the cause that explains findings of a code about a unit (None: no unit); None where none does."""
    symptom = SYMPTOM_OF.get(code)
    if symptom is None:
        return None
    whom = {(symptom, unit), (symptom, None)}
    return next((i for i, cause in enumerate(causes) if whom & cause.explains), None)
