"""What a live bus is watched for: told once each time, bookmarked, marked and kept in the recording with what is around
it."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from terminals import posix

import captures
from analyzer.core import Analysed
from analyzer.filters import FilterError
from analyzer.live import Replay, Session
from analyzer.live.conditions import Fired, LiveTrigger
from analyzer.live.session import SessionStep
from captures import samples
from dissectors.crc import crc_bytes

_PATIENCE_S = 30.0


def fired_over(trigger: LiveTrigger) -> list[Fired]:
    """All that triggers over the troubled sample, and a while later."""
    fired = list[Fired]()
    with Session(Replay(captures.open(samples.path("troubled.jsonl")), None)) as session:
        for step in session.steps():
            fired += trigger.feed(step, session.line)
        end = time.monotonic() + _PATIENCE_S
        while not fired and time.monotonic() < end:  # causes are reckoned in a thread
            time.sleep(0.05)
            fired += trigger.feed(SessionStep(step.t_ns, Analysed.nothing()), session.line)
    return fired


def test_what_only_goes_on_is_told_once_and_recorded_all_the_time() -> None:
    hits = list[int]()
    each = fired_over(LiveTrigger("exception", hit=hits.append))
    assert len(each) == len(set(hits)) == 8
    assert all(one.port == 0 and one.start >= 0 and one.text == "exception" for one in each)
    rest_ns, again = 2 * 10**9, list[int]()
    trigger = LiveTrigger("exception", rest_ns=rest_ns, hit=again.append)
    told = fired_over(trigger)
    assert again == hits
    quiet = [b for a, b in zip([-rest_ns, *sorted(set(hits))], sorted(set(hits)), strict=False) if b - a > rest_ns]
    assert [one.t_ns for one in told] == quiet and 1 < trigger.count == len(told) < 8


def test_a_cause_is_waited_for_by_its_name_or_any() -> None:
    any_one = fired_over(LiveTrigger("cause"))
    assert any_one and all(one.start < 0 and one.text for one in any_one)
    silent = fired_over(LiveTrigger("cause all-silent"))
    assert silent and all("silent" in one.text for one in silent)


@pytest.mark.parametrize(
    ("text", "words"), [("cause al-silent", "did you mean all-silent"), ("excepton", "exception"), ("cause a b", "")]
)
def test_what_cannot_be_waited_for_is_told_why(text: str, words: str) -> None:
    with pytest.raises(FilterError) as error:
        LiveTrigger(text)
    assert words in str(error.value)


def _say(line: int, *bodies: bytes) -> None:
    for body in bodies:
        os.write(line, body + crc_bytes(body))
        time.sleep(0.03)


@posix
def test_the_interface_rings_marks_and_records_around_a_trigger(tmp_path: Path) -> None:
    from emulator import Watched
    from livebus import pty

    line, name = pty()
    around = ("--trigger", "unit == 3", "--before", "0.5s", "--after", "0.2s")
    with Watched(
        "sniff", name, "--baud", "19200", "--tui", "-o", "bus.mcap", *around, cwd=tmp_path, columns=140
    ) as terminal:
        terminal.until("trigger unit == 3: 0")
        _say(line, *(bytes([unit, 3, 0, 0, 0, 1]) for unit in (40, 41, 42)))
        terminal.until("3 frames")
        time.sleep(1.0)  # longer ago than what is kept
        _say(line, *(bytes([unit, 3, 0, 0, 0, 1]) for unit in (1, 2, 3, 4)))
        terminal.until("trigger unit == 3: 1").press("2").until('"trigger: unit == 3"')
        assert b"\x07" in terminal.raw
        time.sleep(0.5)
        _say(line, *(bytes([unit, 3, 0, 0, 0, 1]) for unit in (50, 51)))
        terminal.until("9 frames")
        terminal.press("W\x15unit == 51\r").until("trigger unit == 51: 0")
        _say(line, bytes([51, 3, 0, 0, 0, 1]))
        terminal.until("trigger unit == 51: 1").press("W\x15\r").until(lambda: "trigger unit" not in terminal.shown())
        terminal.press("qq", 1.0)
    capture = captures.open(tmp_path / "bus.mcap")
    units = [chunk.data[0] for chunk in capture.chunks()]
    assert {1, 2, 3, 4, 51} <= set(units) and not {40, 41, 42} & set(units)
    marks = [note.text for note in capture.notes() if note.kind == "mark"]
    assert marks == ["trigger: unit == 3", "trigger: unit == 51"]
