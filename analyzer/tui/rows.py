"""A row of the bus in pieces of text: what the frame list and the conversations show of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from rich.cells import cell_len

from dissectors.values import harmless

from ..languages import counted, tr, wording
from ..model.table import RowState
from ..tables.schema import Kind
from ..tables.transactions import Status
from ..words import short_bound
from .paint import StyledText, fitted

if TYPE_CHECKING:
    from ..tables.findings import Finding
    from .desk import ViewState

SEVERITY: Final = ("", "note", "warning", "error")  # kind of text by mark
LETTER: Final = (" ", "N", "W", "E")
UNHEARD: Final = "unheard"  # an answer that the recording may have missed
_NOISE_BYTES: Final = 12
_ENDED: Final = {
    Status.UNANSWERED: ("none", "error"),
    Status.BROADCAST: ("bcast", "dim"),
    Status.DAMAGED: ("bad", "error"),
    Status.UNHEARD: (UNHEARD, "dim"),
}


def marks(desk: ViewState, row: int) -> StyledText:
    """Two characters: the gravest finding's letter, and `*` for a bookmark or `R` for the time reference."""
    mark = desk.bus.table.value("mark", row)
    place = desk.place(row)
    note = "R" if place == desk.notes.reference else "*" if place in desk.notes.comments else " "
    return StyledText(LETTER[mark] + note, SEVERITY[mark] or ("accent" if note != " " else ""))


def joint(desk: ViewState, row: int) -> str:
    """Two characters: how a row hangs together with its neighbour, and its direction."""
    table = desk.bus.table
    kind, partner = table.value("kind", row), table.value("partner", row)
    if kind == Kind.NOISE:
        return "~~"
    if kind == Kind.REQUEST:
        return "┌→" if partner == row + 1 else "╷→" if partner >= 0 else " →"
    return "└←" if partner == row - 1 and _mutual(desk, row, partner) else "╵←" if partner >= 0 else "?←"


def _mutual(desk: ViewState, row: int, partner: int) -> bool:
    return desk.bus.table.value("partner", partner) == row


def direction(desk: ViewState, row: int) -> str:
    """The kind of text of a row's direction."""
    return ("noise", "request", "response")[desk.bus.table.value("kind", row)]


def words(desk: ViewState, row: int) -> tuple[list[StyledText], list[StyledText]]:
    """A row in words; and what was said of it: codes of findings, the user's comment."""
    bus = desk.bus
    if bus.is_noise(row):
        octets = bus.captured(row)
        shown = octets[:_NOISE_BYTES].hex(" ").upper() + (" …" if len(octets) > _NOISE_BYTES else "")
        content = [StyledText(f"{tr('noise')}, {counted(len(octets), 'byte', 'bytes')}: {shown}", "noise")]
        findings = bus.findings(row)
    else:
        frame = bus.frame(row)
        findings = frame.findings
        content = [StyledText("" if frame.crc_ok else tr("CRC wrong: "), "error"), StyledText(frame.summary(wording()))]
    return content, _about(desk, row, findings)


def about(desk: ViewState, row: int) -> list[StyledText]:
    """What was said of a row: codes of findings, the user's comment."""
    return _about(desk, row, desk.bus.findings(row))


def _about(desk: ViewState, row: int, findings: Sequence[Finding]) -> list[StyledText]:
    codes = {finding.code: finding.severity for finding in reversed(findings)}
    parts = [StyledText(f"  {code}", SEVERITY[severity]) for code, severity in codes.items()]
    comment = desk.notes.comments.get(desk.place(row))
    if comment:
        parts.append(StyledText(f'  "{harmless(comment)}"', "accent"))
    return parts


def shared(content: list[StyledText], about: list[StyledText], width: int) -> list[StyledText]:
    """Both in this many columns: at least half for the words, the rest for what was said of them."""
    need = sum(cell_len(part.text) for part in about)
    if not need:
        return fitted(content, width)
    room = max(width - need, width // 2)
    size = sum(cell_len(part.text) for part in content)
    return fitted([*(fitted(content, room) if size > room else content), *about], width)


def ended(desk: ViewState, row: int) -> StyledText:
    """How long an answer took; of a request, that there was none."""
    table = desk.bus.table
    kind = table.value("kind", row)
    if kind == Kind.RESPONSE:
        return StyledText(short_bound(desk.bus.response(row)), "")
    if kind == Kind.REQUEST and table.value("partner", row) < 0:
        status = table.value("state", row) & RowState.STATUS
        if status:
            return StyledText(*_ENDED.get(Status(status - 1), ("", "")))
    return StyledText("", "")
