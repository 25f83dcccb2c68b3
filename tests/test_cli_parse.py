"""`rtuscope parse` as a user meets it."""

import io
import json
import os
import subprocess
import sys

import pytest
from buses import adu
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import START, environment, ran, refused, spawned

from analyzer.cli.terminal import shell_word

REQUEST = "11 03 00 6B 00 03 76 87"
ANSWER = "11 03 06 AE 41 56 52 43 40 49 AD"


def test_a_frame_as_arguments(capsys):
    done = ran(capsys, "parse", *REQUEST.split())
    assert (done.status, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0] == "RTU: correct CRC at the predicted length, 1 frame over all 8 bytes"
    assert lines[2] == "request   unit 17: read 3 holding registers from 107 (40108)"
    assert lines[3:] == [
        "   0  11     unit              17",
        "   1  03     function          FC 3 (0x03) Read Holding Registers",
        "   2  00 6B  starting_address  107 (0x006B, 40108)",
        "   4  00 03  quantity          3",
        "   6  76 87  crc               ok",
    ]


def test_lines_as_arguments_are_lines(capsys):
    done = ran(capsys, "parse", f"TX: {REQUEST}", f"RX: {ANSWER}")
    assert done.status == 0
    assert "register  40108: 44609 (-20927, 0xAE41)" in done.out


@pytest.mark.parametrize("through", ["file", "stdin", "dash"])
def test_from_a_file_and_from_standard_input(tmp_path, through):
    log = tmp_path / "log.txt"
    log.write_text(f"master  {REQUEST}\nslave   {ANSWER}\n")
    arguments = {"file": ["-f", str(log)], "stdin": [], "dash": ["-f", "-"]}[through]
    done = spawned("parse", "--json", *arguments, stdin=b"" if through == "file" else log.read_bytes())
    assert (done.status, done.err) == (0, "")
    assert [json.loads(line)["hex"] for line in done.out.splitlines()] == [
        REQUEST.replace(" ", "").lower(),
        ANSWER.replace(" ", "").lower(),
    ]


def test_json_has_noise_only_when_asked(capsys):
    text = f"FF {REQUEST} 00"
    assert len(ran(capsys, "parse", "--json", text).out.splitlines()) == 1
    lines = [json.loads(line) for line in ran(capsys, "parse", "--json", "--noise", text).out.splitlines()]
    assert [line.get("kind") for line in lines] == ["noise", None, "noise"]
    assert sum(line["length"] for line in lines) == 10


@pytest.mark.parametrize(
    ("text", "status"),
    [
        (REQUEST, 0),
        ("11 03 00 6B 00 03 76 88", 0),  # damaged, but a frame
        ("11 03 00 6B", 1),  # cut
        ("48 65 6C 6C 6F", 1),
        ("00 01 00 00 00 06 11 03 00 6B 00 03", 0),
        (":1103006B00037E", 0),
    ],
)
def test_the_status_says_whether_there_is_a_frame(capsys, text, status):
    assert ran(capsys, "parse", text).status == status
    assert ran(capsys, "parse", "--json", text).status == status


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["hello"], "no hex bytes found in 'hello'"),
        (["11", "03", "0"], "odd number of hex digits"),
        ([REQUEST, "-f", "x"], "not both"),
        (["-f", "no-such-file"], "no-such-file: no such file"),
        (["nofile.mcap"], "nofile.mcap: no such file"),
        (["-f", "."], "directory"),
        (["--functions", "no-such.py", REQUEST], "no-such.py"),
    ],
)
def test_unusable_input_is_one_line(capsys, arguments, words):
    assert words in refused(capsys, "parse", *arguments)


def test_one_odd_token_does_not_refuse_the_rest(capsys, tmp_path):
    log = tmp_path / "log.txt"
    log.write_text(f"{REQUEST}\n11 03 00 6\n")
    done = ran(capsys, "parse", "--json", "-f", log)
    assert done.status == 0
    assert json.loads(done.out.splitlines()[0])["hex"] == "1103006b00037687"


