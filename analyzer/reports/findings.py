"""What is wrong, on the report page: the causes; the three findings that cost the bus most; then all, by code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from ..causes.leftovers import Left
from ..causes.registry import Cause, cause_of
from ..languages import counted, grouped, page_words
from ..words import decimal, is_clock, time_of_day, unit_word
from .model import FindingGroup, FindingRow
from .paragraphs import PageLine, Paragraph
from .tabular import PageColumn, PageTable

_WORST: Final = 3
_WORST_AS: Final = {  # of a handful of frames, and else: their head, and what is told
    False: ("what costs this bus most", ("error", "warning")),
    True: ("what these frames show", ("error", "warning", "note")),
}
_UNITS: Final = 5  # named in a line
_GROUPS: Final = 3  # told of a finding
_LEFT: Final = 8  # of what no cause takes


def cause_lines(causes: Sequence[Cause], *, shares: bool = True) -> Iterator[PageLine]:
    """What explains the findings, best first, each with how sure that is if wanted; nothing where there are none."""
    if causes:
        yield ""
        yield page_words("what is wrong")
    for number, cause in enumerate(causes, 1):
        head = "{number}. {cause}, {words}: {text}" if shares else "{number}. {cause}: {text}"
        yield Paragraph(
            page_words(
                head,
                number=number,
                cause=cause.cause,
                words=cause.sure,
                text=cause.text,
            )
        )
        yield from _labelled("seen", cause.share)
        yield from _labelled("to confirm", cause.deciding_test)
        yield from _labelled("do", cause.remedy)


def uncounted(row: FindingRow) -> FindingRow:
    """Findings of one code without how sure each is: of a handful of frames without times nobody knows."""
    return replace(row, groups=tuple(replace(group, certainty=None) for group in row.groups))


def left_lines(left: Sequence[Left]) -> Iterator[PageLine]:
    """Exchanges that no cause takes, and what they have in common; nothing where there are none."""
    if left:
        yield ""
        yield page_words("not explained")
    for each in left[:_LEFT]:
        yield Paragraph(left_words(each), first="- ", others="  ")


def left_words(left: Left) -> str:
    """What is left of one unit, or of the bus, in a line."""
    return left.like if left.unit is None else page_words("unit {unit}: {words}", unit=left.unit, words=left.like)


def explained_row(row: FindingRow, causes: Sequence[Cause]) -> FindingRow:
    """Findings of one code with the causes that they follow from."""
    groups = tuple(replace(group, explained_by=_explained_by(row.code, group.unit, causes)) for group in row.groups)
    units: list[int | None] = [*row.units] or [None]
    explaining = dict.fromkeys(_explained_by(row.code, unit, causes) for unit in units)
    return replace(row, groups=groups, explained_by=tuple(cause for cause in explaining if cause is not None))


def _explained_by(code: str, unit: int | None, causes: Sequence[Cause]) -> str | None:
    number = cause_of(code, unit, causes)
    return None if number is None else causes[number].cause


def lines(findings: Sequence[FindingRow], *, handful: bool = False) -> Iterator[PageLine]:
    """Nothing where there are none; of a handful of frames notes are told as well, and nothing is a cost."""
    if not findings:
        return
    head, told = _WORST_AS[handful]
    worst = [row for row in findings if row.severity in told][:_WORST]
    if worst:
        yield ""
        yield page_words(head)
    for number, row in enumerate(worst, 1):
        yield Paragraph(f"{number}. {row.code}, {cost(row)}")
        yield from _group_lines(row)
        yield from _labelled("explained by", ", ".join(row.explained_by))
        yield from _labelled("source", row.clause)
    yield ""
    finding, severity, *figures = map(page_words, ("finding", "severity", "count", "answers lost", "time lost"))
    words = (PageColumn(finding, is_words=True, is_cut=True), PageColumn(severity, is_words=True))
    yield PageTable((*words, *map(PageColumn, figures)), [_finding_cells(row) for row in findings])


def _finding_cells(row: FindingRow) -> tuple[str, ...]:
    lost = grouped(row.lost_answers) if row.lost_answers else "-"
    return row.code, page_words(row.severity), grouped(row.count), lost, seconds(row.lost_ms) if row.lost_ms else "-"


def _group_lines(row: FindingRow) -> Iterator[PageLine]:
    """The groups of a finding, the commonest first: what was seen, of how many, when; cause and remedy once each. What
    a cause explains has the remedy of that."""
    printed: set[str] = set()
    for group in row.groups[:_GROUPS]:
        beside = ", ".join(where(group, row))
        yield Paragraph(f"{group.text} ({beside})" if beside else group.text, first="   ")
        for label, words in (("likely", group.cause), ("do", "" if group.explained_by else group.remedy)):
            if words and words not in printed:
                yield from _labelled(label, words)
                printed.add(words)
    if len(row.groups) > _GROUPS:
        yield f"   {and_more(len(row.groups) - _GROUPS, 'more kind or unit', 'more kinds or units')}"


def where(group: FindingGroup, row: FindingRow) -> Iterator[str]:
    """How many of how many, when, how sure, and where the first one is."""
    if len(row.groups) > 1 or group.of:
        english = "{count:,} of {of:,} requests to unit {unit}"
        yield page_words(english, count=group.count, of=group.of, unit=group.unit) if group.of else often(group.count)
    if is_clock(group.t_ns):
        times = [time_of_day(t)[:8] for t in dict.fromkeys((group.t_ns, group.until_ns))]
        yield page_words(" to ").join(dict.fromkeys(times))
    if group.certainty is not None:
        yield page_words("{share:.0%} sure", share=group.certainty)
    if group.start >= 0:
        yield page_words("first at byte {at:,}" if group.count > 1 else "at byte {at:,}", at=group.start)
        if group.index is not None:
            yield page_words("frame {index:,}", index=group.index)


def often(count: int) -> str:
    """How often: `once`, `5 times`."""
    return page_words("once") if count == 1 else page_words("{count:,} times", count=count)


def cost(row: FindingRow) -> str:
    """How often it was found, what that cost, and which units it met."""
    words = often(row.count)
    if row.lost_answers:
        words += page_words(", {what} lost", what=lost(row.lost_answers, row.lost_ms))
    return words + _among(row)


def lost(answers: int, ms: float | None) -> str:
    """What was lost: `3 answers and 1.2 s`."""
    words = counted(answers, "answer", "answers")
    return page_words("{answers} and {time}", answers=words, time=seconds(ms)) if ms else words


def and_more(count: int, one: str, many: str) -> str:
    """How many of something are left out: `and 1 more hour (--json has all)`."""
    return page_words("and {things} (--json has all)", things=counted(count, one, many))


def _among(row: FindingRow) -> str:
    shares = [f"{unit} ({grouped(count)})" if len(row.units) > 1 else f"{unit}" for unit, count in row.units.items()][
        :_UNITS
    ]
    if not shares:
        return ""
    more = page_words(" and others") if len(row.units) > _UNITS else ""
    units = page_words(": units {shares}" if len(row.units) > 1 else ": unit {shares}", shares=", ".join(shares))
    return units + more


def seconds(ms: float) -> str:
    """A time that was lost."""
    if ms < 1000:
        return f"{decimal(f'{ms:.3g}')} {unit_word('ms')}"
    number = decimal(f"{ms / 1000:.3g}") if ms < 1e6 else grouped(round(ms / 1000))
    return f"{number} {unit_word('s')}"


def _labelled(label: str, words: str) -> list[Paragraph]:
    return [Paragraph(page_words(f"{label}: {{words}}").format(words=words), first="   ")] if words else []
