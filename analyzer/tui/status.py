"""The line above the keys: what is open, how far it is read, where the cursor is, what was found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.cells import cell_len
from textual.strip import Strip

from dissectors.values import harmless

from ..languages import counted, grouped, tr
from ..tables.findings import Severity
from .paint import Painted, StyledText, fitted

if TYPE_CHECKING:
    from .desk import ViewState


def is_gone(source: object) -> bool:
    """Whether a live source cannot hear anything now."""
    return bool(getattr(source, "gone", False))


_SPIN = "|/-\\"
_SLIM = 100  # columns under which not all of a live state has room


class StatusLine(Painted):
    """One line; `say` puts what the list knows into it."""

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.where = ""
        self.doing = ""
        self.follow = ""
        self._turn = 0

    def say(self, where: str, doing: str = "", follow: str = "") -> None:
        """Where the cursor is, what goes on, and live whether the list follows its end."""
        self.where, self.doing, self.follow = where, doing, follow
        self._turn += 1
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width = self.content_size.width
        if y:
            return Strip.blank(width, self.base)
        state = getattr(self.desk.source, "state", None)
        told = [] if state is None or self.desk.bus.whole else list(state())
        slim = bool(told) and width < _SLIM  # what may change stands before what does not
        left = [StyledText(f" {self._called(max(12, width // 3))} ", "strong")]
        left.append(StyledText(" " if slim else f"{self._speed()}  ", "dim"))
        if self.desk.paused:
            left.append(StyledText(f"{tr('PAUSED, P goes on')}  ", "warning"))
        if doing := self.doing or self._listening():
            words = self.doing if told else doing  # beside a rate the spin alone says that it listens
            left.append(StyledText(f"{_SPIN[self._turn % len(_SPIN)]} {words}{'  ' if words else ''}", "accent"))
        states = [StyledText(f"{harmless(words)}  ", kind) for words, kind in told]
        if slim:
            left += [*states[:-1], StyledText(f"{self.follow}  "), states[-1], StyledText(self.where)]
        else:
            left += [*states, StyledText(", ".join(filter(None, (self.where, self.follow))))]
        right = self._finding_counts()
        size = sum(cell_len(part.text) for part in right)
        return self.strip([*fitted(left, max(0, width - size)), *right], width, self.base)

    def _listening(self) -> str:
        """What a live source does, if it can: looked at when it is painted, as all that stands beside it."""
        source = self.desk.source
        return tr("listening") if source.live and not self.desk.bus.whole and not is_gone(source) else ""

    def _called(self, most: int) -> str:
        name = harmless(self.desk.source.name)
        return name if len(name) <= most else "…" + name[1 - most :]

    def _speed(self) -> str:
        line = self.desk.source.line
        if not line.baud:
            return tr("baud not known")
        stop = f"{line.stop_bits:g}" if line.stop_bits else ""
        return f"{line.baud}{f' 8{line.parity}{stop}' if line.parity else ''}"

    def _finding_counts(self) -> list[StyledText]:
        counts = self.desk.bus.found.by_severity
        kinds = ((Severity.ERROR, "E", "error"), (Severity.WARNING, "W", "warning"), (Severity.NOTE, "N", "note"))
        by_kind = [
            StyledText(f" {grouped(counts[level])}{letter}", kind) for level, letter, kind in kinds if counts[level]
        ]
        losses = self.desk.losses
        lost = [StyledText(f" !{counted(losses, 'loss', 'losses')}", "error")] if losses else []
        return [*lost, *by_kind, StyledText(" ")]
