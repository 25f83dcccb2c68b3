"""Times that take a second look: fractions without leading zeros, a time in a line of its own, a kernel's brackets."""

from __future__ import annotations

from itertools import accumulate, pairwise
from pathlib import Path

import pytest
from buses import adu

import captures
from analyzer.paste import judge

REQUEST, ANSWER = adu("2B0300A0 0002"), adu("2B0304 00CE 1DFA")
STEPS_MS = [0, 41, 957, 6, 44, 350, 30, 561, 12, 999, 60]  # from one read to the next
US = 1000


def opened(folder: Path, stamps: list[str]) -> captures.Capture:
    path = folder / "log.txt"
    lines = [f"{s} {'RX' if i % 2 else 'TX'} {(ANSWER if i % 2 else REQUEST).hex(' ')}" for i, s in enumerate(stamps)]
    path.write_text("\n".join(lines), encoding="utf-8")
    return captures.open(path, judge=judge)


def steps(capture: captures.Capture) -> list[int]:
    """From one read to the next, in us."""
    times = [chunk.t_ns // US for chunk in capture.chunks()]
    return [later - earlier for earlier, later in pairwise(times)]


def clocks(step_us: list[int], unit_us: int, form: str) -> list[str]:
    stamps = []
    for us in accumulate(step_us, initial=5 * US):
        seconds, rest = divmod(us, 10**6)
        stamps.append(form.format(m=seconds // 60, s=seconds % 60, t=1_700_000_000 + seconds, f=rest // unit_us))
    return stamps


@pytest.mark.parametrize("form", ["12:{m:02}:{s:02}.{f}", "2026-11-21 12:{m:02}:{s:02}.{f}", "[12:{m:02}:{s:02}.{f}]"])
def test_milliseconds_without_leading_zeros(tmp_path: Path, form: str) -> None:
    wanted = [step * US for step in STEPS_MS]
    capture = opened(tmp_path, clocks(wanted, US, form))
    assert steps(capture) == wanted
    assert "fractions of a second are read as milliseconds without leading zeros" in " ".join(capture.notices)
    assert not capture.damage


@pytest.mark.parametrize("form", ["12:{m:02}:{s:02}.{f}", "{t}.{f}"])
def test_microseconds_without_leading_zeros(tmp_path: Path, form: str) -> None:
    wanted = [41_512, 951_007, 70_100, 999_999, 12_345, 48_010]
    capture = opened(tmp_path, clocks(wanted, 1, form))
    assert steps(capture) == wanted
    assert "read as microseconds without leading zeros" in " ".join(capture.notices)


def test_decimals_without_trailing_zeros_are_decimals(tmp_path: Path) -> None:
    capture = opened(tmp_path, ["12:00:01.05", "12:00:01.1", "12:00:01.143", "12:00:01.5", "12:00:02.04", "12:00:02.2"])
    assert steps(capture) == [50_000, 43_000, 357_000, 540_000, 160_000]
    assert not any("leading zeros" in notice for notice in capture.notices)


@pytest.mark.parametrize(
    "stamps",
    [
        ["12:00:01.500", "12:00:01.480", "12:00:01.600"],  # two readers: a little out of order
        ["12:00:01.5", "12:00:01.143", "12:00:01.25", "12:00:01.05"],  # out of order in either reading
        ["12:00:03.5", "12:00:02.143", "12:00:01.25"],  # newest first
    ],
)
def test_where_the_order_does_not_tell_they_are_decimals(tmp_path: Path, stamps: list[str]) -> None:
    assert not any("leading zeros" in notice for notice in opened(tmp_path, stamps).notices)


@pytest.mark.parametrize(
    "form",
    [
        '- time: 2026-11-21T10:00:0{i}.120Z\n  {mark}: "{data}"',
        "10:00:0{i}.120 poll of unit 43\n{mark} {data}",
        "kern: [1234{i}.120000] rs485: {mark} {data}",
        "host kernel: [    {i}.120000] ttyS1 {mark} {data}",
    ],
)
def test_the_time_of_a_read_stands_above_it_or_in_brackets(tmp_path: Path, form: str) -> None:
    reads = [("tx", REQUEST), ("rx", ANSWER)] * 2
    path = tmp_path / "log.txt"
    path.write_text("\n".join(form.format(i=i, mark=m, data=d.hex(" ")) for i, (m, d) in enumerate(reads)))
    capture = captures.open(path, judge=judge)
    assert steps(capture) == [10**6] * 3
    assert not any("no time" in damage.what for damage in capture.damage)


@pytest.mark.parametrize("form", ["[+{:.3f}]", "+{:.6f}s ", "(+{:.3f})"])
def test_steps_are_added_up_where_as_times_they_would_run_back(tmp_path: Path, form: str) -> None:
    capture = opened(tmp_path, [form.format(ms / 1000) for ms in STEPS_MS])
    assert steps(capture) == [1000 * ms for ms in STEPS_MS[1:]]
    assert "times with a plus are read as steps" in " ".join(capture.notices)
    rising = opened(tmp_path, [form.format(ms / 1000) for ms in accumulate(STEPS_MS)])
    assert steps(rising) == [1000 * ms for ms in STEPS_MS[1:]], "since some start"
    assert not any("plus" in notice for notice in rising.notices)


def test_steps_may_stand_behind_the_text(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    reads = zip([REQUEST, ANSWER] * len(STEPS_MS), STEPS_MS, strict=False)
    path.write_text("".join(f"link {{ data: <Buffer {data.hex(' ')}>, unit: 1 }} +{ms}ms\n" for data, ms in reads))
    assert steps(captures.open(path)) == [1000 * ms for ms in STEPS_MS[1:]]


def test_numbers_before_marks_are_milliseconds_unless_they_count_lines(tmp_path: Path) -> None:
    capture = opened(tmp_path, [f"{1023 + ms}:" for ms in accumulate(STEPS_MS)])
    assert steps(capture) == [1000 * ms for ms in STEPS_MS[1:]]
    assert "milliseconds" in " ".join(capture.notices)
    for numbered in (range(7, 18), range(100, 122, 2)):
        lines = opened(tmp_path, [f"{number}:" for number in numbered])
        assert not lines.timed
