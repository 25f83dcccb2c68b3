"""Pastes in every shape that tools and people write: each frame once, in its role, and nothing else."""

from __future__ import annotations

import random
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from paste_chats import CHATS
from paste_forums import FORUMS
from paste_issues import ISSUES
from paste_posts import POSTS
from paste_readings import bytes_read, frames_read
from paste_shapes import SHAPES
from paste_tools import DECODERS, TOOLS
from paste_writings import WRITINGS
from pastes import STYLES, Message, Style, cluttered, messages, spaced

import captures
from analyzer.paste import judge, read
from captures import CaptureError
from captures.errors import HexError

ALL = {**STYLES, **SHAPES, **FORUMS, **POSTS, **TOOLS, **DECODERS, **ISSUES, **WRITINGS, **CHATS}
TIMED = [
    *("JSON with epoch", "InfluxDB", "count before", "wrapped at 40", "Docklight", "pymodbus 3"),
    *("ticks in brackets", "sigrok packets", "Moxa traffic", "pyserial spy", "BLE log"),
    *(
        "usbmon",
        "comma seconds",
        "quoted seconds",
        "minutes",
        "plus ms",
        "two clocks",
        "list of packets",
        "tshark fields",
        "Zabbix",
        "two clocks far apart",
        "entries, mailed and quoted",
        "milliseconds before a mark",
        "milliseconds in a column",
        "milliseconds before a name",
        "to whom",
        "buffers in a trace",
        "clock hard before bytes",
        "ticks before a port",
        "ticks before a task",
        "packets and their dumps",
        "bus log with a hash",
        "process monitor",
        "frames of a scope",
        "Modbus Slave with times",
        "turns without line breaks",
        "two turns a line",
    ),
]


def made(name: str, style: Style, seed: int) -> tuple[list[Message], str, random.Random]:
    rng = random.Random(f"{name} {seed}")
    log = messages(rng, 2 + seed)
    text = style(log, rng)
    if name.startswith("manual"):  # which explains reads and writes of one value
        log = [message for message in log if message.sent and len(message.data) == 8]
    return log, text, rng


@pytest.mark.parametrize("name", ALL)
def test_frames_are_read_in_every_shape(name: str) -> None:
    for seed in range(2):
        log, text, _ = made(name, ALL[name], seed)
        if not log:
            continue
        assert frames_read(text) == [(message.role, message.data.hex()) for message in log], text


def test_what_is_said_again_in_one_line_is_no_copy_of_itself() -> None:
    asks, answers = "11 03 00 6B 00 03 76 87", "11 03 06 AE 41 56 52 43 40 49 AD"
    exchange = [("request", asks.replace(" ", "").lower()), ("response", answers.replace(" ", "").lower())]
    assert frames_read(f"{asks}, {answers}, {asks}, {answers}") == exchange * 2
    assert frames_read(f"<- {asks} -> {answers} <- {asks}") == [*exchange, exchange[0]]
    assert frames_read(f"read {asks} (buffer {asks.replace(' ', '')})") == exchange[:1]


def test_what_a_program_lists_again_is_there_again() -> None:
    asks = ["01 04 00 01 00 02 20 0B", "01 03 00 00 00 02 C4 0B", "00 04 00 01 00 02 21 DA"]
    rows = [f'    ("Func 04 Reg {i}", 9600, bytes.fromhex("{frame}")),' for i, frame in enumerate(asks)]
    text = "\n".join([*rows, "    # other speeds", f'    ("ID 1 @ 19200", 19200, bytes.fromhex("{asks[0]}")),'])
    assert [data for _, data in frames_read(text)] == [frame.replace(" ", "").lower() for frame in (*asks, asks[0])]


@pytest.mark.parametrize("name", SHAPES)
def test_what_stands_around_is_no_byte(name: str) -> None:
    log, text, _ = made(name, SHAPES[name], 3)
    assert b"".join(piece.adu.data if hasattr(piece, "adu") else piece.data for piece in read(text).pieces) == b"".join(
        message.data for message in log
    ), text


def test_other_lines_between_change_little() -> None:
    """What a board prints between its frames costs not one shape in thirty, of every second."""
    wrong, names = [], [*ALL][::2]
    for name in names:
        log, text, rng = made(name, ALL[name], 1)
        if not log:
            continue
        mixed = cluttered(text, rng, 0.3, len(log))
        if frames_read(mixed) != [(message.role, message.data.hex()) for message in log]:
            wrong.append(name)
    assert 30 * len(wrong) <= len(names), wrong


MARGINS: dict[str, Callable[[str], str]] = {
    "code": lambda text: f"[code]{text}[/code]",
    "breaks": lambda text: text if "<" in text else text.replace("\n", "<br>\n"),
    "question": lambda text: f"It does not answer. Unit 1, 9600 8N1, register 40001.\n\n{text}\n\nAny idea? 73 de Bob",
    "blanks": lambda text: text.replace(" ", "\u00a0").replace("\n", "\u200b\r\n"),
    "answered": lambda text: "\n".join(["> Hello, see below", *(f"> {line}" for line in text.split("\n"))]),
}


@pytest.mark.parametrize("margin", MARGINS)
def test_what_people_put_around_a_log_changes_nothing(margin: str) -> None:
    names = [*ALL][[*MARGINS].index(margin) :: 5]
    wrong = []
    for name in names:
        log, text, _ = made(name, ALL[name], 0)
        if frames_read(MARGINS[margin](text)) != [(message.role, message.data.hex()) for message in log]:
            wrong.append(name)
    assert 30 * len(wrong) <= len(names), wrong


