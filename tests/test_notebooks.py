"""Notebooks: what is shown of a capture is HTML of harmless text, pictures hold what the tables hold, docs/ runs."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from buses import adu

import analyzer
from analyzer.analysis import Analysis
from analyzer.causes.registry import Cause
from analyzer.exports.sink import ExportError
from analyzer.html_text import html_table, html_text
from analyzer.tables.findings import Finding, Severity
from captures import samples
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebook.ipynb"
HOSTILE = "<script>alert(1)</script>\x1b[2J\"'&\u202e"
drawn = pytest.mark.skipif(importlib.util.find_spec("matplotlib") is None, reason="matplotlib draws, and is not here")


@pytest.fixture(autouse=True)
def no_windows(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")


@pytest.fixture
def bus() -> Analysis:
    return analyzer.open(samples.path("troubled.jsonl"))


class Tags(HTMLParser):
    """The tags of a text, which all have to be closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.seen: set[str] = set()
        self.text = ""
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        assert all(name == "style" for name, _ in attrs)
        self.seen.add(tag)
        self._open.append(tag)

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        self.text += data


KNOWN = {"div", "b", "p", "table", "thead", "tbody", "tr", "th", "td"}


def test_everything_has_html(bus):
    frame = next(bus.frames())
    finding = next(bus.findings())
    (cause, *_) = bus.causes()
    for shown, words in (
        (bus, "troubled.jsonl"),
        (bus.frames(), "the first 20; there are more"),
        (frame, "starting_address"),
        (bus.findings(), finding.code),
        (finding, finding.text),
        (bus.causes(), cause.remedy),
        (cause, cause.deciding_test),
        (bus.records("transactions"), "response_time_low_ns"),
        (bus.filter("unit == 17").findings(), "finding"),
    ):
        tags = Tags(shown._repr_html_())
        assert tags.seen <= KNOWN
        assert words in tags.text


def test_what_is_shown_is_not_taken_from_who_iterates(bus):
    frames = bus.frames()
    assert next(frames).index == 0
    assert frames._repr_html_() == frames._repr_html_()
    assert [frame.index for frame in frames] == list(range(1, 1 + len([*bus.frames()]) - 1))


def test_what_a_prompt_shows_is_read_by_people(bus):
    assert repr(bus.frames()) == "<to iterate over: frame, t_start_ns, direction, unit, summary, findings>"
    frame = next(bus.frames())
    assert (
        repr(frame) == "<frame 0, request, unit 1: read 3 holding registers from 107 (40108): 01 03 00 6b 00 03 74 17>"
    )


def test_a_table_that_is_none_is_named(bus):
    for ask in (bus.records, bus.columns, bus.to_arrow):
        with pytest.raises(ExportError, match="no table 'polls'; besides frames, available: transactions, values"):
            ask("polls")


def test_a_capture_with_nothing_in_it_is_shown():
    empty = Analysis(Capture.of(LineSettings(), []))
    assert Tags(empty._repr_html_()).seen <= KNOWN
    assert "none" in empty.causes()._repr_html_()


def test_foreign_text_is_only_text():
    for text in (html_text(HOSTILE), html_table([HOSTILE], [[HOSTILE]])):
        assert "<script" not in text
        assert "\x1b" not in text and "\u202e" not in text
        assert Tags(text).seen <= KNOWN
    finding = Finding(HOSTILE, Severity.ERROR, HOSTILE, HOSTILE, HOSTILE, HOSTILE, {}, None, -1, 0, 0, 0)
    cause = Cause(
        HOSTILE,
        HOSTILE,
        (1,),
        HOSTILE,
        HOSTILE,
        HOSTILE,
        None,
        None,
        None,
        0.5,
        HOSTILE,
        HOSTILE,
        HOSTILE,
        1,
        1.0,
        (),
        1.0,
    )
    for each in (finding, cause):
        assert Tags(each._repr_html_()).seen <= KNOWN