def test_a_binary_file_is_one_line(capsys, tmp_path):
    binary = tmp_path / "capture.bin"
    binary.write_bytes(bytes(range(256)) * 4)
    assert str(binary) in refused(capsys, "parse", "-f", binary)


def test_nothing_on_standard_input_is_one_line():
    done = spawned("parse", stdin=b"")
    assert (done.status, done.err) == (2, "rtuscope: standard input: nothing to read: it is empty\n")


def test_a_vendors_function_is_declared_in_a_file(tmp_path):
    file = tmp_path / "vendor.py"
    file.write_text(
        "from construct import Struct\n"
        "from dissectors import Function, Number\n"
        'TREND = Function(0x41, "Read Trend", Struct("channel" / Number(1)), Struct("level" / Number(2)))\n'
    )
    done = spawned("parse", "--functions", file, adu("114105").hex(" "))
    assert done.status == 0
    assert "Read Trend" in done.out
    assert "channel" in done.out
    file.write_text("1/0\n")
    wrong = spawned("parse", "--functions", file, REQUEST)
    assert wrong.status == 2
    assert wrong.err.startswith(f"rtuscope: {file}:1: ")
    assert wrong.err.count("\n") == 1


def test_no_colour_on_a_pipe_nor_against_the_users_wish(capsys, monkeypatch):
    assert "\x1b" not in ran(capsys, "parse", REQUEST).out
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in ran(capsys, "parse", REQUEST).out


@pytest.mark.skipif(os.name == "nt", reason="needs a pty")
def test_colour_on_a_terminal():
    import pty

    ours, theirs = pty.openpty()
    try:
        done = subprocess.run(
            [sys.executable, "-c", START, "parse", REQUEST],
            stdout=theirs,
            env={key: value for key, value in environment(TERM="xterm").items() if key != "NO_COLOR"},
            timeout=60,
        )
        assert done.returncode == 0
        assert b"\x1b[1m" in os.read(ours, 4096)
    finally:
        os.close(ours)
        os.close(theirs)


@settings(max_examples=75, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    words=st.lists(st.text(st.characters(codec="utf-8"), max_size=30), max_size=5),
    options=st.sets(st.sampled_from(["--json", "--values"])),
)
def test_no_text_makes_a_traceback(capsys, words, options):
    done = ran(capsys, "parse", *options, "--", *words) if words else ran(capsys, "parse", *options, "--", "")
    assert done.status in (0, 1, 2)
    assert "defect" not in done.err
    assert done.err.count("\n") == (done.status == 2)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "cp1251", "utf-8-sig"])
def test_text_in_any_encoding_of_windows(tmp_path, encoding):
    log = tmp_path / "log.txt"
    log.write_bytes(f"Запрос: {REQUEST}\r\nОтвет: {ANSWER}\r\n".encode(encoding))
    done = spawned("parse", "--json", stdin=log.read_bytes())
    assert (done.status, done.err) == (0, "")
    assert [json.loads(line)["direction"] for line in done.out.splitlines()] == ["request", "response"]


def test_a_request_that_can_only_be_an_answer_is_told_as_one(capsys):
    done = ran(capsys, "parse", "--role", "request", "11 83 02 C1 34")
    assert (done.status, done.err) == (0, "")
    assert "response  unit 17: exception 02 illegal data address" in done.out


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.binary(min_size=1, max_size=12).map(lambda pdu: adu(pdu.hex())) | st.binary(max_size=12), max_size=4),
    st.sampled_from(("auto", "rtu", "ascii", "tcp")),
    st.sampled_from(("request", "response")),
)
def test_a_role_never_makes_a_paste_unreadable(capsys, frames, envelope, role):
    shown = " ".join(frame.hex(" ") for frame in frames)
    done = ran(capsys, "parse", "--as", envelope, "--role", role, shown or "11")
    assert done.status in (0, 1, 2)
    assert not done.err or ("defect" not in done.err and "sequence" not in done.err), done.err


LOG = "2026-11-21 12:00:00.100 TX 11 03 00 6B 00 03 76 87\nopened the port\n11 03 5\n"