def test_what_two_tools_show_stands_in_one_paste() -> None:
    rng, wrong = random.Random("mixed"), []
    names = [name for name in ALL if not name.startswith("manual")]
    pairs = [
        ("DSView", "JSON lines"),
        ("numpy rows", "Zephyr"),
        *zip(rng.sample(names, 20), rng.sample(names, 20), strict=True),
    ]
    for one, other in pairs:
        log, text, _ = made(one, ALL[one], 0)
        more, below, _ = made(other, ALL[other], 0)
        wanted = [(message.role, message.data.hex()) for message in [*log, *more]]
        if frames_read(f"{text}\n\nAnd this is what the other tool shows:\n{below}") != wanted:
            wrong.append((one, other))
    assert 30 * len(wrong) <= len(pairs), wrong


@pytest.mark.parametrize("name", TIMED)
def test_times_of_a_log_are_used(name: str, tmp_path: Path) -> None:
    log, text, _ = made(name, ALL[name], 3)
    path = tmp_path / "log.txt"
    path.write_text(text, encoding="utf-8")
    times = {chunk.t_ns for chunk in captures.open(path, judge=judge).chunks()}
    assert len(times) == len(log)


@pytest.mark.parametrize("suffix", [".txt", ".csv"])
@pytest.mark.parametrize("name", DECODERS)
def test_a_decoders_table_gives_each_byte_its_time(name: str, suffix: str, tmp_path: Path) -> None:
    log, text, _ = made(name, DECODERS[name], 3)
    path = tmp_path / f"table{suffix}"
    path.write_text(text, encoding="utf-8")
    chunks = list(captures.open(path, judge=judge).chunks())
    assert b"".join(chunk.data for chunk in chunks) == b"".join(message.data for message in log)
    starts = [chunks[sum(len(m.data) for m in log[:i])].t_ns for i in range(len(log))]
    pauses = [(later - earlier) / 1e6 for earlier, later in pairwise(starts)]
    assert pauses == pytest.approx([b.ms - a.ms for a, b in pairwise(log)], abs=2)


def test_one_damaged_frame_is_read_as_those_around_it() -> None:
    """In one shape of thirty at most its bytes are not all there, or those of others suffer; of every second."""
    wrong, names = [], [*ALL][1::2]
    for name in names:
        rng = random.Random(f"{name} damaged")
        log = messages(rng, 4)
        if name.startswith("manual"):
            continue
        broken = log[3].data[:-1] + bytes((log[3].data[-1] ^ 0x40,))
        log[3] = Message(broken, log[3].sent, log[3].ms)
        if bytes_read(ALL[name](log, rng)) != b"".join(message.data for message in log):
            wrong.append(name)
    assert 30 * len(wrong) <= len(names), wrong


def damaged(message: Message) -> Message:
    return Message(message.data[:-1] + bytes((message.data[-1] ^ 0x40,)), message.sent, message.ms)


@pytest.mark.parametrize(("name", "share"), [("request right", 35), ("nothing right", 15), ("no check values", 12)])
def test_where_little_is_right_the_bytes_are_read(name: str, share: int) -> None:
    """A request and a damaged answer; all damaged; none with its CRC: not one shape in `share` loses its bytes.

    Every second shape, others for all damaged.
    """
    wrong, shapes = [], [shape for shape in ALL if not shape.startswith("manual")][name == "nothing right" :: 2]
    for shape in shapes:
        rng = random.Random(f"{shape} survey")
        log = messages(rng, 2)
        if name == "request right":
            log = [log[0], damaged(log[1])]
        elif name == "nothing right":
            log = [damaged(message) for message in log]
        else:
            log = [Message(message.data[:-2], message.sent, message.ms) for message in log]
        if bytes_read(ALL[shape](log, rng)) != b"".join(message.data for message in log):
            wrong.append(shape)
    assert share * len(wrong) <= len(shapes), wrong


def test_a_log_written_newest_first_is_read_from_its_end(tmp_path: Path) -> None:
    log = messages(random.Random(5), 4)
    path = tmp_path / "log.txt"
    path.write_text("\n".join(f"{m.clock} {spaced(m.data)}" for m in reversed(log)), encoding="utf-8")
    capture = captures.open(path, judge=judge)
    assert [chunk.data for chunk in capture.chunks()] == [message.data for message in log]
    times = [chunk.t_ns // 10**6 for chunk in captures.open(path, judge=judge).chunks()]
    assert [later - earlier for earlier, later in pairwise(times)] == [b.ms - a.ms for a, b in pairwise(log)]


@pytest.mark.parametrize("text", ["hello", "refused by 192.168.1.105:502", "temperature 3.14", "{'a': 1}"])
def test_where_no_bytes_are_one_short_line_says_what_they_look_like(text: str, tmp_path: Path) -> None:
    with pytest.raises(HexError, match=r"^no hex bytes found.*: paste bytes such as 11 03 00 6B .*show them$"):
        read(text)
    path = tmp_path / "log.txt"
    path.write_text(f"{text}\n", encoding="utf-8")
    with pytest.raises(CaptureError, match=r"no hex bytes found, such as .*; line 1: "):
        captures.open(path)
