"""`rtuscope report` and `demo`."""

import io
import json
import os

import pytest
from buses import CHAR_NS, LINE, adu, spaced
from running import ran, refused

import captures
from analyzer.cli.terminal import page_width
from captures import Chunk

REQUEST = adu("1103006b0003")
ANSWER = bytes.fromhex("110306ae415652434049ad")
EXCEPTION = adu("118302")


def written(tmp_path, chunks, name="bus.jsonl", **settings):
    path = tmp_path / name
    captures.write(path, chunks, line=LINE, **settings)
    return path


@pytest.fixture
def bus(tmp_path):
    frames = [REQUEST, ANSWER] * 6 + [REQUEST, EXCEPTION] + [REQUEST, REQUEST, ANSWER]
    return written(tmp_path, spaced(frames, gap_ns=10_000_000))


def test_the_page(capsys, bus):
    done = ran(capsys, "report", bus)
    assert done.status == 0
    assert done.err == ""
    assert "17: 9 requests, 8 responses" in done.out
    assert "9: 7 answered, 1 by exception, 1 unanswered" in done.out
    assert "1 retry" in done.out
    assert "1 x unit 17, function 03: 02" in done.out
    assert "p50 10 ms" in done.out


def test_the_same_as_json(capsys, bus):
    done = ran(capsys, "report", bus, "--json")
    report = json.loads(done.out)
    assert done.status == 0
    assert (report["frames"], report["requests"], report["responses"], report["bytes"]) == (
        17,
        9,
        8,
        9 * 8 + 7 * 11 + 5,
    )
    assert report["transactions"] == {
        "requests": 9, "answered": 7, "exceptions": 1, "unanswered": 1,
        "broadcasts": 0, "damaged": 0, "retries": 1, "late": 0, "unheard": 0, "echoes": 0,
    }  # fmt: skip
    assert [(row["unit"], row["counts"]["requests"]) for row in report["units"]] == [(17, 9)]
    assert [(row["function"], row["times"]["count"]) for row in report["functions"]] == [(3, 8)]
    assert report["times"]["p50_ns"] == pytest.approx(10_000_000, rel=0.02)
    assert report["load"]["mean"] == pytest.approx(report["bytes"] * CHAR_NS / report["span_ns"], rel=0.01)
    assert report["source"] == str(bus)
    assert report["baud"] == 19200


def test_without_times_it_says_so(capsys, tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("".join(frame.hex(" ") + "\n" for frame in [REQUEST, ANSWER] * 8))
    done = ran(capsys, "report", path)
    assert done.status == 0
    assert done.out.count("no times in this capture") >= 3
    assert json.loads(ran(capsys, "report", path, "--json").out)["times"]["count"] == 0


def test_of_a_handful_of_frames_no_share_nor_empty_table_is_told(capsys, tmp_path):
    """A few exchanges that somebody pasted are no sample of a bus, with times or not; of more all is told."""
    damaged = ANSWER[:4] + bytes((ANSWER[4] ^ 4,)) + ANSWER[5:]
    frames = [REQUEST, ANSWER, REQUEST, damaged, REQUEST, ANSWER]
    path, page = tmp_path / "log.txt", tmp_path / "page.html"
    path.write_text("".join(frame.hex(" ") + "\n" for frame in frames))
    few = ran(capsys, "report", path).out
    assert "bit-flip" in few and "3: 2 answered" in few
    assert "sure" not in few and "p50" not in few and "load" not in few
    groups = [
        group for row in json.loads(ran(capsys, "report", path, "--json").out)["findings"] for group in row["groups"]
    ]
    assert {group["certainty"] for group in groups} == {None}
    path.write_text("".join(frame.hex(" ") + "\n" for frame in frames * 3))
    assert "% sure" in (many := ran(capsys, "report", path).out) and "p50" in many
    lines = [f"12:00:{i:02}.118 {frame.hex(' ')}\n" for i, frame in enumerate(frames * 3)]
    path.write_text("".join(lines))
    assert "% sure" in (timed := ran(capsys, "report", path).out) and "p50" in timed
    path.write_text("".join(lines[: len(frames)]))
    assert "sure" not in (few := ran(capsys, "report", path).out) and "p50" not in few and "min 1 s" in few
    assert ran(capsys, "report", path, "--html", page, "--overwrite").status == 0


def test_no_frame_is_said_with_status_1(capsys, tmp_path):
    path = written(tmp_path, [Chunk(10**9, b"$GPGGA,123519,4807.038,N*47\r\n")])
    done = ran(capsys, "report", path)
    assert done.status == 1
    assert "No Modbus frame was found." in done.out


def test_noise_that_goes_on_is_one_stretch(capsys, tmp_path):
    path = tmp_path / "zeros.bin"
    path.write_bytes(bytes(300_000) + REQUEST + ANSWER + b"\xff\xff\xff" + REQUEST + ANSWER)
    report = json.loads(ran(capsys, "report", path, "--json").out)
    assert (report["frames"], report["noise_bytes"], report["noise_stretches"]) == (4, 300_003, 2)


def test_a_damaged_capture_says_what_was_lost(capsys, bus):
    lines = bus.read_text().splitlines(keepends=True)
    bus.write_text("".join([*lines[:4], "not json\n", *lines[4:]]))
    done = ran(capsys, "report", bus)
    assert done.status == 0
    assert "damaged   line 5" in done.out
    assert json.loads(ran(capsys, "report", bus, "--json").out)["damage_count"] == 1


def test_an_empty_file_is_one_line(capsys, tmp_path):
    path = tmp_path / "empty.jsonl"
    path.touch()
    assert "empty" in refused(capsys, "report", path)


def test_the_demo_reports_on_the_bundled_sample(capsys):
    done = ran(capsys, "demo")
    assert done.status == 0
    assert "requests" in done.out
    assert json.loads(ran(capsys, "demo", "--json").out)["frames"] > 20


def test_a_log_without_times_has_no_response_times(capsys, tmp_path):
    log = tmp_path / "bus.log"
    log.write_text(f"Tx:000001-{REQUEST.hex(' ')}\nRx:000002-{ANSWER.hex(' ')}\n")
    report = json.loads(ran(capsys, "report", log, "--json").out)
    assert (report["timed"], report["transactions"]["answered"], report["times"]["count"]) == (False, 1, 0)
    page = ran(capsys, "report", log).out
    assert "1 request, 1 response" in page
    assert "span      unknown: no times in this capture" in page
    frames = [json.loads(line) for line in ran(capsys, "export", log).out.splitlines()]
    assert [frame["response_time_ns"] for frame in frames] == [None, None]


def test_the_words_of_a_log_are_skipped_not_damage(capsys, tmp_path):
    log = tmp_path / "bus.log"
    log.write_text(f"log started\n{REQUEST.hex(' ')}\n{ANSWER.hex(' ')}\n")
    page = ran(capsys, "report", log).out
    assert "skipped   line 1: no bytes found in 'log started'" in page
    assert "damaged" not in page.split("requests")[0]


class ScreenOfColumns(io.StringIO):
    """A terminal."""

    def isatty(self):
        return True


@pytest.mark.parametrize(("columns", "wide"), [(20, 40), (60, 60), (110, 110), (300, 120)])
def test_paragraphs_are_as_wide_as_the_terminal(monkeypatch, columns, wide):
    assert page_width(80) == 80
    monkeypatch.setattr("sys.stdout", ScreenOfColumns())
    monkeypatch.setattr("shutil.get_terminal_size", lambda: os.terminal_size((columns, 24)))
    assert page_width(80) == wide