def test_a_device_that_answers_with_markup_is_shown_as_what_it_sent():
    answer = adu("112b0e01010000010020" + b"<script>alert(1)</script>\x1b[2J\xff&quot;".ljust(32).hex())
    chunks = [Chunk(1_000_000_000, adu("112b0e0100")), Chunk(1_020_000_000, answer)]
    line = LineSettings(tap=HOSTILE, notes={HOSTILE: HOSTILE})
    bus = Analysis(Capture.of(line, chunks))
    frames = [*bus.frames()]
    assert [frame.direction for frame in frames] == ["request", "response"]
    shown = Tags(frames[1]._repr_html_())
    assert shown.seen <= KNOWN
    assert "<script>alert(1)</script>\\x1b[2J" in shown.text
    assert Tags(bus._repr_html_()).seen <= KNOWN


@drawn
def test_the_timeline_has_every_request(bus):
    ax = bus.plot.timeline()
    counts = {
        words[0]: int(words[1]) for line in ax.get_lines() for words in [re.findall(r"\w+", str(line.get_label()))]
    }
    records = [*bus.records("transactions")]
    assert counts == {s: sum(r["status"] == s for r in records) for s in {r["status"] for r in records}}
    lanes = [tick.get_text() for tick in ax.get_yticklabels()]
    assert lanes == [f"unit {unit}" for unit in sorted({record["unit"] for record in records})]


@drawn
def test_response_times_are_drawn_as_what_is_known_of_them(bus):
    ax = bus.plot.response_times()
    records = [r for r in bus.records("transactions") if r["response"] is not None]
    known = [r for r in records if r["response_time_high_ns"] is not None or r["response_time_ns"] is not None]
    labels = {str(line.get_label()): line for line in ax.get_lines()}
    for unit in {r["unit"] for r in known}:
        own = [r["response_time_ns"] or r["response_time_high_ns"] for r in known if r["unit"] == unit]
        line = labels[f"unit {unit} ({len(own)})"]
        assert [round(x * 1e6) for x in line.get_xdata()] == sorted(own)
        assert line.get_ydata()[-1] == 1.0
    if missing := len(records) - len(known):
        assert f"of {missing}" in ax.get_title()


@drawn
def test_a_register_is_drawn_with_what_was_read_of_it(bus):
    records = [r for r in bus.records("values") if (r["unit"], r["area"], r["address"]) == (1, "holding", 107)]
    ax = bus.plot.register(1, 107)
    (line,) = ax.get_lines()
    assert list(line.get_ydata()) == [r["raw"] for r in records]
    assert ax.get_title() == "unit 1: holding 107"
    with pytest.raises(ValueError, match="nothing is known of holding 9 of unit 200"):
        bus.plot.register(200, 9)
    with pytest.raises(ValueError, match="no area 'coils'"):
        bus.plot.register(1, 1, area="coils")


@drawn
def test_a_map_gives_a_register_its_name_and_measure(bus, tmp_path):
    table = tmp_path / "map.csv"
    table.write_text("area,address,name,type,scale,unit\nholding,107,$Voltage$,uint16,0.1,V\n")
    ax = bus.with_maps(f"{table}@1").plot.register(1, 107)
    assert ax.get_title() == r"unit 1: \$Voltage\$"
    assert ax.get_ylabel() == "V"
    raw = [r["raw"] for r in bus.records("values") if (r["unit"], r["address"]) == (1, 107)]
    (line,) = ax.get_lines()
    assert list(line.get_ydata()) == pytest.approx([value / 10 for value in raw])
    ax.figure.canvas.draw()


@drawn
def test_a_capture_without_times_is_not_drawn_along_them(tmp_path):
    pasted = tmp_path / "bytes.txt"
    pasted.write_text("11 03 00 6B 00 03 76 87\n11 03 06 AE 41 56 52 43 40 49 AD\n")
    untimed = analyzer.open(pasted)
    for draw in (untimed.plot.timeline, lambda: untimed.plot.register(17, 107)):
        with pytest.raises(ValueError, match="no times"):
            draw()
    assert "of 1 answers this tap cannot tell them" in untimed.plot.response_times().get_title()


def cells() -> list[dict[str, Any]]:
    return [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


@drawn
def test_the_notebook_of_the_documentation_runs_and_shows_what_it_holds():
    names: dict[str, Any] = {}
    assert cells()
    for cell in cells():
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, str(NOTEBOOK), "exec"), names)
        if not isinstance(last, ast.Expr):
            continue
        value = eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), names)
        for output in cell["outputs"]:
            if "text/html" in output.get("data", {}):
                assert "".join(output["data"]["text/html"]) == value._repr_html_()
