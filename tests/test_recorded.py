"""What a recording notes besides bytes: shown in report, page, JSON and interface, and no unit is blamed for it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from buses import CHAR_NS, LINE, adu
from running import ran

import captures
from analyzer.core import analyse
from analyzer.model.bus import Bus
from analyzer.model.source import CaptureSource
from analyzer.outages import deaf_times, notes_of
from analyzer.tables.findings import described
from analyzer.tui.desk import ViewState
from analyzer.tui.frames import UNHEARD, outcome_beside
from captures import Block, Chunk
from captures.recording.notes import Note, read
from captures.recording.recorder import Recorder

START = 1_700_000_000_000_000_000
SECOND = 1_000_000_000
REQUEST, ANSWER = adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")
LOST, BACK = "/dev/ttyUSB0: lost (Input/output error); waiting for it to come back", "/dev/ttyUSB0: open again"


def recording(folder: Path, notes: list[Note], *, deaf: bool) -> Path:
    """Ten exchanges a second apart; the answers of two are missing."""
    path = folder / "bus.mcap"
    recorder = Recorder(path, LINE, tell=pytest.fail)
    recorder.note(Note(START, "opened", "/dev/ttyUSB0: open"))
    for number in range(10):
        t = START + number * SECOND
        recorder.write(Block.from_chunks([Chunk(t + 8 * CHAR_NS, REQUEST)]))
        if number not in (4, 8):
            recorder.write(Block.from_chunks([Chunk(t + 50_000_000, ANSWER)]))
    for note in notes if deaf else ():
        recorder.note(note)
    recorder.close()
    return path


NOTES = [Note(START + 4 * SECOND + 20_000_000, "lost", LOST), Note(START + 4 * SECOND + 700_000_000, "opened", BACK)]


def missing(path: Path) -> list[int | None]:
    return [
        finding.index
        for analysed in analyse(captures.open(path))
        for finding in described(analysed.findings)
        if finding.code == "no-response"
    ]


def test_no_unit_is_blamed_for_an_answer_that_fell_into_a_gap(tmp_path: Path) -> None:
    path = recording(tmp_path, NOTES, deaf=True)
    assert missing(path) == [15], "the other silence is still the unit's"
    (gap,) = deaf_times(notes_of(captures.open(path)))
    assert (gap.from_ns, gap.to_ns, gap.text) == (NOTES[0].t_ns, NOTES[1].t_ns, LOST)
    bus, source = Bus.of(known := CaptureSource(captures.open(path), "bus.mcap")), known
    for analysed in source.steps(lambda: False):
        bus.feed(analysed)
    bus.close()
    assert bus.found.by_code["no-response"] == 1
    desk = ViewState(source, bus)
    assert [outcome_beside(desk, row).text for row in (8, 15)] == [UNHEARD, "none"]
    assert any("nothing heard for 680 ms" in notice for notice in source.notices())


def test_without_such_a_note_both_silences_are_told(tmp_path: Path) -> None:
    assert missing(recording(tmp_path, NOTES, deaf=False)) == [8, 15]


def test_the_report_says_when_nothing_was_heard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clock = Note(START + 6 * SECOND, "clock", "the computer's clock was changed, or it slept: now +3.000 s")
    path = recording(tmp_path, [*NOTES, clock], deaf=True)
    page = ran(capsys, "report", path).out
    assert "recorded  nothing heard for 680 ms from 2023-11-14 22:13:24 UTC: /dev/ttyUSB0:\n          lost (" in page
    assert "the computer's clock was changed" in page
    assert all(len(line) <= 80 for line in page.splitlines()[1:]), page
    assert "answers missed then are not blamed on any unit" in page
    assert "requests  10: 8 answered, 1 unanswered, 1 not heard\n" in page
    assert "+ 1 not heard: the capture stopped while the answer was due" in page
    report = json.loads(ran(capsys, "report", path, "--json").out)
    assert [note["kind"] for note in report["notes"]] == ["opened", "lost", "opened", "clock"]
    assert (report["transactions"]["unanswered"], report["transactions"]["unheard"]) == (1, 1)
    assert report["deaf"] == [{"from_ns": NOTES[0].t_ns, "to_ns": NOTES[1].t_ns, "text": LOST}]
    ran(capsys, "report", path, "--html", tmp_path / "bus.html")
    html = (tmp_path / "bus.html").read_text(encoding="utf-8")
    assert '<rect class="deaf"' in html
    assert "nothing heard for 680 ms" in html
    assert '<th scope="col">not heard</th>' in html


def test_an_export_keeps_the_notes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, copy = recording(tmp_path, NOTES, deaf=True), tmp_path / "copy.mcap"
    assert ran(capsys, "export", path, "-o", copy).status == 0
    assert read(copy) == read(path) != []
    assert missing(copy) == [15]


def test_a_check_does_not_count_what_was_not_heard(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "check", recording(tmp_path, NOTES, deaf=True), "--rule", "every poll answered")
    assert "8 of 9 polls answered; 1 more while nothing was received" in done.out


def test_a_frame_cut_off_by_the_loss_is_nobodys_fault(tmp_path: Path) -> None:
    def found(folder: Path, notes: list[Note]) -> set[str]:
        folder.mkdir()
        recorder = Recorder(folder / "bus.mcap", LINE, tell=pytest.fail)
        for number in range(10):
            t = START + number * SECOND
            recorder.write(Block.from_chunks([Chunk(t + 8 * CHAR_NS, REQUEST)]))
            recorder.write(Block.from_chunks([Chunk(t + 50_000_000, ANSWER[: 7 if number == 4 else None])]))
        for note in notes:
            recorder.note(note)
        recorder.close()
        analysed = analyse(captures.open(folder / "bus.mcap"))
        return {finding.code for batch in analysed for finding in described(batch.findings)}

    lost = Note(START + 4 * SECOND + 60_000_000, "lost", LOST)
    assert found(tmp_path / "kept", []) - found(tmp_path / "lost", [lost, NOTES[1]]) == {"truncated"}


def test_an_adapter_that_never_comes_back_and_a_full_disk() -> None:
    notes = [Note(1, "opened", "a: open"), Note(2, "gap", "7 bytes were lost"), Note(3, "lost", "a: lost (gone)")]
    times = [(time.from_ns, time.to_ns) for time in deaf_times([*notes, Note(4, "opened", "b: open")])]
    assert times == [(2, 2), (3, None)]


def test_chunks_of_a_file_without_notes_are_not_looked_through_for_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare, noted = tmp_path / "bare.mcap", recording(tmp_path, [], deaf=False)
    captures.write(bare, captures.Capture.of(LINE, [Chunk(START, REQUEST)]))
    monkeypatch.setattr("captures.recording.notes.read_summary", pytest.fail)
    assert read(bare) == []
    monkeypatch.undo()
    assert [note.kind for note in read(noted)] == ["opened"]
