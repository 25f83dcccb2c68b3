"""Times of lines as people and tools write them: each frame at its own, and none of their digits a byte."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import pytest
from pastes import Message, messages, spaced, word

import captures
from analyzer.paste import judge

FORMS = [
    "Time:{clock} {way}: {data}",
    "时间：{clock} {east}：{data}",
    "{clock}{east}：{data}",
    "{clock}{way}->{data}",
    "{clock}{way}:{data}",
    "DEBUG:root:{clock}:{way}:{data}",
    "{dashes} {way} {data}",
    "2026-11-21_{dashes} {way} {data}",
    "20261121 {plain} {way} {data}",
    "20261121T{plain} {way} {data}",
    "{dots} {way} {data}",
    "{whole} {ms:03d} мс {way} {data}",
    "{whole} ({ms:03d}) {way} {data}",
    "{whole}:{ms:03d}.250 {way} {data}",
    "{clock}.250 {way} {data}",
    "0d 0h {minutes}m {seconds:06.3f}s {way} {data}",
    "Pkt(3): 000:{clock} {way}:({data})",
    "[{ticks:9d}] {way} {data}",
    "({ticks}) {way} {data}",
    "t={ticks} {way} {data}",
    "t={elapsed:.3f}s dir={way} data={data}",
    "- t: {elapsed:.3f}\n  dir: {way}\n  data: {data}",
    "time={elapsed:.3f} dir={way} data={data}",
    "{ticks} [main] DEBUG net.Transport - {way}: {data}",
    "{epoch!r} {way} {data}",
    "> {epoch:.6f} {data}",
    "('{way}', {epoch!r}, '{data}')",
    "datetime.datetime(2026, 11, 21, 10, {minutes}, {second}, {ms}000) {way} {data}",
]
TABLES = [
    ("ms,dir,data", "{ticks},{way},{data}"),
    ("t,dir,data", "{elapsed:.3f},{way},{data}"),
    ("elapsed [s];dir;data", "{elapsed:.3f};{way};{data}"),
]


def written(form: str, message: Message) -> str:
    minutes, seconds = divmod(message.ms / 1000, 60)
    return form.format(
        clock=message.clock,
        whole=message.clock[:8],
        dashes=message.clock.replace(":", "-"),
        dots=message.clock.replace(".", ",").replace(":", "."),
        plain=message.clock.replace(":", ""),
        ms=message.ms % 1000,
        ticks=message.ms,
        elapsed=message.ms / 1000,
        epoch=1_795_255_200 + message.ms / 1000,
        minutes=int(minutes),
        seconds=seconds,
        second=int(seconds),
        way=word(message, "TX", "RX"),
        east=word(message, "发送", "接收"),
        data=spaced(message.data),
    )


@pytest.mark.parametrize(("head", "form"), [*(("", form) for form in FORMS), *TABLES])
def test_times_are_those_of_the_lines(tmp_path: Path, head: str, form: str) -> None:
    log = messages(random.Random(form), 4)
    path = tmp_path / "log.txt"
    path.write_text("\n".join([*([head] if head else []), *(written(form, m) for m in log)]), encoding="utf-8")
    chunks = list(captures.open(path, judge=judge).chunks())
    assert [chunk.data for chunk in chunks] == [message.data for message in log]
    steps = [later.t_ns - earlier.t_ns for earlier, later in pairwise(chunks)]
    assert steps == pytest.approx([10**6 * (later.ms - earlier.ms) for earlier, later in pairwise(log)], abs=1000)


@pytest.mark.parametrize(
    "line", ["01:02:03:04:05:06", "AA:10:11:12:13:14", "1:10:11:12 TX", "10.11.12 RX", "0103-10-11"]
)
def test_other_numbers_are_no_times(tmp_path: Path, line: str) -> None:
    path = tmp_path / "log.txt"
    path.write_text(f"{line}\n01 03 00 00 00 01 84 0A\n", encoding="utf-8")
    assert not captures.open(path, judge=judge).timed


def test_names_of_columns_are_no_bytes(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Time,Dir,D0,D1,D2,D3,D4,D5,D6,D7\n0.5,T,1,3,0,0,0,1,132,10\n", encoding="utf-8")
    assert [chunk.data for chunk in captures.open(path, judge=judge).chunks()] == [bytes((1, 3, 0, 0, 0, 1, 132, 10))]
