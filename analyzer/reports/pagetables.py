"""The tables of the text report, as wide as the page: what does not fit is in the JSON.

And the words for the values of a bus, which the HTML page shares.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Final

from dissectors.values import harmless

from ..languages import grouped, page_words, phrase
from ..registers.telling import place_cell
from ..requests.asked import span_words
from ..words import between, compact, decimal, duration, is_clock, time_of_day, unit_word
from .findings import and_more
from .model import BookmarkRow, Counts, HourRow, PollRow, Report, Times, UnitCard, UnitChange, UnitRow
from .paragraphs import PageLine, Paragraph
from .tabular import PageColumn, PageTable

if TYPE_CHECKING:
    from ..registers.watch import WatchedValue

_ROWS: Final = 24  # units on the page; --json has all
_CARDS: Final = 6
_POLLS: Final = 12
_HOURS: Final = 72
_LAST: Final = 22  # characters of a value
_NO_ADDRESS: Final = 0xFFFF  # of a request that names none, as `causes.exchanges` has it
_EXCEPTIONS: Final = 10
_BOOKMARKS: Final = 50
_LONG_NS: Final = 99_950_000_000
_ASKED: Final = (("requests", "requests"), ("ok", "answered"), ("exc", "exceptions"))  # head, name in `Counts`
_REPEATED: Final = (("retry", "retries"), ("late", "late"))
_UNIT_COLUMNS: Final = (*_ASKED, ("silent", "unanswered"), ("garbage", "damaged"), *_REPEATED)
_FUNCTION_COLUMNS: Final = (*_ASKED, ("none", "unanswered"), ("bad", "damaged"))
_SPARE: Final = {"p50": 1, "p95": 3, "max": 2}  # figures of response times: which stay longest


def tables(report: Report) -> Iterator[Iterator[PageLine]]:
    """Those that this report fills, in their order."""
    if report.units and not report.is_handful:
        yield _units(report)
        yield _functions(report)
        yield _legend(report)
    cards = [card for card in report.cards if card.unit not in report.scanned]
    if any(map(_badly, cards)) and not report.is_handful:
        yield _cards(cards)
    if any(row.period_ns is not None for row in report.polls):
        yield _polls(report.polls)
    if report.hours:
        yield _hours(report.hours)
    if report.exceptions:
        yield _exceptions(report)
    if report.bookmarks:
        yield _bookmarks(report.bookmarks)


def _legend(report: Report) -> Iterator[str]:
    if report.cards:
        yield page_words("requests: ok + exc (exceptions) + silent (not a byte) + garbage + broadcasts;")
        yield page_words("of functions none (no answer, with bytes or without) + bad (a damaged one)")
    else:
        yield page_words("requests: ok + exc (exceptions) + none (no answer) + bad (damaged) + broadcasts")
    if count := report.transactions.unheard:
        unheard = page_words("{count:,} not heard: the capture stopped while the answer was due", count=count)
        yield f"{'':10}+ {unheard}"


def _units(report: Report) -> Iterator[PageLine]:
    scanned = report.scanned
    shown: Sequence[UnitRow] = [row for row in report.units_as_heard if row.unit not in scanned]
    left = max(len(shown) - _ROWS, 0)
    if left:
        shown = sorted(sorted(shown, key=_trouble)[:_ROWS], key=lambda row: row.unit)
    columns = (*_FUNCTION_COLUMNS, *_REPEATED) if not report.cards else _UNIT_COLUMNS
    rows = [(str(row.unit), row.counts, row.times) for row in shown]
    yield _counted(PageColumn(page_words("unit")), columns, ("p50", "p95", "max"), rows)
    if left:
        yield and_more(left, "unit with less trouble", "units with less trouble")
    if scanned:
        units = ", ".join(_runs(sorted(scanned)))
        yield Paragraph(
            page_words("asked once or twice, and silent: {count} units ({units})", count=len(scanned), units=units)
        )


def _runs(numbers: Sequence[int]) -> Iterator[str]:
    """Numbers in order, those that follow one another as `2..4`."""
    for _, run in groupby(enumerate(numbers), key=lambda item: item[1] - item[0]):
        together = [number for _, number in run]
        yield span_words(together[0], together[-1] + 1)


def _trouble(row: UnitRow) -> tuple[int, int]:
    counts = row.counts
    return -(counts.unanswered + counts.exceptions + counts.damaged + counts.late), row.unit


def _functions(report: Report) -> Iterator[PageLine]:
    rows = [(f"{row.function:02d} {row.name}", row.counts, row.times) for row in report.functions]
    name = PageColumn(page_words("function"), is_words=True, is_cut=True)
    yield _counted(name, _FUNCTION_COLUMNS, ("p50", "p95"), rows)


def _counted(
    name: PageColumn,
    columns: Sequence[tuple[str, str]],
    figures: Sequence[str],
    rows: Sequence[tuple[str, Counts, Times]],
) -> PageTable:
    """Counts, and figures of response times as many as there is room for."""
    heads = [PageColumn(page_words(head)) for head, _ in columns]
    heads += [PageColumn(figure, spare=_SPARE[figure]) for figure in figures]
    cells = [
        (own, *(_number(getattr(counts, key)) for _, key in columns), *(_cell(counts, times, one) for one in figures))
        for own, counts, times in rows
    ]
    return PageTable((name, *heads), cells)


def _number(count: int) -> str:
    return compact(count) if count else "-"


def _exceptions(report: Report) -> Iterator[str]:
    yield page_words("exceptions")
    for row in report.exceptions[:_EXCEPTIONS]:
        asked = page_words("unit {unit}, function {function:02d}", unit=row.unit, function=row.function)
        name = phrase("{name}", name=row.name)
        yield f"{grouped(row.count):>9} x {asked}: {row.exception:02X} {name}"
    if len(report.exceptions) > _EXCEPTIONS:
        yield f"{'':>9}   {and_more(len(report.exceptions) - _EXCEPTIONS, 'other kind', 'other kinds')}"


def _cell(counts: Counts, times: Times, figure: str) -> str:
    """A figure; a dash where no whole answer came whose time could be known."""
    if counts.answers == counts.damaged:
        return "-"
    low, high = times.bounds(figure) or (0, 0)
    return f"{decimal(f'{low / 1e9:.3g}')} {unit_word('s')}" if low == high >= _LONG_NS else times.worded(figure)


def _cards(cards: Sequence[UnitCard]) -> Iterator[PageLine]:
    yield page_words("units with bad answers")
    for card in troubled(cards, _CARDS):
        outcomes = ", ".join(outcome_words(card))
        yield Paragraph(f"{page_words('unit {unit}', unit=card.unit)}: {outcomes}")
        yield from (Paragraph(change_words(change), first="   ") for change in card.changes)
    left = sum(_badly(card) > 0 for card in cards) - _CARDS
    if left > 0:
        yield and_more(left, "more unit", "more units")


def _badly(card: UnitCard) -> int:
    """How many of its requests did not get one good answer in time."""
    return card.silent + card.garbage + card.late + card.doubles


def troubled(cards: Sequence[UnitCard], most: int) -> list[UnitCard]:
    """Units with bad answers, the worst of them, by number."""
    worst = sorted((card for card in cards if _badly(card)), key=lambda card: -_badly(card))[:most]
    return sorted(worst, key=lambda card: card.unit)


def change_words(change: UnitChange) -> str:
    """When something about a unit was otherwise, and how."""
    when = page_words("for a while")
    if is_clock(change.t_ns):
        when = f"{_clock(change.t_ns)}{page_words(' to ')}{_clock(change.until_ns)}"
    return f"{when}: {change.text}"


def outcome_words(card: UnitCard, *, damage: bool = True) -> Iterator[str]:
    """What became of a unit's requests, where its answers are damaged, and how long they take."""
    yield page_words("{number:,} asked", number=card.asked)
    for number, words in (
        (card.answered, "{number:,} answered"),
        (card.exceptions, "{number:,} by exception"),
        (card.silent, "{number:,} silent"),
    ):
        if number:
            yield page_words(words, number=number)
    if card.garbage:
        garbage = page_words("{number:,} garbage", number=card.garbage)
        regions = ", ".join(f"{page_words(region)} {grouped(count)}" for region, count in card.damage.items() if count)
        yield f"{garbage} {page_words('(damaged: {regions})', regions=regions)}" if regions and damage else garbage
    for number, words in ((card.late, "{number:,} late"), (card.doubles, "{number:,} answered twice")):
        if number:
            yield page_words(words, number=number)
    if card.delay_ns is not None:
        yield page_words("p95 {time}", time=between(*card.delay_ns))


