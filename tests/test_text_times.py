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
    "{way} t={elapsed:.3f}s {data}",
    "{way} {data}  elapsed={ticks}ms",
    "T+{elapsed:.3f} {way} {data}",
    "{points} {way} {data}",
    "{hundreds:.2f} {way} {data}",
    "{way} @ {epoch_ms}: {data}",
    "{way};{epoch_ms};{data}",
    "{ticks} мс: {way} {data}",
    "{ticks}.250 ms: {way} {data}",
    "#{ticks:08d} {way} {data}",
    "{ticks}> {way} {data}",
    "{whole}-{ms:03d} {way} {data}",
    "20261121{packed} {way} {data}",
    "Timestamp (ms) : {ticks}\nBytes : 8\n{way}: [{data}]\n",
    "timestamp_ms: {ticks} {way} {data}",
    "{hour} ч {minute:02d} мин {second:02d},{ms:03d} с: {way} {data}",
    "{hour}时{minute:02d}分{second:02d}秒{ms:03d}毫秒 {east} {data}",
    "21 ноября 2026 г., {clock} {way} {data}",
    "21. November 2026 um {clock} {way} {data}",
    "{number};{elapsed:.6f};{data}",
    "{days:.10f};{way};{data}",
    '{{"ts":"2026-11-21T{clock}Z","dir":"{way}","data":"{data}"}}',
    '{{"t":{ticks},"dir":"{way}","data":"{data}"}}',
    "{ticks};{out};{data}",
]
TABLES = [
    ("ms,dir,data", "{ticks},{way},{data}"),
    ("t,dir,data", "{elapsed:.3f},{way},{data}"),
    ("elapsed [s];dir;data", "{elapsed:.3f};{way};{data}"),
    ("Time/ms;Dir;Data", "{ticks}.250;{way};{data}"),
    ("Метка времени, мс;Напр.;Данные", "{thousands},250;{way};{data}"),
    ("No,Time since start [usec],Dir,Data", "{number},{ticks}000,{way},{data}"),
    ("Zeit in ms;Richtung;Daten", "{ticks},5;{way};{data}"),
    ("Дата и время;Напр.;Данные", "{days:.10f};{way};{data}"),
    ("Time;Dir;Data", "{day:.10f};{way};{data}"),
]


def written(form: str, message: Message) -> str:
    minutes, seconds = divmod(message.ms / 1000, 60)
    day = (36_000_000 + message.ms) / 86_400_000
    return form.format(
        clock=message.clock,
        whole=message.clock[:8],
        dashes=message.clock.replace(":", "-"),
        points=message.clock.replace(":", "."),
        packed=message.clock.replace(":", "").replace(".", ""),
        hour=message.clock[:2],
        minute=int(minutes) % 60,
        thousands=f"{message.ms:,}".replace(",", "\u00a0"),
        number=message.ms % 90,
        days=46_347 + day,
        day=day,
        hundreds=message.ms / 100,
        epoch_ms=1_795_255_200_000 + message.ms,
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
        out=word(message, "out", "in"),
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
    unit = 10**7 if "{hundreds" in form else 10**6
    near = 100_000 if "{day" in form else 1000
    assert steps == pytest.approx([unit * (later.ms - earlier.ms) for earlier, later in pairwise(log)], abs=near)


@pytest.mark.parametrize(
    "line", ["{way} {data} time={took}ms", "10.20.30.{took} {way} {data}", "{took}.5 {way} {data}"]
)
def test_numbers_that_do_not_rise_are_no_times(tmp_path: Path, line: str) -> None:
    rows = [
        line.format(way=word(m, "TX", "RX"), data=spaced(m.data), took=100 + 7 * (i * i % 5))
        for i, m in enumerate(messages(random.Random(1), 4))
    ]
    path = tmp_path / "log.txt"
    path.write_text("\n".join(rows), encoding="utf-8")
    assert not captures.open(path, judge=judge).timed


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