def test_what_was_not_read_is_listed_and_why(capsys, tmp_path):
    path = tmp_path / "bus.log"
    path.write_text(LOG, encoding="utf-8")
    done = ran(capsys, "parse", "-f", path)
    assert done.status == 0
    listed = done.out.split("\n\n")[-1]
    assert listed.startswith("not read")
    assert "line 3: an odd number of hex digits in '5' at column 7" in listed
    assert "1 line without bytes" in listed
    done = ran(capsys, "parse", "--json", "-f", path)
    assert "not read: line 3: " in done.err
    assert len(done.out.splitlines()) == 1


@pytest.mark.parametrize(("zone", "hour"), [("UTC", 12), ("+03:00", 9)])
def test_times_of_a_log_are_of_the_zone_that_is_named(capsys, tmp_path, zone, hour):
    path = tmp_path / "bus.log"
    path.write_text(LOG, encoding="utf-8")
    frame = json.loads(ran(capsys, "parse", "--json", "--tz", zone, "-f", path).out)
    assert frame["t_start_ns"] == 1_795_219_200 * 10**9 + 100_000_000 + hour * 3600 * 10**9
    assert "unknown time zone" in refused(capsys, "parse", "--tz", "Nowhere/else", "-f", path)


def test_a_file_in_place_of_bytes_is_told_how_to_be_read(capsys, tmp_path):
    path = tmp_path / "bus.log"
    path.write_text(LOG, encoding="utf-8")
    assert f"read it with rtuscope parse -f {shell_word(str(path))}" in refused(capsys, "parse", path)


def test_a_name_that_a_shell_would_take_apart_is_told_between_quotes():
    assert shell_word("журнал.txt") == shell_word("журнал.txt", windows=True) == "журнал.txt"
    assert shell_word("шкаф 1/bus.log", windows=False) == "'шкаф 1/bus.log'"
    assert shell_word("it's.log", windows=False) == """'it'"'"'s.log'"""
    assert shell_word("C:\\Шкаф 1\\a&b.log", windows=True) == '"C:\\Шкаф 1\\a&b.log"'
    assert shell_word("C:\\bus.log", windows=True) == "C:\\bus.log"


def test_a_dash_is_standard_input(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"11 03 00 6B 00 03 76 87"), encoding="utf-8"))
    assert "read 3 holding registers" in ran(capsys, "parse", "-").out


@pytest.mark.parametrize(
    ("request_pdu", "answer", "refused"),
    [
        ("050600020064", "058602", True),
        ("05100002000102 0064", "059003", True),
        ("050600020064", "050600020064", False),
        ("05100002000102 0064", "051000020001", False),
    ],
)
def test_a_refused_write_is_no_value_of_the_map(capsys, tmp_path, request_pdu, answer, refused):
    (tmp_path / "drive.csv").write_text("area,address,name,type\nholding,2,Ramp,u16\n")
    text = f"{adu(request_pdu).hex()} {adu(answer).hex()}"
    chart = ("--map", str(tmp_path / "drive.csv"))
    out = ran(capsys, "parse", *chart, text).out
    assert "Ramp  100  (holding 2)" in out
    assert ("asked of unit 5 at byte 0 and refused, by the map:" in out) == refused
    assert ("by the map, unit 5 at byte 0:" in out) == (not refused)
    lines = [json.loads(line) for line in ran(capsys, "parse", "--json", *chart, text).out.splitlines()]
    assert [value["value"] for value in lines[0]["mapped"]] == ([] if refused else [100])


@pytest.mark.skipif(os.name != "posix", reason="a shell closes descriptors")
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize("command", ["parse", "report -", "parse 1103006B00037687"])
def test_streams_that_the_shell_closed_are_no_defect(closed, command):
    line = f"exec {sys.executable} -m analyzer.cli {command} {closed}"
    done = subprocess.run(["sh", "-c", line], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 2)
    assert "defect" not in done.stderr and "Traceback" not in done.stderr