def _clock(t_ns: int) -> str:
    return time_of_day(t_ns)[:8]


def _polls(polls: Sequence[PollRow]) -> Iterator[PageLine]:
    heads = ("poll", "asked", "ok", "wasted", "period", "jitter", "joins with")
    poll, *figures, joins = map(page_words, heads)
    columns = (
        PageColumn(poll, is_words=True),
        *map(PageColumn, figures),
        PageColumn(joins, is_words=True, is_cut=True),
    )
    yield PageTable(columns, [_poll_cells(row) for row in polls[:_POLLS]])
    if len(polls) > _POLLS:
        yield and_more(len(polls) - _POLLS, "poll that comes less often", "polls that come less often")


def _poll_cells(row: PollRow) -> tuple[str, ...]:
    return (
        f"{page_words('unit {unit}', unit=row.unit)} {poll_words(row)}",
        compact(row.asked),
        _share_of(row),
        _number(row.wasted),
        "?" if row.period_ns is None else duration(row.period_ns),
        "?" if row.jitter_ns is None else duration(row.jitter_ns),
        "" if row.joins is None else f"{row.joins}, -{row.saves_bytes} {unit_word('B')}",
    )


def _share_of(row: PollRow) -> str:
    """How many of its requests got a good answer; of broadcasts no answer is waited for."""
    return decimal(f"{row.ok / row.asked:.0%}") if row.ok + row.wasted else "-"


