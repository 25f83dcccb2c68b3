"""One report against an earlier one of the same bus: what is new, what is gone, what is worse and what is better.

Rates are compared, not counts, for two captures are seldom of one length; a difference must be larger than chance makes
it, and one of response times larger than the intervals in which they lie.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import Final, Literal

from ..languages import counted, page_words
from .findings import and_more
from .model import Counts, Report, Times
from .paragraphs import PageLine, Paragraph

Change = Literal["new", "gone", "worse", "better"]
_ORDER: Final = ("new", "worse", "better", "gone")
_SIGMAS: Final = 3.5
_TWICE: Final = 1.5  # times: that a rate must change by
_SLOWER: Final = 1.25
_LEAST: Final = 20  # requests, that a rate means something
_FEW: Final = 3  # of what is new or gone
_SHOWN: Final = 12


@dataclass(frozen=True, slots=True)
class Difference:
    """One thing that is otherwise than before: what it is about (`cause`, `finding`, `unit`, `poll`, `response`,
    `load`), its name, the units meant, and a sentence with the numbers of both."""

    change: Change
    about: str
    name: str
    units: tuple[int, ...]
    text: str


def differences(now: Report, before: Report) -> tuple[Difference, ...]:
    """What changed from one report to another, the new and worse first."""
    changes = [*_causes(now, before), *_units(now, before), *_answers(now, before), *_times(now, before),
             *_finding_differences(now, before), *_polls(now, before), *_load(now, before)]  # fmt: skip
    return tuple(sorted(changes, key=lambda each: _ORDER.index(each.change)))


def _causes(now: Report, before: Report) -> Iterator[Difference]:
    old = {(cause.cause, cause.units[:1]): cause for cause in before.causes}
    new = {(cause.cause, cause.units[:1]): cause for cause in now.causes}
    for key, cause in new.items():
        if key not in old:
            yield Difference("new", "cause", cause.cause, cause.units, cause.text)
    for key, cause in old.items():
        if key not in new:
            text = page_words("{text} (before; no longer)", text=cause.text)
            yield Difference("gone", "cause", cause.cause, cause.units, text)


def _units(now: Report, before: Report) -> Iterator[Difference]:
    old, new = ({row.unit: row.counts for row in report.units} for report in (before, now))
    for unit in sorted(new.keys() - old.keys()):
        if new[unit].requests >= _FEW:
            words = "unit {unit} is asked now ({requests}) and was not before"
            text = page_words(words, unit=unit, requests=_requests(new[unit].requests))
            yield Difference("new", "unit", str(unit), (unit,), text)
    for unit in sorted(old.keys() - new.keys()):
        if old[unit].requests >= _FEW:
            words = "unit {unit} was asked before ({requests}) and is not now"
            text = page_words(words, unit=unit, requests=_requests(old[unit].requests))
            yield Difference("gone", "unit", str(unit), (unit,), text)


def _answers(now: Report, before: Report) -> Iterator[Difference]:
    """Units by the share of requests that stay without a good answer."""
    old = {row.unit: row.counts for row in before.units}
    for row in now.units:
        if row.unit not in old:
            continue
        (bad, requests), (bad_then, requests_then) = _bad(row.counts), _bad(old[row.unit])
        change = _changed(bad, requests, bad_then, requests_then)
        if change is not None:
            text = page_words(
                "unit {unit}: {bad:,} of {requests:,} requests without a good answer, was {bad_then:,} of "
                "{then:,}",
                unit=row.unit, bad=bad, requests=requests, bad_then=bad_then, then=requests_then,
            )  # fmt: skip
            yield Difference(change, "unit", str(row.unit), (row.unit,), text)


def _bad(counts: Counts) -> tuple[int, int]:
    requests = counts.requests - counts.broadcasts - counts.unheard
    return counts.unanswered + counts.damaged + counts.exceptions, requests


def _changed(hits: int, trials: int, hits_then: int, trials_then: int) -> Change | None:
    """Whether a rate changed by more than chance, and by much."""
    if min(trials, trials_then) < _LEAST:
        return None
    rate, then = hits / trials, hits_then / trials_then
    both = (hits + hits_then + 1) / (trials + trials_then + 2)
    sigma = sqrt(both * (1 - both) * (1 / trials + 1 / trials_then))
    if abs(rate - then) < _SIGMAS * sigma or max(rate, then) < _TWICE * min(rate, then):
        return None
    return "worse" if rate > then else "better"


def _times(now: Report, before: Report) -> Iterator[Difference]:
    old = {row.unit: row.times for row in before.units}
    for row in now.units:
        if row.unit not in old:
            continue
        for figure in ("p50", "p95"):
            change = _slower(row.times, old[row.unit], figure)
            if change is not None:
                text = page_words(
                    "unit {unit} answers after {now} ({figure}), was {then}",
                    unit=row.unit, now=row.times.worded(figure), figure=figure, then=old[row.unit].worded(figure),
                )  # fmt: skip
                yield Difference(change, "response", str(row.unit), (row.unit,), text)
                break


def _slower(now: Times, before: Times, figure: str) -> Change | None:
    one, two = now.bounds(figure), before.bounds(figure)
    if one is None or two is None or min(now.count, before.count) < _LEAST:
        return None
    if one[0] > _SLOWER * two[1]:
        return "worse"
    return "better" if two[0] > _SLOWER * one[1] else None


def _finding_differences(now: Report, before: Report) -> Iterator[Difference]:
    old, new = ({row.code: row for row in report.findings if row.severity != "note"} for report in (before, now))
    requests, requests_then = max(now.transactions.requests, 1), max(before.transactions.requests, 1)
    for code in sorted(new.keys() | old.keys()):
        count, then = (rows[code].count if code in rows else 0 for rows in (new, old))
        units = tuple((new if code in new else old)[code].units)
        text = page_words(
            "{code}: {count:,} in {requests:,} requests, before {then:,} in {requests_then:,}",
            code=code, count=count, requests=requests, then=then, requests_then=requests_then,
        )  # fmt: skip
        change = _changed(min(count, requests), requests, min(then, requests_then), requests_then)
        if not then and count >= _FEW:
            yield Difference("new", "finding", code, units, text)
        elif not count and then >= _FEW and change == "better":
            yield Difference("gone", "finding", code, units, text)
        elif then and count and change is not None:
            yield Difference(change, "finding", code, units, text)


def _polls(now: Report, before: Report) -> Iterator[Difference]:
    if not (now.polls and before.polls):
        return
    old, new = (_lists(report) for report in (before, now))
    lists: tuple[tuple[Change, Mapping[tuple[int, ...], int], Mapping[tuple[int, ...], int], str], ...] = (
        ("new", new, old, "is polled now and was not before"),
        ("gone", old, new, "was polled before and is not now"),
    )
    for change, present, absent, words in lists:
        for key in sorted(present.keys() - absent.keys()):
            unit, function, address, quantity = key
            name = page_words("unit {unit}, function {function:02d}", unit=unit, function=function)
            name += f", {address}..{address + quantity - 1}"
            text = f"{name} {page_words(words)} ({_requests(present[key])})"
            yield Difference(change, "poll", name, (unit,), text)


def _lists(report: Report) -> dict[tuple[int, ...], int]:
    rows = [row for row in report.polls if row.function in (1, 2, 3, 4) and row.asked >= _FEW]
    return {(row.unit, row.function, row.address, row.quantity): row.asked for row in rows}


def _load(now: Report, before: Report) -> Iterator[Difference]:
    if now.load.mean is None or before.load.mean is None:
        return
    if max(now.load.mean, before.load.mean) >= _TWICE * min(now.load.mean, before.load.mean) + 0.01:
        change: Change = "worse" if now.load.mean > before.load.mean else "better"
        text = page_words(
            "load {now:.1%} of the line's capacity, was {then:.1%}", now=now.load.mean, then=before.load.mean
        )
        yield Difference(change, "load", "load", (), text)


def lines(changes: tuple[Difference, ...], before: str) -> Iterator[PageLine]:
    """For the text page."""
    yield Paragraph(page_words("against {name}").format(name=before), others="")
    if not changes:
        yield page_words("nothing is significantly new, gone, worse or better")
    for change in _ORDER:
        mine = [each for each in changes if each.change == change]
        for each in mine[:_SHOWN]:
            words = (
                f"{page_words(change)}: {each.name}: {each.text}"
                if each.about == "cause"
                else f"{page_words(change)}: {each.text}"
            )
            yield Paragraph(words)
        if len(mine) > _SHOWN:
            yield f"{page_words(change)}: {and_more(len(mine) - _SHOWN, 'more difference', 'more differences')}"


def _requests(count: int) -> str:
    return counted(count, "request", "requests")
