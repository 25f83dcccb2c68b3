"""The front door: what the first thing that a person types gets, on a terminal and on pipes."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest
from livebus import busy_port
from running import ran, refused, spawned
from terminals import Terminal, posix

from analyzer.cli.door import asked
from analyzer.cli.synonyms import OPTIONS, VERBS
from captures import samples

REQUEST = "11 03 00 6B 00 03 76 87"


@pytest.fixture(autouse=True)
def bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    shutil.copy(samples.path("healthy.jsonl"), tmp_path / "bus.jsonl")
    return tmp_path / "bus.jsonl"


@pytest.mark.parametrize(
    ("typed", "command"),
    [
        (["bus.jsonl"], ["report", "bus.jsonl"]),
        (["bus.jsonl", "--json"], ["report", "bus.jsonl", "--json"]),
        (["-r", "bus.jsonl"], ["report", "bus.jsonl"]),
        (["read", "bus.jsonl"], ["report", "bus.jsonl"]),
        (["view", "bus.jsonl"], ["report", "bus.jsonl"]),
        (["stats", "bus.jsonl"], ["report", "bus.jsonl"]),
        (["analyze", "bus.jsonl"], ["report", "bus.jsonl"]),
        (["/dev/ttyUSB0"], ["sniff", "/dev/ttyUSB0"]),
        (["/dev/ttyUSB0", "-b", "9600"], ["sniff", "/dev/ttyUSB0", "-b", "9600"]),
        (["COM3"], ["sniff", "COM3"]),
        (["tap://cabinet"], ["sniff", "tap://cabinet"]),
        (["socket://10.0.0.7:502"], ["sniff", "socket://10.0.0.7:502"]),
        (["monitor", "/dev/ttyUSB0"], ["sniff", "/dev/ttyUSB0"]),
        (["live", "COM3"], ["sniff", "COM3"]),
        ([REQUEST], ["parse", REQUEST]),
        (REQUEST.split(), ["parse", *REQUEST.split()]),
        ([*REQUEST.split(), "--lang", "en"], ["parse", *REQUEST.split(), "--lang", "en"]),
        (["capture", "COM3"], ["sniff", "COM3"]),
        (["1103006B00037687"], ["parse", "1103006B00037687"]),
        ([":1103006B00037E"], ["parse", ":1103006B00037E"]),
        (["0x11,0x03,0x00,0x6B,0x00,0x03,0x76,0x87"], ["parse", "0x11,0x03,0x00,0x6B,0x00,0x03,0x76,0x87"]),
        ([r"\x11\x03\x00\x6B\x00\x03\x76\x87"], ["parse", r"\x11\x03\x00\x6B\x00\x03\x76\x87"]),
        ([f"08:29:51 TX: {REQUEST}"], ["parse", f"08:29:51 TX: {REQUEST}"]),
        (["decode", REQUEST], ["parse", REQUEST]),
        (["list"], ["ports"]),
        (["devices"], ["ports"]),
        (["-D"], ["ports"]),
        (["version"], ["--version"]),
        (["-V"], ["--version"]),
        (["-v"], ["--version"]),
        (["exprot"], None),
        (["frobnicate"], None),
    ],
)
def test_what_is_typed_asks_for_a_command(typed: list[str], command: list[str] | None) -> None:
    assert asked(typed) == command


def test_every_word_of_other_tools_leads_to_a_command_that_there_is() -> None:
    from analyzer.cli.commands import COMMANDS

    targets = {*VERBS.values(), *OPTIONS.values()} - {"", "--version"}
    assert targets <= COMMANDS.keys()
    assert not VERBS.keys() & COMMANDS.keys()


def test_a_file_that_has_the_name_of_a_word_is_the_file(bus: Path) -> None:
    bus.rename(bus.with_name("stats"))
    assert asked(["stats"]) == ["report", "stats"]


def test_the_door_on_pipes(bus: Path) -> None:
    report = spawned("bus.jsonl", cwd=bus.parent)
    assert report.status == 0 and "requests" in report.out
    assert "unit 17: read" in spawned(REQUEST).out
    assert "unit 17: read" in spawned(stdin=f"{REQUEST}\n".encode()).out
    assert '"unit":17' in spawned("--json", stdin=REQUEST.encode()).out
    assert "requests" in spawned(stdin=bus.read_bytes()).out
    assert "requests" in spawned("-", stdin=bus.read_bytes()).out
    assert spawned().out.startswith("usage: rtuscope")


def test_what_cannot_be_used_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(capsys, "bus.mcap") == "bus.mcap: no such file"
    assert "rtuscope batch" in refused(capsys, ".")
    assert refused(capsys, "report", "bus.jsonl", "--unit", "2").startswith(
        "unrecognized arguments: --unit 2: did you mean --filter 'unit == N'?"
    )
    assert "did you mean" not in refused(capsys, "parse", "--foo", "11")


_PORTS = "no serial ports found|/dev/"
_AS_TYPED = [  # what is shown on a pipe and on a terminal; a screen of its own ends by `q`
    ("bus.jsonl", "requests", "Transactions"),
    ("read bus.jsonl", "requests", "Transactions"),
    ("view bus.jsonl", "requests", "Transactions"),
    ("stats bus.jsonl", "requests", "requests"),
    ("analyze bus.jsonl", "requests", "requests"),
    (REQUEST, "unit 17: read", "unit 17: read"),
    (f"decode {REQUEST}", "unit 17: read", "unit 17: read"),
    ("list", _PORTS, _PORTS),
    ("devices", _PORTS, _PORTS),
    ("-D", _PORTS, _PORTS),
    ("-V", "^rtuscope [0-9]", "^rtuscope [0-9]"),
    ("info bus.jsonl", "serial-chunks", "serial-chunks"),
    ("crc 11 03 00 6B 00 03", "76 87", "76 87"),
    ("parse 11 03 00 6B 00 03", f"the whole frame: {REQUEST}", f"the whole frame: {REQUEST}"),
    ("COM3", "COM3: no such port", "COM3: no such port"),
    ("tap://127.0.0.1:9", "tap://127.0.0.1:9: ", "tap://127.0.0.1:9: "),
]
_NAMES = [typed for typed, *_ in _AS_TYPED]


@pytest.mark.parametrize(("typed", "shown", "_"), _AS_TYPED, ids=_NAMES)
def test_the_front_door_as_typed_on_a_pipe(bus: Path, typed: str, shown: str, _: str) -> None:
    done = spawned(*typed.split(), cwd=bus.parent)
    assert re.search(shown, done.out + done.err) and "no command" not in done.err


@posix
@pytest.mark.parametrize(("typed", "_", "shown"), _AS_TYPED, ids=_NAMES)
def test_the_front_door_as_typed_on_a_terminal(typed: str, _: str, shown: str) -> None:
    terminal = Terminal(*typed.split())
    if shown == "Transactions":
        terminal.until(shown.encode())
        os.write(terminal.fd, b"q")
        assert terminal.status() == 0
    else:
        assert re.search(shown, terminal.whole())


@posix
@pytest.mark.parametrize("verb", [(), ("monitor",), ("live",)], ids=["port", "monitor", "live"])
@pytest.mark.parametrize("on_terminal", [False, True], ids=["pipe", "terminal"])
def test_a_port_is_listened_to(verb: tuple[str, ...], on_terminal: bool) -> None:
    with busy_port() as port:
        if on_terminal:
            terminal = Terminal(*verb, port, "-b", "19200")
            terminal.until(b"read 3 holding registers")
            os.write(terminal.fd, b"\x03")
            terminal.status()
        else:
            assert "read 3 holding registers" in spawned(*verb, port, "-b", "19200", "--count", "2").out


@posix
def test_the_start_screen_takes_bytes_a_file_and_what_is_at_hand() -> None:
    terminal = Terminal()
    terminal.until(b"Paste bytes")
    os.write(terminal.fd, f"{REQUEST}\r".encode())
    terminal.until(b"unit 17")
    os.write(terminal.fd, b"\x11")
    assert terminal.status() == 0
    terminal = Terminal()
    terminal.until(b"Paste bytes")
    os.write(terminal.fd, b"missing.mcap\r")
    terminal.until(b"no such file")
    os.write(terminal.fd, b"\x1b")
    assert terminal.status() == 0


@pytest.mark.parametrize(
    ("arguments", "crc"),
    [
        (["11", "03", "00", "6B", "00", "03"], "76 87"), (["1103006B0003"], "76 87"), ([REQUEST], "76 87"),
        ([r"\x11\x03\x00\x6b\x00\x03"], "76 87"), (["{0x11, 0x3, 0x00, 0x6B, 0, 0x3}"], "76 87"),
        (["11 3 0 6B 0 3"], "76 87"), (["17 3 0 107 0 3"], "76 87"), (["11-03-00-6b-00-03"], "76 87"),
        ([":1103006B0003"], "76 87"), ([":1103006B00037E"], "76 87"),
    ],
)  # fmt: skip
def test_crc_gives_the_whole_frame(capsys: pytest.CaptureFixture[str], arguments: list[str], crc: str) -> None:
    done = ran(capsys, "crc", *arguments)
    assert done.status == 0
    assert f"CRC    {crc}" in done.out and f"RTU    {REQUEST}" in done.out and ":1103006B00037E" in done.out


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("11 O3 00 6B 00 03", "O3"), ("11 03 00 6\u0412 00 03", "6\u0412"), ("1" * 5001, "1" * 5001),
        ("11 03 00 6B 00 0G", "0G"), ("11 03 00 6B 00 0", "0"), ("1103006B003", "1103006B003"), ("256 3 0 1", "256"),
        ("10 3 0 10 0 3", "10"), ("0x 11 03", "0x"), ("Tx 11 03", "Tx"),
    ],
)  # fmt: skip
def test_crc_leaves_nothing_out(capsys: pytest.CaptureFixture[str], text: str, word: str) -> None:
    """What it prints is sent: a byte that is mistyped, or may be hex or decimal, is named and not dropped."""
    done = ran(capsys, "crc", text)
    assert done.status == 2 and not done.out
    assert f"'{word}' " in done.err


def test_info_tells_what_a_capture_is(capsys: pytest.CaptureFixture[str]) -> None:
    import json

    about = json.loads(ran(capsys, "info", "bus.jsonl", "--json").out)
    assert about["format"] == "serial-chunks" and about["timed"] and about["baud"]
    assert about["bytes"] == sum(port["bytes"] for port in about["ports"])
    assert about["t_start_ns"] < about["t_end_ns"]
    shown = ran(capsys, "info", "bus.jsonl").out
    assert f"{about['bytes']:,} bytes, {about['reads']:,} reads" in shown


def test_plot_draws_a_float_where_the_address_is_one_of_its_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "simulate", "meter.jsonl", "--map", "eastron-sdm630@1").status == 0
    for address in ("30001", "30002"):
        drawn = ran(capsys, "plot", "meter.jsonl", "unit", "1", address)
        assert "unit 1 input 0-1, f32 ABCD, 31 readings from 22" in drawn.out
        assert "input 0-1 is read as f32 ABCD, as its values tell" in drawn.err
    word = ran(capsys, "plot", "meter.jsonl", "unit", "1", "30001", "--raw")
    assert "unit 1 input 0, 31 readings from 172" in word.out and not word.err
    named = ran(capsys, "plot", "meter.jsonl", "unit", "1", "30002", "--map", "eastron-sdm630@1")
    assert "unit 1 Voltage L1, 31 readings from 22" in named.out and not named.err
    pytest.importorskip("matplotlib")
    for more, measure in ((("--map", "eastron-sdm630@1"), "V"), ((), "value"), (("--raw",), "raw value")):
        picture = ran(capsys, "plot", "meter.jsonl", "unit", "1", "30001", "-o", "one.svg", "--overwrite", *more)
        assert picture.status == 0 and f"<!-- {measure} -->" in Path("one.svg").read_text()
    russian = ran(capsys, "plot", "meter.jsonl", "unit", "1", "30001", "--lang", "ru")
    assert "показаний: 31, от 22" in russian.out and "читается как f32 ABCD" in russian.err


def test_plot_draws_a_register_in_the_terminal_and_as_a_picture(capsys: pytest.CaptureFixture[str]) -> None:
    import json

    lines = ran(capsys, "registers", "bus.jsonl", "--json").out.splitlines()
    register = next(each for each in map(json.loads, lines) if each["area"] == "holding")
    place = (str(register["unit"]), str(40001 + register["address"]))
    drawn = ran(capsys, "plot", "bus.jsonl", "unit", *place)
    assert drawn.status == 0 and f"unit {place[0]}" in drawn.out and "readings" in drawn.out
    assert any(0x2800 < ord(character) < 0x2900 for character in drawn.out)
    pytest.importorskip("matplotlib")
    assert ran(capsys, "plot", "bus.jsonl", "unit", *place, "-o", "one.svg").status == 0
    assert Path("one.svg").read_bytes().startswith(b"<?xml")
    assert "has no readings of holding 9998" in refused(capsys, "plot", "bus.jsonl", "unit", place[0], "49999")