def poll_words(row: PollRow) -> str:
    """Function and addresses of a poll: `03 107..109`, `06 12`, `07`."""
    if row.address == _NO_ADDRESS and not row.quantity:
        return f"{row.function:02d}"
    alone = row.function in (5, 6, 22) or row.quantity <= 1
    return f"{row.function:02d} {row.address}" + ("" if alone else f"..{row.address + row.quantity - 1}")


def _hours(hours: Sequence[HourRow]) -> Iterator[PageLine]:
    heads = ("hour", "requests", "ok", "exc", "none", "bad", "late", "load", "most often")
    hour, *figures, often = map(page_words, heads)
    columns = (
        PageColumn(hour, is_words=True),
        *map(PageColumn, figures),
        PageColumn(often, is_words=True, is_cut=True),
    )
    yield PageTable(columns, [_hour_cells(row) for row in hours[:_HOURS]])
    if len(hours) > _HOURS:
        yield and_more(len(hours) - _HOURS, "more hour", "more hours")


def _hour_cells(row: HourRow) -> tuple[str, ...]:
    counts = row.counts
    numbers = (counts.requests, counts.answered, counts.exceptions, counts.unanswered, counts.damaged, counts.late)
    load = "?" if row.load is None else decimal(f"{row.load:.1%}")
    return (row.name, *map(_number, numbers), load, row.finding)


def _bookmarks(rows: Sequence[BookmarkRow]) -> Iterator[PageLine]:
    yield page_words("bookmarks")
    for row in rows[:_BOOKMARKS]:
        subject = page_words("noise")
        if row.index >= 0:
            subject = page_words("frame {index:,}", index=row.index) + ", "
            subject += page_words("unit {unit}, function {function:02d}", unit=row.unit, function=row.function)
        when = f"{_clock(row.t_ns)}, " if is_clock(row.t_ns) else ""
        place = page_words("byte {at:,}", at=row.start)
        words = f"{when}{place}, {subject}" + (f": {harmless(row.comment)}" if row.comment else "")
        yield Paragraph(words, first="   ", others="      ")
    if len(rows) > _BOOKMARKS:
        yield f"   {and_more(len(rows) - _BOOKMARKS, 'more bookmark', 'more bookmarks')}"


_VALUE_ROWS: Final = 60  # on the page; --json has all


def value_lines(values: Sequence[WatchedValue]) -> Iterator[PageLine]:
    """A table of the values, nothing where there are none."""
    if not values:
        return
    yield ""
    shown = values[:_VALUE_ROWS]
    heads = map(page_words, ("unit", "value", "last", "min", "mean", "max", "outside limits"))
    unit, name, last, *figures, outside = heads
    columns = (
        PageColumn(unit),
        PageColumn(name, is_words=True, is_cut=True),
        PageColumn(last, is_words=True),
        *map(PageColumn, figures),
    )
    limited = any(value.outside for value in shown)
    yield PageTable(
        (*columns, PageColumn(outside)) if limited else columns,
        [_value_cells(value)[: len(columns) + limited] for value in shown],
    )
    if len(values) > _VALUE_ROWS:
        yield and_more(len(values) - _VALUE_ROWS, "more value", "more values")


def _value_cells(value: WatchedValue) -> tuple[str, ...]:
    outside = f"{grouped(value.outside)} / {grouped(value.readings)}" if value.outside else "-"
    numbers = map(short_number, (value.minimum, value.mean, value.maximum))
    return (str(value.unit), label(value), cut(value.last, _LAST), *numbers, outside)


def label(value: WatchedValue) -> str:
    """The name by a map; else where it stands, and as what it is read."""
    return value.name or f"{place_cell(value.area, value.address)} {value.type}"


def short_number(number: float | None) -> str:
    """A number in at most seven characters."""
    if number is None:
        return ""
    text = f"{number:.5g}"
    return text if len(text) <= 7 else f"{number:.2g}" if len(f"{number:.2g}") <= 7 else f"{number:.0e}"


def cut(text: str, width: int) -> str:
    """A text in so many columns."""
    return text if len(text) <= width else f"{text[: width - 2]}.."
