"""Why a frame's boundaries stand where they do: silences on a ruler, the weight of all evidence, the runner-up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from ..deframing.tap_clock import silences
from ..languages import counted, tr
from ..tables.schema import NO_GAP, Kind
from ..words import short
from .items import Item

if TYPE_CHECKING:
    from ..model.bus import Bus
    from ..model.rowstores import RowEvidence

_RULER: Final = 14  # columns
_BITS: Final = 2.0  # a column of a bar
_BAR: Final = 12
_NEXT: Final = 64  # rows that the next one of a port is looked for among
_WEIGHED: Final = (("length", "length"), ("crc", "crc"), ("silence", "silence"), ("conversation", "talk"))


def why(bus: Bus, row: int) -> Iterator[Item]:
    """The item that tells it; nothing where no evidence was kept."""
    weighed = bus.evidence(row)
    if weighed is None:
        return
    if weighed.margin > 0:
        margin = counted(round(weighed.margin), "bit", "bits")
        verdict = tr("{margin} likelier than {rival}", margin=margin, rival=_rival(bus, row, weighed))
    else:
        verdict = tr("no alternative")
    yield Item(
        "why", verdict, kind="dim", label=tr("why"), ready=False,
        children=(*_ruled(bus, row), *_weights(weighed)),
    )  # fmt: skip


def _rival(bus: Bus, row: int, weighed: RowEvidence) -> str:
    """What would stand here instead."""
    if weighed.rival_kind == Kind.NOISE or not weighed.rival_length:
        return tr("noise with other bounds") if bus.is_noise(row) else tr("noise")
    ahead = weighed.rival_start - bus.table.value("start", row)
    where = tr("from here on")
    if ahead:
        octets = counted(abs(ahead), "byte", "bytes")
        where = tr("{bytes} on", bytes=octets) if ahead > 0 else tr("{bytes} before", bytes=octets)
    kind = tr(Kind(weighed.rival_kind).name.lower())
    return tr(
        "a {kind} of {bytes} {where}", kind=kind, bytes=counted(weighed.rival_length, "byte", "bytes"), where=where
    )


def _weights(weighed: RowEvidence) -> Iterator[Item]:
    """Each kind of evidence in bits: for this frame, or (shaded) against it."""
    for name, label in _WEIGHED:
        bits = float(getattr(weighed, name))
        bar = ("█" if bits > 0 else "▒") * min(_BAR, round(abs(bits) / _BITS))
        yield Item(
            name, f"{bits:+6.1f} {bar or tr('tells nothing')}", kind="" if bits >= 0 else "warning", label=tr(label)
        )


def _ruled(bus: Bus, row: int) -> Iterator[Item]:
    """The silences before, inside and after, each on a ruler with t1.5 and t3.5."""
    if not bus.timed:
        yield Item("silences", tr("no times in this capture"), kind="dim", label=tr("silences"))
        return
    table = bus.table
    inside = table.value("gap_most_ns", row)
    following = _next(bus, row)
    gaps = (
        ("before", bus.gap_ns(row)),
        ("inside", inside if inside > NO_GAP else None),
        ("after", None if following is None else bus.gap_ns(following)),
    )
    t15, t35 = silences(bus.line, bus.options)
    if math.isfinite(t35):
        yield Item("ruler", f"t1.5 {short(round(t15))}, t3.5 {short(round(t35))}", kind="dim", label=tr("limits"))
    for name, gap in gaps:
        if gap is None:
            yield Item(
                name,
                tr("unknown from this tap") if name != "after" else tr("nothing follows"),
                kind="dim",
                label=tr(name),
            )
            continue
        line = f"{ruler(gap, t15, t35)} " if math.isfinite(t35) else ""
        yield Item(name, f"{line}{short(gap)}", kind="warning" if name == "inside" and gap > t15 else "",
                   label=tr(name))  # fmt: skip


def ruler(gap_ns: int, t15_ns: float, t35_ns: float) -> str:
    """A silence drawn to scale up to twice t3.5, in `_RULER` columns; an arrow where it is longer."""
    cells = [" "] * _RULER
    scale = (_RULER - 1) / (2 * t35_ns)
    end = round(min(max(gap_ns, 0) * scale, _RULER - 1))
    cells[: end + 1] = "─" * (end + 1)
    cells[end] = "→" if gap_ns > 2 * t35_ns else "●"
    for mark in (t15_ns, t35_ns):
        column = round(mark * scale)
        cells[column] = "┊" if cells[column] == " " else "┼" if cells[column] == "─" else cells[column]
    return "".join(cells)


def _next(bus: Bus, row: int) -> int | None:
    """The next row of the same port."""
    port = bus.table.value("port", row)
    rows = range(row + 1, min(bus.count, row + _NEXT))
    return next((later for later in rows if bus.table.value("port", later) == port), None)
