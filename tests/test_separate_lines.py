"""Several lines in one capture: each is read by itself, and no page counts them as one bus unasked."""

import json
from dataclasses import replace

import pytest
from buses import LINE, adu, spaced
from running import ran, refused
from seats import Seat, opened, using

import captures
from analyzer.reports import summarize
from captures import Chunk
from captures.chunks import Capture

_REQUEST, _ANSWER = adu("1103006b0003"), adu("110306000100020003")


def _exchanges(count, port, after_ns=0, gap_ns=6_000_000):
    chunks = spaced([_REQUEST, _ANSWER] * count, gap_ns=gap_ns)
    return [replace(chunk, port=port, t_ns=chunk.t_ns + after_ns) for chunk in chunks]


def _in_time(*lists):
    return sorted((chunk for chunks in lists for chunk in chunks), key=lambda chunk: chunk.t_ns)


def _ports(chunks):
    return summarize(Capture.of(LINE, chunks)).separate_ports


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "two.jsonl"
    captures.write(path, _in_time(_exchanges(40, 0), _exchanges(40, 1, 9_000_000, 17_000_000)), line=LINE)
    return path


def test_lines_beside_each_other_are_told_apart():
    assert _ports(_in_time(_exchanges(40, 0), _exchanges(40, 3, 9_000_000, 17_000_000))) == (0, 3)


def test_two_taps_of_one_line_are_one():
    chunks = spaced([_REQUEST, _ANSWER] * 40)
    assert _ports([replace(chunk, port=i % 2) for i, chunk in enumerate(chunks)]) == ()


def test_a_tap_whose_one_side_hears_both_is_one_line():
    chunks = _exchanges(40, 0)
    copies = [Chunk(chunk.t_ns + 1000, chunk.data, 1) for chunk in chunks[::2]]
    assert _ports(_in_time(chunks, copies)) == ()


def test_connections_that_follow_one_another_are_one_client():
    first = _exchanges(40, 0)
    assert _ports(first + _exchanges(40, 1, first[-1].t_ns)) == ()


def test_one_port_whatever_its_number_is_one_line():
    assert _ports(_exchanges(40, 0)) == _ports(_exchanges(40, 7)) == ()


def test_each_line_has_a_page_of_its_own(capsys, two):
    done = ran(capsys, "report", two)
    assert done.status == 0
    assert done.out.count("port 0, one of 2 separate lines") == done.out.count("port 1, one of 2 separate lines") == 1
    assert "40: 40 answered" in done.out
    assert "late" not in done.out.replace("retry  late", "")


def test_a_page_is_headed_by_what_the_capture_calls_its_port(capsys, tmp_path):
    path = tmp_path / "named.jsonl"
    chunks = _in_time(_exchanges(20, 0), _exchanges(20, 1, 9_000_000, 17_000_000))
    captures.write(path, chunks, line=replace(LINE, notes={"port 1": "boiler \x1b[2J"}))
    page = ran(capsys, "report", path).out
    assert "(--only-port 1): boiler " in page and "\x1b" not in page


def test_all_pages_in_one_form_say_that_there_are_several(capsys, two):
    found = json.loads(ran(capsys, "report", two, "--json").out)
    assert found["separate_ports"] == [0, 1]
    assert found["causes"] == []
    page = two.with_suffix(".html")
    assert ran(capsys, "report", two, "--html", page).status == 0
    assert "2 separate lines" in page.read_text(encoding="utf-8")


def test_one_line_is_chosen(capsys, two):
    found = json.loads(ran(capsys, "report", two, "--only-port", "1", "--json").out)
    assert found["separate_ports"] == []
    assert (found["requests"], found["transactions"]["late"]) == (40, 0)
    assert {chunk.port for chunk in captures.open(two, only_port=1).chunks()} == {1}


def test_what_certifies_one_line_asks_which(capsys, two):
    for command in ("certify", "document"):
        assert "separate lines (ports 0, 1): choose one, such as --only-port 0" in refused(capsys, command, two)
        assert ran(capsys, command, two, "--only-port", "0").status == 0


def test_a_port_that_is_not_there(capsys, two):
    assert "has no port 5; its ports: 0, 1" in refused(capsys, "report", two, "--only-port", "5")
    assert "not a port's number" in refused(capsys, "report", two, "--only-port", "x")


def test_home_says_so_first(two):
    async def work(sitting: Seat) -> None:
        await sitting.press("0")
        await sitting.until(lambda: "2 separate lines read as one: use --only-port 0" in sitting.shown())

    using(opened(two), work)
