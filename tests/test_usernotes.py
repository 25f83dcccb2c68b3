"""Notes of two windows on one capture: what either adds stays."""

from __future__ import annotations

from pathlib import Path

import pytest

import captures
from analyzer.usernotes import Notes


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    path = tmp_path / "bus.jsonl"
    path.write_text("")
    return path


def test_notes_of_two_windows_stay(capture: Path) -> None:
    one, other = Notes.beside(capture), Notes.beside(capture)
    one.toggle((0, 29))
    other.comment((0, 50), "pump")
    one.choose_type((1, 3, 7), "float32")
    other.refer((0, 29))
    one.toggle((0, 71))
    kept = Notes.beside(capture)
    assert kept.comments == one.comments == {(0, 29): "", (0, 50): "pump", (0, 71): ""}
    assert (kept.reference, kept.types) == ((0, 29), {(1, 3, 7): "float32"})


def test_what_either_takes_away_is_gone_and_a_change_of_both_is_the_newest(capture: Path) -> None:
    one = Notes.beside(capture)
    one.comment((0, 1), "first")
    one.toggle((0, 2))
    other = Notes.beside(capture)
    one.toggle((0, 2))
    other.comment((0, 1), "second")
    assert Notes.beside(capture).comments == {(0, 1): "second"}
    one.comment((0, 1), "third")
    assert Notes.beside(capture).comments == {(0, 1): "third"}
    assert one.undo() == (0, 1)


def test_a_file_of_notes_that_is_another_s_now_is_not_overwritten(capture: Path) -> None:
    one = Notes.beside(capture)
    one.toggle((0, 1))
    file = capture.with_name("bus.jsonl.rtuscope.json")
    file.write_text("mine")
    with pytest.raises(captures.CaptureError, match="left unchanged"):
        one.toggle((0, 2))
    assert file.read_text() == "mine"
    file.unlink()
    one.toggle((0, 3))
    assert Notes.beside(capture).comments == {(0, 1): "", (0, 2): "", (0, 3): ""}
