"""The page: what it says, and that it fits."""

import json
from dataclasses import replace

import pytest
from running import ran

from analyzer.languages import telling
from analyzer.reports.model import Counts, ExceptionRow, FunctionRow, Load, Report, Times, UnitRow
from analyzer.reports.page import text
from analyzer.reports.paragraphs import Paragraph
from analyzer.words import compact, data_size, duration
from captures import samples

MS = 1_000_000
TIMES = Times(380, 2 * MS, 12_345_678, 15 * MS, 20 * MS, 103 * MS)
COUNTS = Counts(400, 380, 8, 7, 2, 3, 5, 1)
REPORT = Report(
    source="bus.jsonl",
    format="serial-chunks",
    baud=19200,
    char_bits=11,
    tap="irq",
    timed=True,
    damage=(),
    damage_count=0,
    partial=False,
    t_start_ns=0,
    t_end_ns=63 * 1000 * MS,
    bytes=12_000,
    frames=780,
    requests=400,
    responses=380,
    damaged_frames=3,
    noise_bytes=17,
    noise_stretches=4,
    doubtful_frames=0,
    transactions=COUNTS,
    times=TIMES,
    load=Load(0.109, 0.37),
    units=(UnitRow(17, COUNTS, TIMES), UnitRow(247, Counts(1, 1), Times())),
    functions=(FunctionRow(3, "Read Holding Registers", COUNTS, TIMES),),
    exceptions=(ExceptionRow(17, 3, 2, "Illegal Data Address", 8),),
)


def test_the_page_has_the_facts():
    page = text(REPORT)
    for fact in (
        "19200 bit/s, 11-bit characters, tap irq",
        "63 s",
        "12,000, 17 of them outside frames (4 stretches)",
        "780: 400 requests, 380 responses; 3 with a wrong check value",
        "400: 380 answered, 8 by exception, 7 unanswered, 3 answered by a",
        "\n          damaged frame, 2 broadcast\n",
        "5 retries, 1 late answer",
        "10.9% of the line's capacity, 37.0% in the busiest second",
        "p50 12.3 ms, p95 15 ms, p99 20 ms, max 103 ms (380 of 391 measured)",
        "8 x unit 17, function 03: 02 Illegal Data Address",
        "03 Read Holding Registers",
    ):
        assert fact in page, fact


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"parity": "E"}, "19200 bit/s, 8E1, tap irq"),
        ({"parity": "E", "stop_bits": 2}, "19200 bit/s, 7E2, tap irq"),
        ({"parity": "N", "char_bits": 10}, "19200 bit/s, 8N1, tap irq"),
        ({"parity": "E", "char_bits": None}, "19200 bit/s, parity E, tap irq"),
        ({"baud": None, "char_bits": None, "tap": None}, "baud not known"),
    ],
)
def test_the_line_is_told_as_far_as_it_is_known(known, said):
    assert f"line      {said}\n" in text(replace(REPORT, **known))


def test_the_page_fits_80_columns_whatever_the_numbers():
    huge = Counts(*(10**12 + i for i in range(8)))
    slow = Times(10**12, 1, 10**17, 10**17, 10**17, 10**18)
    report = replace(
        REPORT,
        bytes=10**15,
        transactions=huge,
        units=(UnitRow(255, huge, slow),),
        functions=(FunctionRow(255, "A function with a very long name indeed", huge, slow),),
    )
    table = [line for line in text(report).splitlines() if line.startswith(("unit", " 255", "function", "255"))]
    assert len(table) == 4
    assert all(len(line) <= 80 for line in text(report).splitlines())


def test_what_the_tap_cannot_tell_is_said_and_not_shown_as_zero():
    page = text(replace(REPORT, times=Times(), load=Load()))
    assert "this tap's timestamps are too coarse" in page
    nothing = replace(REPORT, load=Load())
    for report, needed in (
        (nothing, "a longer capture"),
        (replace(nothing, baud=None), "the line's speed (--baud)"),
        (replace(nothing, char_bits=None), "the character length (--parity, --stop)"),
    ):
        assert f"load      unknown: needs {needed}" in text(report)
    network = text(replace(nothing, baud=None, tcp_frames=REPORT.frames))
    assert "load      unknown: network packets" in network and "speed is not known" not in network
    assert "the line's speed is not known" in " ".join(text(replace(REPORT, baud=None)).split())
    untimed = text(replace(REPORT, timed=False, times=Times(), load=Load(), t_start_ns=None, t_end_ns=None))
    assert untimed.count("no times in this capture") == 3


