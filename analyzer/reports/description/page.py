"""A bus described for people: the same parts as Markdown and as one HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from dissectors.functions import exception_name
from dissectors.values import harmless

from ...languages import counted, grouped, page_words, register_words
from ...registers.roles import OtherReading
from ...registers.telling import place_cell, span, unit_place
from ...version import __version__
from ...words import UNITS_NS, decimal, duration
from ..markdown import markdown_table, markdown_text
from ..page import facts, file_name
from .model import BusDescription, DescribedRegister, DescribedUnit, not_known
from .rounds import BusRound, RoundSlot
from .sequence import AskedPoll

_FACTS: Final = ("line", "span", "frames")
_OTHERS: Final = 60
_WORTH_TELLING: Final = 0.05  # share of another width, which --json tells from a two-hundredth
_FIGURES: Final = ("p50", "p95", "max")
_ROUND_HEADS: Final = ("slot", "unit", "function, addresses", "at", "every", "requests", "first frame")
_OTHER_HEADS: Final = ("unit", "function, addresses", "requests", "first frame")
_REGISTER_HEADS: Final = ("register", "name", "type", "min", "max", "last", "scale", "sure", "written")


@dataclass(frozen=True, slots=True)
class DescriptionPart:
    """A part of the page: a title, sentences, and a table where it has one."""

    title: str
    sentences: tuple[str, ...] = ()
    heads: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()


def parts(description: BusDescription) -> Iterator[DescriptionPart]:
    """The page, part by part."""
    if description.round is not None:
        yield _round(description.round)
    if description.others:
        title = page_words("asked besides" if description.round else "what is asked")
        rows = tuple((str(s.poll.unit), poll_cell(s.poll), grouped(s.count), str(s.frame)) for s in description.others)
        more = len(rows) - _OTHERS
        sentences = (page_words("and {count:,} more (--json has all)", count=more),) if more > 0 else ()
        yield DescriptionPart(title, sentences, _OTHER_HEADS, rows[:_OTHERS])
    for unit in description.units:
        yield _unit(unit)
    if description.contradictions:
        rows = tuple(
            (
                unit_place(each.remark.unit, each.remark.area, each.remark.address, each.remark.words),
                each.remark.name,
                each.remark.text,
                ", ".join(map(str, each.frames)),
            )
            for each in description.contradictions
        )
        yield DescriptionPart(
            page_words("what contradicts the manual"), (), ("register", "name", "seen", "frames"), rows
        )
    yield DescriptionPart(page_words("what is not known"), tuple(not_known(description)))


def poll_cell(poll: AskedPoll) -> str:
    """Function and addresses: `03 107..109`."""
    if poll.address is None:
        return f"{poll.function:02d}"
    last = poll.address + (poll.quantity or 1) - 1
    return f"{poll.function:02d} {poll.address}" + (f"..{last}" if last > poll.address else "")


def _round(turn: BusRound) -> DescriptionPart:
    sentences = []
    if turn.period_ns is not None and turn.jitter_ns is not None:
        words = "A cycle takes {period}; nine in ten deviate by less than {jitter}."
        jitter = duration(max(turn.jitter_ns, UNITS_NS["us"]))  # as fine as times are told
        sentences.append(page_words(words, period=duration(turn.period_ns), jitter=jitter))
    words = "{share:.0%} of the requests that recur keep this order, in {rounds:,} rounds."
    sentences.append(page_words(words, share=turn.share, rounds=turn.rounds))
    rows = tuple(_slot_row(number, slot) for number, slot in enumerate(turn.slots, 1))
    return DescriptionPart(page_words("the poll round"), tuple(sentences), _ROUND_HEADS, rows)


def _slot_row(number: int, slot: RoundSlot) -> tuple[str, ...]:
    every = page_words("round") if slot.every == 1 else page_words("{count} rounds", count=slot.every)
    at = "" if slot.offset_ns is None else duration(slot.offset_ns) if slot.offset_ns else "0"
    unit = str(slot.poll.unit)
    return str(number), unit, poll_cell(slot.poll), at, every, grouped(slot.count), str(slot.frame)


def _unit(unit: DescribedUnit) -> DescriptionPart:
    rows = tuple(_register_row(each) for each in unit.registers)
    title = page_words("to all units (0)") if not unit.unit else page_words("unit {unit}", unit=unit.unit)
    return DescriptionPart(title, tuple(_sentences(unit)), _REGISTER_HEADS if rows else (), rows)


def _sentences(unit: DescribedUnit) -> Iterator[str]:
    for text, frame in unit.said.items():
        yield page_words("It identifies itself as: {text} (frame {frame}).", text=text, frame=frame)
    if unit.looks is not None:
        looks = unit.looks
        words = "It looks like {device} ({sure:.0%}: {why})."
        yield page_words(words, device=looks.chart.called, sure=looks.confidence, why=looks.why)
    counts, times = unit.row.counts, unit.row.times
    requests = counted(counts.requests, "request", "requests")
    yield page_words("{requests}, {answered:,} answered.", requests=requests, answered=counts.answered)
    if times.count and times.off_ns is not None:
        figures = ", ".join(f"{figure} {times.worded(figure)}" for figure in _FIGURES)
        yield page_words("Response times: {figures}.", figures=figures)
    for function, code, count, frame in unit.exceptions:
        words = "Function {function:02d} was refused: {code:02d} {name}, {count:,} times, first in frame {frame}."
        name = exception_name(code)
        yield page_words(words, function=function, code=code, name=name, count=count, frame=frame)


def _register_row(register: DescribedRegister) -> tuple[str, ...]:
    value = register.value
    kind, sure = _type_cells(register)
    told = register.is_known or register.either is not None or value.words == 1
    numbers = (value.minimum, value.maximum, value.last) if told else (None,) * 3
    scale = "" if value.scale in (None, 1) else f"x{value.scale:g}"
    scale = f"{scale} {value.unit_of_measure or ''}".strip()
    written = ""
    if register.writes:
        functions = ", ".join(f"{function:02d}" for function in register.written_by)
        words = "by the client, {functions}, {count:,} times, frame {frame}"
        written = page_words(words, functions=functions, count=register.writes, frame=register.written_in)
    place = place_cell(value.area, value.address, value.words)
    return place, value.name or "", kind, *map(_number, numbers), scale, sure, written


def _type_cells(register: DescribedRegister) -> tuple[str, str]:
    """What type a register has, as far as that is known, and how sure that is."""
    value, sure = register.value, register.value.confidence
    kind = f"{register_words(value.type)} {value.order or ''}".strip()
    if register.is_known:
        others = [other for other in value.same_number if other.confidence >= _WORTH_TELLING]
        sure += sum(other.confidence for other in others)
        if others:
            kind = page_words(
                "{type}, or the same number as {others}", type=kind, others=", ".join(map(_other, others))
            )
    elif register.either is not None:
        other = register.either  # the row's numbers and its certainty are of the likelier one
        kind = page_words("{type} or {other} ({sure:.0%})", type=kind, other=_other(other), sure=other.confidence)
    elif register.is_likely:
        kind = page_words("not known; likely {type}", type=kind)
    else:
        return page_words("not known"), ""
    return kind, decimal(f"{min(sure, 1):.0%}")


def _other(reading: OtherReading) -> str:
    return f"{reading.called} {span(reading.address, reading.words)}"


def _number(value: object) -> str:
    return "" if value is None else f"{value:.7g}" if isinstance(value, float) else str(value)


def description_facts(description: BusDescription) -> Iterator[tuple[str, str]]:
    """What is described: a label with its words."""
    report = description.report
    yield page_words("capture"), file_name(report.source) or page_words("unnamed")
    yield "SHA-256", description.sha256 or "?"
    known = {label: words for label, words in facts(report) if label}
    yield from ((page_words(label), known[label]) for label in _FACTS if label in known)
    yield page_words("made by"), f"rtuscope {__version__}"


def markdown(description: BusDescription) -> str:
    """The description as Markdown; newline at the end."""
    return "\n".join(harmless(line) for line in _lines(description)) + "\n"


def _lines(description: BusDescription) -> Iterator[str]:
    yield f"# {page_words('A Modbus bus, described from its traffic')}"
    yield ""
    for label, words in description_facts(description):
        yield f"- {label}: {markdown_text(words)}"
    for part in parts(description):
        yield from ("", f"## {part.title}", "")
        for sentence in part.sentences:
            yield f"- {markdown_text(sentence)}"
        if part.rows:
            yield from (
                ("", *markdown_table(part.heads, part.rows))
                if part.sentences
                else markdown_table(part.heads, part.rows)
            )


def html(description: BusDescription) -> str:
    """The description as one page, self-contained."""
    from ..html.page import page_environment

    shown: Sequence[DescriptionPart] = list(parts(description))
    template = page_environment(__package__).get_template("description.html.j2")
    return template.render(facts=list(description_facts(description)), parts=shown)
