"""The figures of one run as Markdown, in tables that read well as plain text too."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from measuring import Result
from own import SECTIONS

if TYPE_CHECKING:
    from compare import Comparison


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    """Cells padded to their column; the first `words` columns to the left, figures to the right."""
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    rule = ["-" * width if i < words else "-" * (width - 1) + ":" for i, width in enumerate(widths)]
    lines = [heads, rule, *rows]
    return "\n".join("| " + " | ".join(_padded(line, widths, words)) + " |" for line in lines)


def _padded(cells: Sequence[str], widths: Sequence[int], words: int) -> list[str]:
    return [
        cell.ljust(width) if i < words else cell.rjust(width)
        for i, (cell, width) in enumerate(zip(cells, widths, strict=True))
    ]


def figure(value: float | None) -> str:
    """Three significant digits, as people write them; a dash for nothing."""
    if value is None:
        return "-"
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"


def share(value: float | None) -> str:
    """A share in percent: 100% only where it is."""
    if value is None:
        return "-"
    text = f"{100 * value:.2f}%"
    return "100%" if value == 1 else "99.99%" if text == "100.00%" else text


_ENOUGH = 50_000  # frames
_MARKS = {True: "reached", False: "missed", None: "-"}
_METHOD = (
    "CPU is user and system time of the whole process a million frames, the least of {rounds}; start-up (the same job "
    "on {few} frames) is left out of it and shown beside it. All jobs ran in turn on the same frames, each in a "
    "process of its own. Peers get frames already split; only rtuscope reads the bytes of a tap."
)


def markdown(found: Comparison) -> str:
    """All tables, with what they mean below them."""
    return "\n\n".join(_parts(found)) + "\n"


def _parts(found: Comparison) -> Iterator[str]:
    about, corpus = found.machine, found.corpus
    yield f"Measured {about['date']} on {about['processor']}, {about['system']}, Python {about['python']}."
    yield (
        f"Corpus `{corpus['bus']}`: {corpus['frames']:,} frames of {corpus['bytes_per_frame']} bytes, seed "
        f"{corpus['seed']}; {corpus['requests_repeated']:.0%} of requests and {corpus['responses_repeated']:.0%} of "
        "responses repeat an earlier frame."
    )
    yield _jobs(found)
    if found.results:
        rounds = f"{found.rounds} rounds" if found.rounds > 1 else "1 round"
        yield _METHOD.format(rounds=rounds, few=found.results[0].few)
    if failed := [f"{r.job.section}, {r.job.tool}: {r.failed}" for r in found.results if r.failed]:
        yield "Failed: " + "; ".join(failed) + "."
    if found.absent:
        yield "Not here: " + "; ".join(f"{name} ({why})" for name, why in found.absent.items()) + "."
    if found.accuracy:
        yield _accuracy(found)
    if found.hard:
        clean = found.hard["clean bus"]
        rows = [[name, f"{cost:.3f}", f"{cost / clean:.1f}"] for name, cost in found.hard.items()]
        yield table(("bytes", "CPU us a byte", "times a clean byte"), rows)
    if found.grown:
        rows = [
            [one.tool, f"{one.frames:,}", figure(one.per_million), figure(one.wall), f"{one.peak:.0f}"]
            for one in found.grown
        ]
        yield table(("growth", "frames", "CPU s a million", "wall s", "peak MiB"), rows)
    if corpus["frames"] < _ENOUGH:
        yield f"So few frames show that everything runs, and nothing of speed: goals need {_ENOUGH:,}."
    elif found.accuracy:
        rows = [[goal.what, goal.wanted, goal.found, _MARKS[goal.reached]] for goal in found.goals]
        yield table(("goal", "wanted", "found", ""), rows, words=4)
    yield f"Versions: {about['versions']}."


def _jobs(found: Comparison) -> str:
    rows: list[list[str]] = []
    ours: dict[str, Result] = {}
    order = list(SECTIONS)
    results = sorted(found.results, key=lambda result: order.index(result.job.section))
    for before, result in pairwise([None, *results]):
        assert result is not None
        section = result.job.section
        if before is None or before.job.section != section:
            rows.append([f"**{SECTIONS[section]}**", *[""] * 6])
            if not result.failed:
                ours[section] = result
        rows.append(_row(result, ours.get(section)))
    return table(("job", "frames", "CPU s a million", "to ours", "wall s", "peak MiB", "start-up s"), rows)


def _row(result: Result, own: Result | None) -> list[str]:
    name = result.job.tool
    if result.failed:
        return [name, "failed", *["-"] * 5]
    used, start = result.used, result.start
    ratio = result.per_million / own.per_million if own is not None and own.per_million > 0 else None
    return [
        name,
        f"{result.frames:,}",
        figure(result.per_million),
        figure(ratio),
        figure(used.wall),
        f"{used.peak:.0f}",
        figure(start.cpu),
    ]


def _accuracy(found: Comparison) -> str:
    rows = [
        [one.tool, *(share(figures.get(key)) for key in ("frames", "direction", "pairs"))]
        for one, figures in found.accuracy
    ]
    how = {one.how: one.tool.split(",")[0] for one, _ in reversed(found.accuracy)}
    notes = [f"{tool}: {words}." for words, tool in reversed(how.items())]
    return table(("right", "frames", "direction", "pairs"), rows) + "\n\n" + "\n".join(f"- {note}" for note in notes)