def test_no_frame_is_said():
    page = text(replace(REPORT, frames=0))
    assert "No Modbus frame was found." in page
    assert "unit " not in page


def test_damage_and_partial_are_said():
    page = text(replace(REPORT, damage=("line 7: not JSON",) * 5, damage_count=12, partial=True))
    assert "damaged   line 7: not JSON" in page
    assert "and 9 more such places" in page
    assert "partial   reading stopped early" in page


def test_many_units_keep_one_page_and_the_troubled_ones():
    units = tuple(UnitRow(n, Counts(10, 10 - n % 2, 0, n % 2), TIMES) for n in range(1, 101))
    page = text(replace(REPORT, units=units))
    assert "and 76 units with less trouble" in page
    shown = [int(line[:4]) for line in page.splitlines() if line[:4].strip().isdigit()]
    assert len(shown) == 24
    assert all(unit % 2 for unit in shown)


def test_a_clock_time_is_shown():
    page = text(replace(REPORT, t_start_ns=1_795_248_000 * 10**9, t_end_ns=1_795_248_060 * 10**9))
    assert "60 s, from 2026-11-21 08:00:00 UTC" in page


def test_the_report_as_json_is_plain():
    line = json.loads(json.dumps(REPORT.to_json()))
    assert line["span_ns"] == 63 * 1000 * MS
    assert line["units"][0]["counts"]["unanswered"] == 7
    assert line["times"]["p95_ns"] == 15 * MS


@pytest.mark.parametrize(
    ("ns", "words"),
    [
        (0, "0 us"),
        (870_400, "870 us"),
        (999_600, "1 ms"),
        (12_345_678, "12.3 ms"),
        (999_600_000, "1 s"),
        (4_200_000_000, "4.2 s"),
        (99_960_000_000, "1 min 40 s"),
        (3_600_000_000_000, "1 h 0 min"),
        (90_000_000_000_000, "1 d 1 h"),
    ],
)
def test_durations(ns, words):
    assert duration(ns) == words


@pytest.mark.parametrize("number", [0, 99_999, 100_000, 12_345_678, 10**9, 10**13, 10**18])
def test_counts_stay_short(number):
    assert len(compact(number)) <= 5


def test_answers_that_never_came_have_no_unknown_time():
    rows = (
        UnitRow(17, COUNTS, TIMES), UnitRow(4, Counts(3, 1, unanswered=2), Times()),
        UnitRow(9, Counts(3, unanswered=3), Times()),
    )  # fmt: skip
    lines = map(str.split, text(replace(REPORT, units=rows)).splitlines())
    by_unit = {words[0]: words[-1] for words in lines if words and words[0] in ("4", "9")}
    assert (by_unit["4"], by_unit["9"]) == ("?", "-")


def test_a_card_has_the_times_of_the_table(capsys):
    report = json.loads(ran(capsys, "report", samples.path("troubled.jsonl"), "--json").out)
    times = {row["unit"]: row["times"] for row in report["units"]}
    assert report["cards"]
    for card in report["cards"]:
        of = times[card["unit"]]
        assert card["delay_ns"] == [of["min_low_ns"], of["p95_ns"] or of["p95_high_ns"]]


def test_thousands_stay_together_in_russian():
    with telling("ru"):
        page = text(replace(REPORT, bytes=12_000, frames=1_234_567))
    assert "байты     12 000, из них" in page and "кадры     1 234 567: 400 запросов" in page
    assert "12,000" not in page
    assert Paragraph("до 12 345 байтов").lines(10) == ["до 12 345", "   байтов"]


def test_sizes_say_something_from_the_first_byte_on():
    assert [data_size(n) for n in (0, 812, 5_230, 999_949, 999_950, 1_200_000, 3_400_000_000)] == [
        "0 B", "812 B", "5.2 kB", "999.9 kB", "1.0 MB", "1.2 MB", "3.4 GB",
    ]  # fmt: skip


def test_what_nobody_weighed_has_no_certainty(capsys, tmp_path):
    path = tmp_path / "other-speed.jsonl"
    head = {"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11}
    chunks = [{"t_ns": n * 120 * MS, "hex": "80f8e67e66fe1e80", "errors": [1, 2]} for n in range(300)]
    path.write_text("\n".join(map(json.dumps, [head, *chunks])))
    page = ran(capsys, "report", path).out
    assert "parity-error" in page and "-100%" not in page
    report = json.loads(ran(capsys, "report", path, "--json").out)
    assert [group["certainty"] for row in report["findings"] for group in row["groups"]] == [None]
