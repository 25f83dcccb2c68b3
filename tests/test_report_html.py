"""The report as an HTML page: the text report's facts, nothing from elsewhere, nothing that a device could inject."""

import html
import re
import shutil
import subprocess
from dataclasses import replace

import pytest
from buses import CHAR_NS, LINE, adu, spaced
from hypothesis import given
from hypothesis import strategies as st
from running import ran, refused

import captures
from analyzer.reports import summarize
from analyzer.reports.breakdown import HourTable
from analyzer.reports.html import Sights, page
from analyzer.reports.html.charts import TroubleBins
from analyzer.reports.page import facts
from analyzer.tables.findings import NOTHING
from analyzer.tables.schema import Rows
from captures import Capture, samples

SECOND = 1_000_000_000


def made(capture, source=""):
    sights = Sights()
    report = summarize(capture, source=source, watch=sights.feed)
    return report, page(report, sights)


def test_it_says_what_the_text_report_says():
    report, made_page = made(captures.open(samples.path("troubled.jsonl")), "bus")
    words = html.unescape(made_page)
    for _, fact in facts(report):
        assert fact in words
    for row in report.findings:
        assert row.code in words
        assert row.text in words
    for row in report.findings[:3]:
        assert row.cause in words
        assert row.remedy in words
    for row in report.functions:
        assert row.name in words
    assert words.count("<svg") == 2
    assert "<mark>22</mark>" in words  # the flipped byte of the first bit-flip


@pytest.mark.parametrize("name", samples.names())
def test_nothing_comes_from_elsewhere(name):
    _, made_page = made(captures.open(samples.path(name)), name)
    for reference in ("http", "src=", "<script", "<link", "url(", "@import"):
        assert reference not in made_page, reference
    within = set(re.findall(r'href="([^"]*)"', made_page))
    assert within <= {f"#{name}" for name in re.findall(r'id="([^"]*)"', made_page)}
    assert made_page.count("href") == len(re.findall(r'href="#', made_page))


def test_what_files_and_devices_say_stays_text():
    evil = b"<script>alert(1)</script>\x1b[31m"
    answer = adu((b"\x11\x2b\x0e\x01\x01\x00\x00\x01\x00" + bytes([len(evil)]) + evil).hex())
    slow = bytearray(answer)
    slow[-3] ^= 1  # a damaged frame is shown as an example
    chunks = spaced([adu("112b0e0100"), answer, adu("112b0e0100"), bytes(slow)] * 3, gap_ns=10_000_000)
    report, made_page = made(Capture.of(LINE, chunks), "<script>\u202e")
    assert report.findings
    assert "alert(1)" in made_page
    assert "<script" not in made_page
    assert "\x1b" not in made_page
    assert "\u202e" not in made_page


def test_a_capture_without_anything():
    report, made_page = made(Capture.of(LINE, []))
    assert not report.frames
    assert "No Modbus frame was found." in made_page
    assert "<svg" not in made_page


def test_a_capture_without_times_draws_none(capsys, tmp_path):
    log = tmp_path / "log.txt"
    log.write_text("".join(frame.hex(" ") + "\n" for frame in [adu("1103006b0003"), adu("110306ae4156524340")] * 3))
    assert ran(capsys, "report", log, "--html", tmp_path / "p.html").status == 0
    assert "<svg" not in (tmp_path / "p.html").read_text(encoding="utf-8")


def test_the_command_writes_a_file_and_never_over_the_capture(capsys, tmp_path):
    bus = tmp_path / "bus.jsonl"
    shutil.copy(samples.path("troubled.jsonl"), bus)
    before = bus.read_bytes()
    assert "is the capture being read" in refused(capsys, "report", bus, "--html", bus)
    assert bus.read_bytes() == before
    done = ran(capsys, "report", bus, "--html", tmp_path / "page.html")
    assert (done.status, done.out, done.err) == (0, "", "")
    assert (tmp_path / "page.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert "no folder" in refused(capsys, "report", bus, "--html", tmp_path / "none" / "page.html")


@given(
    st.lists(st.tuples(st.integers(0, 3600 * SECOND), st.integers(1, 256)), min_size=1, max_size=30), st.integers(1, 5)
)
def test_the_timeline_loses_no_byte_however_long_it_grows(frames, batch):
    timeline, at, rows = TroubleBins(), 0, Rows.zeros(len(frames))
    for row, (silence, length) in enumerate(frames):
        rows.t_start_ns[row], rows.length[row] = at + silence, length
        at = rows.t_end_ns[row] = at + silence + length * CHAR_NS
    for first in range(0, len(rows), batch):
        timeline.add(rows[first : first + batch], NOTHING)
    assert timeline.octets.sum() == pytest.approx(rows.length.sum())
    assert at - int(rows.t_start_ns[0]) <= len(timeline.octets) * timeline.width_ns


def test_a_browser_draws_it(tmp_path):
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("no chromium on this machine")
    _, made_page = made(captures.open(samples.path("troubled.jsonl")), "bus")
    (tmp_path / "p.html").write_text(made_page, encoding="utf-8")
    picture = tmp_path / "p.png"
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    command += ["--window-size=1000,1400", f"--screenshot={picture}", (tmp_path / "p.html").as_uri()]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    assert picture.stat().st_size > 20_000  # a blank page of this size has 7 kB


def test_cards_polls_and_hours_say_what_the_report_says():
    capture = captures.open(samples.path("troubled.jsonl"))
    sights, hours = Sights(), HourTable(capture.line)

    def watch(analysed):
        sights.feed(analysed)
        hours.feed(analysed)

    report = replace(summarize(capture, source="/a/b/bus.jsonl", watch=watch), hours=hours.rows())
    shown = page(report, sights)
    assert "/a/b" not in shown and "bus.jsonl" in shown
    for card in report.cards:
        assert f"unit {card.unit} <span" in shown
        assert f'title="{card.silent:,} silent"' in shown
    assert shown.count('<th scope="row">') >= len(report.polls) + len(report.hours) + len(report.units)
    assert "2026-11-21 08:00" in shown
    assert "03 107..109" in shown and "43 65535" not in shown
    assert f"{report.transactions.requests:,}" in shown
    assert 'href="#bit-flip"' in shown and 'id="bit-flip"' in shown


def test_no_two_examples_are_alike():
    _, made_page = made(captures.open(samples.path("troubled.jsonl")), "bus")
    said = re.findall(r'<p class="said">unit 2 refuses ([^<]*)', made_page)
    assert len(said) == len(set(said)) == 1
