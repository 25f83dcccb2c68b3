"""One frame, or one stretch of noise, as a tree of items over its bytes: from a capture or a paste, all the same."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Final

from dissectors.fields import Field
from dissectors.values import ORDERS, harmless, readings

from ..languages import counted, field_name, tr, wording
from ..model.owners import owner
from ..model.polls import carried_by, changed
from ..paste.model import PastedFrame, PastedNoise
from ..tables.schema import Kind
from ..words import between, date_and_time, seconds, short, unit_word
from .frames import LETTER, SEVERITY
from .items import NOTHING, FrameDetail, Item, UnopenedItems, chosen
from .view import value_name
from .why import why

if TYPE_CHECKING:
    from ..model.bus import Bus
    from ..tables.batch import Frame
    from ..tables.findings import Finding
    from .desk import ViewState


_PAIR: Final = 2
_DIFFERENT: Final = 64  # differences listed
_FLOATS: Final = 12  # registers that are read as floats before anybody asks
_LEAST, _MOST = 1e-3, 1e7  # of what a plant measures, but for 0


def at_row(desk: ViewState, row: int) -> FrameDetail:
    """A row of the bus."""
    bus = desk.bus
    if bus.is_noise(row):
        data = bus.captured(row)
        head = Item(
            "noise",
            _unexplained(data),
            0,
            len(data),
            "noise",
            label=tr("noise"),
            children=_facts(desk, row),
            ready=False,
        )
        return FrameDetail(tr("noise"), data, (head, *_finding_items(bus.findings(row)), *why(bus, row)))
    frame = bus.frame(row)
    fields = frame.fields(wording())
    title = tr("frame {number}", number=frame.index)
    items = (
        Item("frame", _heading(frame), kind="strong", label=title, children=_facts(desk, row, frame),
             ready=False),
        *_owner(bus, row),
        *_finding_items(frame.findings),
        *_values(desk, row, fields),
        *_versus(desk, row, fields),
        *why(bus, row),
        *_fields(fields),
    )  # fmt: skip
    title += tr(", ASCII mode: its bytes decoded") if frame.protocol == "ascii" else ""
    return FrameDetail(title, frame.adu.data, items, fields)


def _values(desk: ViewState, row: int, fields: tuple[Field, ...]) -> Iterator[Item]:
    """What the registers of a frame mean, value by value; nothing where they are plain numbers."""
    poll = carried_by(desk.bus, row)
    if poll is None or not desk.meanings.means(poll):
        return
    places = list(_registers(fields))
    items = []
    for reading in desk.meanings.readings(poll):
        members = places[reading.at : reading.at + reading.meaning.words]
        start, size = (members[0].start, _PAIR * len(members)) if members else (0, 0)
        was = tr(", was {old}", old=harmless(reading.before)) if reading.changed else ""
        items.append(
            Item(
                value_name(reading.spot), harmless(reading.text) + was, start, size,
                "moved" if reading.changed else "",
                label=f"{reading.register} {harmless(reading.meaning.name)}".rstrip(),
            )
        )  # fmt: skip
    known = sum(not reading.meaning.is_plain for reading in desk.meanings.readings(poll))
    head = counted(known, "value", "values")
    yield Item("values", head, kind="dim", label=tr("values"), children=tuple(items))


def _owner(bus: Bus, row: int) -> Iterator[Item]:
    """Whose answer this is, where the client takes it for another's, or nobody can tell."""
    if said := owner(bus, row):
        yield Item("owner", said, kind="error", label="!", ready=False)


def _versus(desk: ViewState, row: int, fields: tuple[Field, ...]) -> Iterator[Item]:
    """What an answer says otherwise than the one to the same poll before it, and than the one at the time reference."""
    before = desk.bus.polls.before(row)
    if before is not None:
        yield _compared(desk, row, fields, before, "versus")
    marked = _at_reference(desk, row)
    if marked is not None and marked != before:
        yield _compared(desk, row, fields, marked, "versus R")


def _at_reference(desk: ViewState, row: int) -> int | None:
    """The answer at the user's time reference, if it is to the same poll as this one, of whatever unit."""
    bus, place = desk.bus, desk.notes.reference
    marked = -1 if place is None else bus.table.row_of_byte(*place)
    if marked < 0:
        return None
    answer = marked if _is_answer(bus, marked) else bus.partner(marked)
    if answer is None or answer == row or not _is_answer(bus, row):
        return None
    asked, asked_then = bus.partner(row), bus.partner(answer)
    if asked is None or asked_then is None or bus.table.value("length", row) != bus.table.value("length", answer):
        return None
    return answer if _asks(bus, asked) == _asks(bus, asked_then) else None


def _is_answer(bus: Bus, row: int) -> bool:
    return bus.table.value("kind", row) == Kind.RESPONSE


