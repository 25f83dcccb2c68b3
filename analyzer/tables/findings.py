"""A finding: what was seen and measured, how grave it is, what probably causes it and what to do.

Findings travel as rows of `Findings`, a few numbers each, and become words (`Finding`) only where somebody reads them.
Observation is not root cause: `text` says what was seen, `cause` what it likely comes from.

The clauses that findings rest on have their documents and titles here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from functools import cache
from inspect import isfunction
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, Final, Protocol, TypeVar

import numpy as np

from ..html_text import html_page, html_table
from ..languages import phrase
from ..registry import Registry
from .schema import Columns, Float64s, Int16s, Int64s, UInt8s

if TYPE_CHECKING:
    from ..diagnosis.view import DiagnosisStep
    from .schema import Rows

NUMBERS: Final = 8  # figures of evidence that a finding carries at most


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Findings(Columns):
    """Findings as figures."""

    rule: Int16s  # position of its code in `registry.codes()`
    index: Int64s  # number of the frame; -1 for noise and for what concerns the bus as a whole
    start: Int64s  # offset of the bytes meant in their port's stream; -1 for the bus as a whole
    length: Int64s  # bytes
    port: UInt8s
    t_ns: Int64s  # ns, start of those bytes
    numbers: Annotated[Float64s, NUMBERS]  # evidence, named by the rule; NaN where unknown


NOTHING: Final = Findings.zeros(0)


class Severity(IntEnum):
    """How grave a finding is."""

    NOTE = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding in words.

    `numbers` is the evidence by name (the name's end is its unit: `_ms`, `_bytes`), unknown ones left out; `clause` is
    what of the specification it rests on (`titled`), or empty. `index` is None where no frame is meant, `start` and
    `length` are -1 and 0 where the whole bus is.
    """

    code: str
    severity: Severity
    text: str
    cause: str
    remedy: str
    clause: str
    numbers: Mapping[str, float]
    index: int | None
    start: int
    length: int
    port: int
    t_ns: int

    def _repr_html_(self) -> str:
        """For notebooks."""
        lines = [(name, getattr(self, name)) for name in ("cause", "remedy", "clause") if getattr(self, name)]
        return html_page(f"{self.severity.name.lower()}: {self.code}: {self.text}", html_table((), lines))

    def to_json(self) -> dict[str, Any]:
        """The object that stands in a frame's JSON line."""
        line: dict[str, Any] = {"code": self.code, "severity": self.severity.name.lower(), "text": self.text}
        for key in ("cause", "remedy", "clause"):
            if value := getattr(self, key):
                line[key] = value
        if self.numbers:
            line["numbers"] = {key: int(n) if n == int(n) else round(n, 6) for key, n in self.numbers.items()}
        return line


def described(findings: Findings) -> Iterator[Finding]:
    """Findings in words."""
    return (describe(findings, row) for row in range(len(findings)))


def evidence(rule: Rule, numbers: Iterable[float]) -> dict[str, float]:
    """The numbers of a row of `Findings` by the names that its rule gives them, unknown ones left out."""
    return {name: number for name, number in zip(rule.numbers, numbers, strict=False) if isfinite(number)}


def describe(findings: Findings, row: int) -> Finding:
    """A row of `Findings` in words."""

    rule = rules()[findings.rule[row]]
    index = int(findings.index[row])
    numbers = evidence(rule, findings.numbers[row].tolist())
    return Finding(
        code=rule.code,
        severity=rule.severity,
        text=rule.words(rule.text, numbers),
        cause=rule.words(rule.cause, numbers),
        remedy=rule.words(rule.remedy, numbers),
        clause=titled(rule.clause),
        numbers=numbers,
        index=None if index < 0 else index,
        start=int(findings.start[row]),
        length=int(findings.length[row]),
        port=int(findings.port[row]),
        t_ns=int(findings.t_ns[row]),
    )


# The one collection of rules: a `Rule` declares a finding, a look finds it.
#
# A module of `analyzer.diagnosis.rules` holds declarations and looks; nothing lists the modules:
#
#   SILENT_UNIT = Rule("silent-unit", Severity.NOTE, About.BUS, numbers=("unit",), text="unit {unit:.0f} never answers")
#
#     @looks_for(SILENT_UNIT)
#     def silent_unit(view: View) -> Iterator[Findings]:
#         yield SILENT_UNIT.on(view.rows[suspicious], view.rows.unit[suspicious])
#
# A look is called with each `View` in turn. One that remembers is a class without arguments, made anew for each
# diagnosis and called the same way; it may have `close(view)` for what only the end shows, and `open_from`, the index
# of the first frame that it may still speak of. What it says must hang on the rows alone, never on how they were cut
# into views.


Words = str | Callable[[Mapping[str, float]], str]  # a template over the evidence, or a function of it


class FindingLook(Protocol):
    """Finds what its rules declare: a function, or an instance of a class that remembers."""

    def __call__(self, view: DiagnosisStep, /) -> Iterable[Findings]: ...


class About(Enum):
    """What a finding speaks of."""

    FRAME = "frame"
    TRANSACTION = "transaction"
    NOISE = "noise"
    BUS = "bus"


