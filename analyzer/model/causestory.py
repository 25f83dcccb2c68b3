"""The story of a cause, to be handed on: what it is, what to do, what shows it, and the user's notes on that."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from datetime import tzinfo
from typing import TYPE_CHECKING, Final

from dissectors.values import harmless

from ..languages import counted, tr
from ..tables.schema import Kind
from ..words import data_size
from .rowstores import rows_showing
from .spoken import transaction_words

if TYPE_CHECKING:
    from ..causes.registry import Cause
    from .bus import Bus

_ROWS: Final = 2000  # more of the same tell a reader no more


def story(
    bus: Bus, cause: Cause, facts: Mapping[str, str], notes: Mapping[int, str], zone: tzinfo, stop: Callable[[], bool]
) -> Iterator[str]:
    """Lines of Markdown that read as plain text; `facts` are told first, `notes` are the user's, by row."""
    rows = rows_showing(bus, cause).tolist()
    yield f"# {cause.cause}, {cause.sure}"
    yield ""
    yield from (f"- {tr(name)}: {harmless(words)}" for name, words in facts.items())
    if rows:
        yield ""
        yield f"## {tr('What shows it')}: {counted(len(rows), 'row', 'rows')}"
        yield ""
    told = set[int]()
    for row in rows[:_ROWS]:
        if stop():
            return
        first = _asked(bus, row)
        if first not in told:
            told.add(first)
            own = [notes[each] for each in {first, row} if notes.get(each)]
            yield harmless("- " + told_row(bus, first, zone) + "".join(f"; **{tr('note')}: {note}**" for note in own))
    if len(rows) > _ROWS:
        yield f"- {tr('… and {rows} more', rows=counted(len(rows) - _ROWS, 'row', 'rows'))}"


def _asked(bus: Bus, row: int) -> int:
    """The request that an answer is to; the row itself for any other."""
    partner = bus.partner(row) if bus.table.value("kind", row) == Kind.RESPONSE else None
    return row if partner is None else partner


def told_row(bus: Bus, row: int, zone: tzinfo) -> str:
    """What a row is that shows a cause; of an answer, its whole transaction."""
    row = _asked(bus, row)
    if bus.is_noise(row):
        found = ", ".join(finding.text for finding in bus.findings(row))
        return f"{tr('noise')}, {data_size(bus.table.value('length', row))}{': ' if found else ''}{found}"
    return transaction_words(bus, row, zone)