def _asks(bus: Bus, request: int) -> list[tuple[str, str]]:
    """What a request asks for, whomever."""
    return [(each.name, each.text) for each in bus.frame(request).fields() if each.name not in ("unit", "crc")]


def _compared(desk: ViewState, row: int, fields: tuple[Field, ...], other: int, name: str) -> Item:
    """An answer beside another to the same poll."""
    bus = desk.bus
    frame = bus.frame(other)
    pairs = list(_by_meaning(desk, row, other, fields)) or list(changed(frame.fields(wording()), fields))
    away = ""
    if bus.timed:
        since = bus.table.value("t_start_ns", row) - bus.table.value("t_start_ns", other)
        away = tr(", {time} before", time=short(since)) if since >= 0 else tr(", {time} later", time=short(-since))
    words = tr("identical to frame {number}", number=frame.index)
    if pairs:
        difference = counted(len(pairs), "value differs", "values differ")
        words = tr("{difference} from frame {number}", difference=difference, number=frame.index)
    return Item(
        name, words + away,
        kind="moved" if pairs else "dim", label=tr(name), ready=False,
        children=tuple(
            Item(
                f"{i} {new.name}",
                tr("{new}, was {old}", new=new.text, old=old.text.rpartition(": ")[2]) if name == "versus"
                else tr("{new}, there {old}", new=new.text, old=old.text.rpartition(": ")[2]),
                new.start, new.length,
                label=field_name(new.name),
            )
            for i, (old, new) in enumerate(pairs[:_DIFFERENT])
        ),
    )  # fmt: skip


def _by_meaning(desk: ViewState, row: int, other: int, fields: tuple[Field, ...]) -> Iterator[tuple[Field, Field]]:
    """What two answers say otherwise, by what their registers mean; nothing where that is not known."""
    now, then = carried_by(desk.bus, row), carried_by(desk.bus, other)
    if now is None or then is None or not desk.meanings.means(now) or len(now.values) != len(then.values):
        return
    places = list(_registers(fields))
    for reading in desk.meanings.readings(replace(now, before=then.values)):
        members = places[reading.at : reading.at + reading.meaning.words]
        if reading.changed and members:
            named = replace(
                members[0], name=harmless(reading.name), text=harmless(reading.text), length=_PAIR * len(members)
            )
            yield replace(named, text=harmless(reading.before)), named


def at_piece(pasted: PastedFrame | PastedNoise) -> FrameDetail:
    """A piece of a paste."""
    if isinstance(pasted, PastedNoise):
        head = Item("noise", _unexplained(pasted.data), 0, pasted.length, "noise", label=tr("noise"))
        return FrameDetail(tr("outside frames"), pasted.data, (head, *_finding_items(pasted.findings)))
    from ..paste.trees import heading, trouble

    fields = pasted.fields(wording=wording())
    items = [Item("frame", heading(pasted), kind="strong", label=tr("frame"))]
    problem = trouble(pasted)
    if problem:
        items.append(Item("trouble", problem, kind="error", label="!"))
    items.extend(_finding_items(getattr(pasted, "findings", ())))
    items.extend(_float_items(fields))
    items.extend(_fields(fields))
    if pasted.also is not None:
        others = pasted.fields(pasted.also, wording())
        same = others == fields
        text = tr("all fields equal") if same else heading(pasted, pasted.also)
        name = pasted.also.name.lower()
        items.append(
            Item(
                "also",
                text,
                label=tr("or {name}", name=tr(name)),
                ready=False,
                children=() if same else tuple(_fields(others)),
            )
        )
    return FrameDetail(tr("at {start}", start=pasted.start), pasted.adu.data, tuple(items), fields)


def _unexplained(data: bytes) -> str:
    return tr("{bytes} outside any frame", bytes=counted(len(data), "byte", "bytes"))


def _heading(frame: Frame) -> str:
    return f"{tr(frame.direction)}, {tr('unit {unit}', unit=frame.unit)}: {frame.summary(wording())}"


def _facts(desk: ViewState, row: int, frame: Frame | None = None) -> tuple[Item, ...]:
    """What is known of a row besides its bytes."""
    bus = desk.bus
    table = bus.table
    facts: list[tuple[str, str]] = []
    if bus.timed:
        t = table.value("t_start_ns", row)
        facts.append(("time", date_and_time(t, desk.zone)))
        facts.append(("since start", f"{seconds(t - bus.t_first)} {unit_word('s')}"))
        facts.append(("on the wire", short(table.value("t_end_ns", row) - t)))
        gap = bus.gap_ns(row)
        if gap is not None:
            chars = tr(", {count:.1f} characters", count=gap / bus.char_ns) if bus.char_ns else ""
            facts.append(("gap before", f"{short(gap)}{chars}"))
    port = table.value("port", row)
    where = tr("byte {at:,} of its stream", at=table.value("start", row))
    facts.append(("place", where + (tr(", tap {port}", port=port) if port else "")))
    errors = table.value("errors", row)
    if errors:
        facts.append(("UART errors", tr("with a parity or framing error: {count}", count=errors)))
    if frame is not None:
        partner = bus.partner(row)
        if partner is not None:
            index = table.value("frame", partner)
            facts.append(("answers" if frame.row.request >= 0 else "answered by", tr("frame {number}", number=index)))
        took = bus.response(row)
        if took is not None:
            facts.append(("answer took", short(took[0]) if took[0] == took[1] else between(*took)))
        facts.append(("confidence", f"{frame.confidence:.4g}"))
    comment = desk.notes.comments.get(desk.place(row))
    if comment:
        facts.append(("comment", harmless(comment)))
    return tuple(Item(name, text, kind="dim", label=tr(name)) for name, text in facts)