@dataclass(frozen=True, eq=False)
class Rule:
    """The declaration of a finding.

    `numbers` names its evidence, at most eight figures; `clause` is where the specification has it ([1] application
    protocol V1.1b3, [2] serial line V1.02); `when` says in words what is found. The other words are templates over
    the evidence (`{unit:.0f}`), or functions of it that tell each piece by `languages.phrase`.
    """

    code: str
    severity: Severity
    about: About
    text: Words
    cause: Words = ""
    remedy: Words = ""
    clause: str = ""
    when: str = ""
    numbers: tuple[str, ...] = ()
    varies: str = ""  # which of the numbers tells variants apart, whose causes and remedies differ
    loses: bool = False  # an answer each time
    wastes: str = ""  # which of the numbers is time that was lost, in ms

    def on(self, rows: Rows, *numbers: Any) -> Findings:
        """A finding on each of these rows ; `numbers` are arrays of their length, or one figure for all."""
        return self.at(rows.index, rows.start, rows.length, rows.port, rows.t_start_ns, *numbers)

    def at(self, index: Any, start: Any, length: Any, port: Any, t_ns: Any, *numbers: Any) -> Findings:
        """The same by the columns of `Findings`."""
        findings = Findings.zeros(len(start))
        findings.index[:], findings.start[:], findings.length[:] = index, start, length
        findings.port[:], findings.t_ns[:] = port, t_ns
        return self._filled(findings, numbers)

    def of_bus(self, t_ns: int, *numbers: float) -> Findings:
        """A finding about the bus as a whole."""
        findings = Findings.zeros(1)
        findings.index[:] = findings.start[:] = -1
        findings.t_ns[:] = t_ns
        return self._filled(findings, numbers)

    def _filled(self, findings: Findings, numbers: tuple[Any, ...]) -> Findings:
        if len(numbers) != len(self.numbers) or len(numbers) > NUMBERS:
            raise TypeError(f"{self.code}: {len(numbers)} figures for {len(self.numbers)} names")
        findings.rule[:] = codes().index(self.code)
        findings.numbers[:] = np.nan
        for i, figure in enumerate(numbers):
            findings.numbers[:, i] = figure
        return findings

    @staticmethod
    def words(words: Words, numbers: Mapping[str, float]) -> str:
        """Words over this evidence, in the language in use."""
        return phrase(words, numbers) if isinstance(words, str) else words(numbers)


_L = TypeVar("_L", bound=Callable[..., Any])
_looks: dict[Callable[..., Any], tuple[Rule, ...]] = {}
_RULES: Final = Registry[Rule]("analyzer.diagnosis.rules", "rule")


def looks_for(*declared: Rule) -> Callable[[_L], _L]:
    """Registers a look (a function, or a class that remembers) for these rules."""

    def enter(look: _L) -> _L:
        for rule in declared:
            _RULES.enter(rule.code, rule)
        _looks[look] = declared
        return look

    return enter


@cache
def rules() -> tuple[Rule, ...]:
    """All rules, in the order of their codes."""
    return tuple(_RULES.by_name().values())


@cache
def codes() -> tuple[str, ...]:
    """The codes of all rules, sorted: `Findings.rule` is a position in it."""
    return tuple(rule.code for rule in rules())


def all_looks() -> tuple[Callable[..., Any], ...]:
    """All looks as they are declared: functions, and classes that remember."""
    rules()
    return tuple(_looks)


def codes_of(look: FindingLook) -> str:
    """The codes of what a look finds, as one text."""
    declared = _looks[look if isfunction(look) else type(look)]
    return ", ".join(rule.code for rule in declared)


def fresh_looks() -> list[FindingLook]:
    """All looks, those that remember with nothing to remember yet."""
    return [look() if isinstance(look, type) else look for look in all_looks()]


_DOCUMENTS: Final[Mapping[str, str]] = {  # the numbers that they have in comments, too
    "[1]": "MODBUS Application Protocol V1.1b3",
    "[2]": "MODBUS over Serial Line V1.02",
}
_TITLES: Final[Mapping[str, str]] = {
    "[1] 4.1": "Protocol description",
    "[1] 5": "Function Code Categories",
    "[1] 6": "Function codes descriptions",
    "[1] 6.1": "01 Read Coils",
    "[1] 6.5": "05 Write Single Coil",
    "[1] 7": "MODBUS Exception Responses",
    "[2] 2.1": "MODBUS Master/Slaves protocol principle",
    "[2] 2.2": "MODBUS Addressing rules",
    "[2] 2.4.1": "Master State diagram",
    "[2] 2.5.1": "RTU Transmission Mode",
    "[2] 2.5.1.1": "MODBUS Message RTU Framing",
    "[2] 2.5.1.2": "CRC Checking",
    "[2] 2.5.2.2": "LRC Checking",
    "[2] 6.2.2": "CRC Generation",
}


def titled(clause: str) -> str:
    """A clause with its document, and its title where the table has it: `MODBUS over Serial Line V1.02, 2.5.1.2 (CRC
    Checking)`; none, empty."""
    if not clause:
        return ""
    document, number = clause.split()
    title = f" ({_TITLES[clause]})" if clause in _TITLES else ""
    return f"{_DOCUMENTS[document]}, {number}{title}"
