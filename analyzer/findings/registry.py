"""The one collection of rules: a `Rule` declares a finding, a look finds it.

A module of `analyzer.findings.rules` holds declarations and looks; nothing lists the modules:

    SILENT_UNIT = Rule("silent-unit", Severity.NOTE, About.BUS, numbers=("unit",), text="unit {unit:.0f} never answers")

    @looks_for(SILENT_UNIT)
    def silent_unit(view: View) -> Iterator[Findings]:
        yield SILENT_UNIT.on(view.rows[suspicious], view.column("unit")[suspicious])

A look is called with each `View` in turn. One that remembers is a class without arguments, made anew for each diagnosis
and called the same way; it may have `close(view)` for what only the end shows, and `open_from`, the index of the first
frame that it may still speak of. What it says must hang on the rows alone, never on how they were cut into views.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from .model import FINDING, NUMBERS, Findings, Severity

if TYPE_CHECKING:
    from ..frames import Rows
    from .view import View

Words = str | Callable[[Mapping[str, float]], str]  # a template over the evidence, or a function of it
Look = Callable[["View"], Iterable[Findings]]


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
    the evidence (`{unit:.0f}`), or functions of it.
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
    loses: bool = False  # an answer each time
    wastes: str = ""  # which of the numbers is time that was lost, in ms

    def on(self, rows: Rows, *numbers: Any) -> Findings:
        """A finding on each of these rows (ROW); `numbers` are arrays of their length, or one figure for all."""
        return self.at(rows["index"], rows["start"], rows["length"], rows["port"], rows["t_start"], *numbers)

    def at(self, index: Any, start: Any, length: Any, port: Any, t_ns: Any, *numbers: Any) -> Findings:
        """The same by the columns of FINDING."""
        found = np.zeros(len(start), FINDING)
        for name, column in (("index", index), ("start", start), ("length", length), ("port", port), ("t", t_ns)):
            found[name] = column
        return self._filled(found, numbers)

    def of_bus(self, t_ns: int, *numbers: float) -> Findings:
        """A finding about the bus as a whole."""
        found = np.zeros(1, FINDING)
        found["index"] = found["start"] = -1
        found["t"] = t_ns
        return self._filled(found, numbers)

    def _filled(self, found: Findings, numbers: tuple[Any, ...]) -> Findings:
        if len(numbers) != len(self.numbers) or len(numbers) > NUMBERS:
            raise TypeError(f"{self.code}: {len(numbers)} figures for {len(self.numbers)} names")
        found["rule"] = codes().index(self.code)
        found["numbers"] = np.nan
        for i, figure in enumerate(numbers):
            found["numbers"][:, i] = figure
        return found

    @staticmethod
    def words(words: Words, numbers: Mapping[str, float]) -> str:
        """Words over this evidence."""
        return words.format_map(numbers) if isinstance(words, str) else words(numbers)


_L = TypeVar("_L", bound=Callable[..., Any])
_looks: list[Callable[..., Any]] = []
_declared: dict[str, Rule] = {}


def looks_for(*found: Rule) -> Callable[[_L], _L]:
    """Registers a look (a function, or a class that remembers) for these rules."""

    def enter(look: _L) -> _L:
        for rule in found:
            if _declared.setdefault(rule.code, rule) is not rule:
                raise ValueError(f"two rules have the code {rule.code}")
        _looks.append(look)
        return look

    return enter


@cache
def rules() -> tuple[Rule, ...]:
    """All rules, in the order of their codes."""
    package = import_module("analyzer.findings.rules")
    for name in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
        import_module(f"{package.__name__}.{name}")
    return tuple(_declared[code] for code in sorted(_declared))


@cache
def codes() -> tuple[str, ...]:
    """The codes of all rules, sorted: `FINDING["rule"]` is a position in it."""
    return tuple(rule.code for rule in rules())


def fresh_looks() -> list[Look]:
    """All looks, those that remember with nothing to remember yet."""
    rules()
    return [look() if isinstance(look, type) else look for look in _looks]