def at_finding(finding: Finding) -> FrameDetail:
    """A finding about the bus as a whole."""
    return FrameDetail(tr("the bus as a whole"), b"", tuple(_finding_items((finding,))))


def finding_name(finding: Finding) -> str:
    """The name of a finding's item."""
    return f"finding {finding.code}"


def _finding_items(findings: Iterable[Finding]) -> Iterator[Item]:
    codes: set[str] = set()
    for i, finding in enumerate(findings):
        name = finding_name(finding) if finding.code not in codes else f"{finding_name(finding)} {i}"
        codes.add(finding.code)
        more = (("likely", finding.cause), ("remedy", finding.remedy), ("source", finding.clause))
        yield Item(
            name, finding.text, kind=SEVERITY[finding.severity],
            label=f"{LETTER[finding.severity]} {finding.code}",
            children=tuple(Item(name, text, label=tr(name)) for name, text in more if text),
        )  # fmt: skip


def _fields(fields: Sequence[Field]) -> Iterator[Item]:
    named = Counter(field.name for field in fields)
    for i, field in enumerate(fields):
        children: Sequence[Item] = tuple(_fields(field.fields))
        if field.problem:
            children = (Item("problem", field.problem, field.start, field.length, "error", label="!"), *children)
        if _is_register(field):
            children = UnopenedItems(lambda i=i, first=children: chain(first, _readings(fields, i)))  # type: ignore[misc]
        yield Item(
            field.name if named[field.name] == 1 else f"{field.name} {i}",
            field.text, field.start, field.length, "error" if field.problem else "",
            label=field_name(field.name), children=children, ready=not _is_register(field), values=_is_register(field),
        )  # fmt: skip


def _registers(fields: Sequence[Field]) -> Iterator[Field]:
    """The registers among fields, however deep, in order."""
    for field in fields:
        if _is_register(field):
            yield field
        else:
            yield from _registers(field.fields)


def _float_items(fields: Sequence[Field]) -> Iterator[Item]:
    """Registers as floats, two by two, in each word order in which all of them are such as a plant measures."""
    members = list(_registers(fields))
    if len(members) % _PAIR or not 0 < len(members) <= _FLOATS:
        return
    words = [int(field.value or 0) for field in members]
    told = [reading for i in range(0, len(words), _PAIR) for reading in readings(words[i : i + _PAIR])]
    for order in ORDERS:
        floats = [each for each in told if each.kind == "f32" and each.order == order]
        sizes = {abs(float(each.value)) for each in floats} - {0.0}
        if sizes and all(_LEAST <= size < _MOST for size in sizes):
            text = "  ".join(each.text for each in floats)
            start, length = members[0].start, _PAIR * len(members)
            yield Item(f"f32 {order}", text, start, length, kind="strong", label=f"f32 {order}")


def _is_register(field: Field) -> bool:
    return field.length == _PAIR and field.bit is None and field.name in ("register", "register_value")


def _readings(fields: Sequence[Field], first: int) -> Iterator[Item]:
    """A register in every interpretation: alone, and with the one and the three that follow it."""
    start = fields[first].start
    for size in (1, 2, 4):
        members = fields[first : first + size]
        if len(members) < size or not all(_is_register(field) for field in members):
            return
        interpretations = readings([int(field.value or 0) for field in members])
        if size == 1:
            for reading in interpretations:
                if reading.kind != "text" or reading.text.strip("."):
                    yield Item(reading.kind, reading.text, start, _PAIR)
            continue
        orders = dict.fromkeys(reading.order for reading in interpretations if reading.order is not None)
        for order in orders:
            text = "  ".join(f"{r.kind} {r.text}" for r in interpretations if r.order == order)
            yield Item(
                f"{size} {order}", text, start, size * _PAIR, label=tr("{count} regs {order}", count=size, order=order)
            )


__all__ = ["NOTHING", "FrameDetail", "Item", "at_finding", "at_piece", "at_row", "chosen", "finding_name"]
