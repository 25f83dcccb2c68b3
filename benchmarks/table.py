"""Markdown tables that read well as plain text too."""

from __future__ import annotations

from collections.abc import Sequence


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
