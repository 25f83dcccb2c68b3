"""Tables of the text page: nothing is lost that there is room for, and no line is longer than the page."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from analyzer.reports.tabular import PageColumn, PageTable

_words = st.text(st.sampled_from("abc ж漢[]\\:"), min_size=1, max_size=30).map(str.strip).filter(bool)


@given(st.lists(st.tuples(_words, _words, _words), min_size=1, max_size=6), st.integers(10, 120))
def test_rows_are_as_wide_as_the_page_at_most(rows: list[tuple[str, str, str]], width: int) -> None:
    columns = PageColumn("name", is_words=True, is_cut=True), PageColumn("p95", spare=1), PageColumn("max", spare=2)
    names = [cell_len(name) for name, *_ in rows]
    lines = PageTable(columns, rows).lines(width)
    assert len(lines) == len(rows) + 1
    assert all(cell_len(line) <= max(width, min(max(names), 10)) for line in lines)
    shown = [head in lines[0].split() for head in ("p95", "max")]
    assert shown in ([True, True], [True, False], [False, False])
    if max(names) <= min(width, 24):
        assert all(line.startswith(name) for line, (name, *_) in zip(lines[1:], rows, strict=True))


def test_figures_stand_below_their_head() -> None:
    columns = PageColumn("unit"), PageColumn("what", is_words=True), PageColumn("count")
    assert PageTable(columns, [("1", "read", "12"), ("17", "x", "1,024")], indent=1).lines(80) == [
        " unit  what  count",
        "    1  read     12",
        "   17  x     1,024",
    ]
