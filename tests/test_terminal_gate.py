"""The gate of text: no control character of a foreign text reaches a terminal, whatever command is given it, and where.

Each case plants a canary in one field of one input and runs a command; what comes out on standard output and standard
error holds it in readable form, and no other control characters than the program's own.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import pytest
from buses import adu
from hypothesis import given
from hypothesis import strategies as st
from running import START, Ran, environment, ran, spawned
from seats import Seat, opened, using
from terminals import Terminal, posix

from analyzer.cli.commands import COMMANDS
from analyzer.model.source import CaptureSource
from analyzer.terminal_text import ERASE_LINE, TerminalGate, TerminalText, gated_streams, painted, terminal_text
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.pastepane import PasteText
from captures.chunks import Block, Capture, Chunk
from captures.line import LineSettings
from captures.live.ports import PortInfo
from captures.recording.notes import Note
from captures.recording.recorder import Recorder
from dissectors.values import harmless

# OSC 52 (clipboard), OSC 0 (title), blink, the same as C1, direction overrides, a joiner, line ends, markup of Rich
CANARY = (
    "CANARY\x1b]52;c;aGk=\x07\x1b]0;owned\x07\x1b[5m\x9b5m\x9d0;owned\x9c\u202e\u2066\u200b\u2028\x85\x7f\x08\r"
    "\nFORGED\t[red]x[/red][@click=app.quit]y[/]"
)
NAME = CANARY.replace("/", "")
FILE = NAME if os.name == "posix" else re.sub(r'[\0-\x1f<>:"\\|?*]', "", NAME)  # as far as Windows names files so
ONE_LINE = CANARY.replace("\n", " ")  # line ends pass the streams: those of a command are its own
OURS = re.compile(r"\x1b\[(?!5m)[\d;]*m|\r\x1b\[K")  # what the program itself sends: colours, but no blinking


def foreign(text: str) -> set[str]:
    """Characters that should not have come, and a line that a line end in the canary would begin."""
    text = OURS.sub("", text)
    forged = {"FORGED"} if re.search(r"^FORGED", text, re.MULTILINE) else set()
    return {c for c in text if not c.isprintable() and c != "\n"} | forged


def clean(done: Ran, *, shown: bool = True) -> Ran:
    """What a command said, which must be harmless and show the canary, unless it tells the trouble without."""
    assert not foreign(done.out), done.out
    assert not foreign(done.err), done.err
    assert ("CANARY" if shown else "") in done.out + done.err, done
    assert done.out or done.err
    assert "rtuscope: defect: " not in done.err, done.err
    return done


def plant(folder: Path, **header: str) -> Path:
    """A capture whose name and header are canaries, and which a device of that name speaks on."""
    said = CANARY.encode()[:90]
    answer = bytes((17, 0x2B, 0x0E, 1, 1, 0, 0, 1, 0, len(said))) + said
    frames = [adu("112b0e0100"), adu(answer.hex()), adu("1103006b0003"), adu("118302"), adu("1103006b0003")] * 4
    path = folder / f"{FILE}.jsonl"
    line = {"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11, **header}
    reads = [{"t_ns": 20_000_000 * (i + 1), "hex": frame.hex()} for i, frame in enumerate(frames)]
    reads.insert(3, {CANARY: CANARY})
    path.write_text("\n".join(json.dumps(row) for row in (line, *reads)) + "\n" + CANARY + "\n", encoding="utf-8")
    return path


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return plant(tmp_path, tap=CANARY, parity=CANARY, stop_bits=CANARY, port=CANARY)


@pytest.mark.parametrize(
    "command",
    ["report", "report --json", "check", "check --json", "replay --speed max", "replay --speed max --json",
     "replay --speed max --json --noise", "export -o -", "export --noise --explain -o -", "repair"],
)  # fmt: skip
def test_a_canary_in_every_field_of_a_capture(command: str, capture: Path) -> None:
    name, *options = command.split()
    done = spawned(name, capture, *options)
    clean(done)
    if "--json" in options and name != "replay":
        json.loads(done.out)
    elif "--json" in options or name == "export":
        assert all(json.loads(line) for line in done.out.splitlines())


@pytest.mark.parametrize(
    "options",
    [("--format", "csv"), ("--filter", CANARY), ("--filter", f"text contains {json.dumps(CANARY)}"),
     ("--format", CANARY), ("-o", f"/no{NAME}/out.csv"), ("-o", NAME), (CANARY,), (f"--{CANARY}",),
     ("--t15-ms", CANARY), ("--functions", NAME)],
)  # fmt: skip
def test_a_canary_in_every_argument_of_an_export(
    options: tuple[str, ...], capture: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clean(ran(capsys, "export", capture, *options), shown="--filter" not in options and "-o" not in options)


@pytest.mark.parametrize(
    "arguments",
    [(CANARY,), (f"--{CANARY}",), ("parse", CANARY), ("parse", "-f", NAME), ("parse", "--as", CANARY),
     ("parse", f"12:00:01 {CANARY} RX: 11 03 00 6B 00 03 76 87 {CANARY}"), ("completion", CANARY),
     ("parse", "--json", f"{CANARY} 11 03 00 6B 00 03 76 87"), ("open", NAME), ("report", NAME), ("demo", CANARY),
     ("check", NAME), ("export", NAME), ("replay", NAME), ("replay", NAME, "--to", CANARY), ("repair", NAME),
     ("simulate", f"/no{NAME}/a.jsonl"), ("simulate", NAME), ("simulate", "a.jsonl", "--defect", CANARY),
     ("sniff", NAME), ("sniff", f"socket://{NAME}:1"), ("sniff", NAME, "-o", f"{NAME}.csv"),
     ("sniff", "a", "--baud", CANARY), ("sniff", "a", "--filter", CANARY),
     ("record", NAME, "-o", f"/no{NAME}/a.mcap"), ("record", "a", "-o", NAME),
     ("record", "a", "-o", "a.mcap", "--keep", CANARY), ("ports", CANARY), ("replay", "a", "--speed", CANARY)],
)  # fmt: skip
def test_a_canary_in_the_arguments_of_every_command(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    clean(ran(capsys, *arguments), shown="parse" not in arguments and "--filter" not in arguments)


def test_a_canary_in_every_field_of_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"{FILE}.mcap"
    line = LineSettings(baud=19200, char_bits=11, parity="N", stop_bits=1, tap=CANARY)
    recorder = Recorder(path, line, about={"ports": CANARY, "tool": CANARY, CANARY: CANARY}, tell=lambda _: None)
    for number, frame in enumerate([adu("1103006b0003"), adu("1103020001")] * 20):
        t_ns = 10**18 + number * 10**7
        recorder.write(Block.from_chunks([Chunk(t_ns, frame)]))
        for kind in ("lost", "opened", "clock", "gap", CANARY):
            recorder.note(Note(t_ns, kind, f"/dev/ttyUSB0: {CANARY}"))
    recorder.close()
    for command in ("report", "check", "replay --speed max", "export -o -"):
        name, *options = command.split()
        done = ran(capsys, name, path, *options)
        assert not foreign(done.out) and not foreign(done.err), (command, done)
        assert name != "report" or "CANARY" in done.out
    json.loads(clean(ran(capsys, "report", path, "--json")).out)
    cut = tmp_path / f"{FILE}cut.mcap"
    cut.write_bytes(path.read_bytes()[:-3000])
    clean(ran(capsys, "repair", cut))


@pytest.mark.parametrize("suffix", ["log", "csv", "bin", "mcap", "jsonl", "toml"])
def test_a_canary_in_logs_tables_and_what_is_neither(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{FILE}.{suffix}"
    log = f"{CANARY} 12:00:01.5 11 03 00 6B 00 03 76 87 {CANARY}\n{CANARY}\n"
    table = f"name,type,start_time,data,{CANARY!r}\n{CANARY!r},data,0.1,0x11\n{CANARY!r},data,{CANARY!r},{CANARY!r}\n"
    path.write_text({"csv": table, "jsonl": f'{{"format": {json.dumps(CANARY)}}}\n'}.get(suffix, log), encoding="utf-8")
    for command in ("report", "export"):
        clean(ran(capsys, command, path), shown=command == "report")


def test_a_canary_in_rules_and_in_what_breaks_them(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = tmp_path / f"{FILE}.toml"
    rules.write_text(f'[[rule]]\nname = {json.dumps(CANARY)}\ncheck = "no exceptions"\n'.replace("\\u007f", ""))
    clean(ran(capsys, "check", capture, "--rules", rules, "--rule", "no findings of severity note"))
    for text in (f"[[rule]]\n{json.dumps(CANARY)} = 'x'", f"[[rule]]\ncheck = {json.dumps(CANARY)}", CANARY):
        rules.write_text(text.replace("\\u007f", ""), encoding="utf-8")
        clean(ran(capsys, "check", capture, "--rules", rules))
    clean(ran(capsys, "check", capture, "--rule", CANARY))


@pytest.mark.parametrize(
    "text",
    [f"# {CANARY!r}\nraise ValueError({CANARY!r})",
     f"class Odd(Exception): pass\nOdd.__name__ = {CANARY!r}\nraise Odd()",
     f"{CANARY!r} = 1", f"from dissectors import Function\nFunction(65, {CANARY!r}, 1, 2)",
     f"import construct\nfrom dissectors import Function\nA = Function(65, {CANARY!r}, construct.Pass, construct.Pass)",
     f"import construct\nfrom dissectors import Function\nA = Function(65, 'a', construct.Pass, construct.Pass, "
     f"request_words={CANARY!r})",
     f"import construct\nfrom dissectors import Function\nA = Function(65, 'a', construct.Struct({CANARY!r} / "
     f"construct.Byte), construct.Pass)"],
)  # fmt: skip
def test_a_canary_in_declared_functions(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "functions.py"
    path.write_text(text, encoding="utf-8")
    done = clean(ran(capsys, "parse", "11 41 05", "--functions", path), shown=" = 1" not in text)
    assert done.status == 2 and done.err.count("\n") == 1, done


@pytest.mark.parametrize("form", ["yaml", "csv", "json"])
def test_a_canary_in_every_cell_of_a_map(
    form: str, capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / f"{FILE}.{form}", tmp_path / f"{FILE}out.csv"
    cells = {"name": CANARY, "unit": CANARY, "description": CANARY, "group": CANARY, CANARY: CANARY}
    rows = [{"area": "holding", "address": 107 + n, "max": 1, **cells, "name": f"{n}{CANARY}"} for n in range(3)]
    states = {"area": "holding", "address": 110, "name": CANARY, "type": "enum", "values": {0: CANARY}}
    content = {"device": CANARY, "vendor": CANARY, CANARY: CANARY, "match": f"server_id: {CANARY}"}
    if form == "yaml":
        path.write_text(json.dumps({**content, "registers": [*rows, states]}), encoding="utf-8")
    elif form == "csv":
        table = io.StringIO()
        writer = csv.DictWriter(table, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
        path.write_text(f"# device: {CANARY.split(chr(10))[0]}\n{table.getvalue()}", encoding="utf-8", newline="")
    else:
        channels = [{"name": row["name"], "reg_type": "holding", "address": row["address"]} for row in rows]
        model = {"title": CANARY, "device": {"name": CANARY, "channels": [*channels, {"name": CANARY}]}}
        path.write_text(json.dumps(model), encoding="utf-8")
    clean(ran(capsys, "map", "import", path, "-o", out))
    clean(ran(capsys, "map", "import", path, "-o", out))
    clean(ran(capsys, "map", "import", path))
    for command in (
        ("map", "show", out), ("map", "show", out, "--format", "csv"), ("map", "show", out, "--format", "yaml"),
        ("map", "check", out), ("map", "check", f"{out}@17", capture), ("map", "check", f"{out}@17", capture, "--json"),
        ("map", "diff", out, "xy-md02"), ("registers", capture, "--map", out), ("map", "show", NAME),
        ("registers", capture, "--map", out, "--json"), ("map", "infer", capture, "--unit", "17"),
        ("parse", "--map", out, f"{adu('1103006b0001').hex()} {adu('1103020001').hex()}"),
        ("export", capture, "--table", "values", "--map", out, "-o", "-"), ("registers", capture, "--like", CANARY),
        ("map", "import", CANARY), ("map", "import", out, "--device", CANARY),
        ("map", "import", out, "--format", CANARY),
        ("registers", capture, "--map", CANARY), ("map", "diff", out, CANARY), ("map", "infer", CANARY),
    ):  # fmt: skip
        clean(ran(capsys, *command), shown=command[:2] != ("map", "infer"))


def test_a_canary_in_the_name_of_a_port(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    port = PortInfo(CANARY, CANARY, "1234:5678", CANARY, CANARY, CANARY, CANARY, 16, False, CANARY)
    monkeypatch.setattr("captures.live.ports.ports", lambda: [port])
    assert clean(ran(capsys, "ports")).out.count("CANARY") == 6
    assert json.loads(clean(ran(capsys, "ports", "--json")).out)[0]["device"] == CANARY


@posix
def test_a_terminal_gets_our_own_sequences_and_no_others(capture: Path, tmp_path: Path) -> None:
    rules = tmp_path / "rules.toml"
    rules.write_text(f'[[rule]]\nname = {json.dumps(CANARY)}\ncheck = "no exceptions"\n'.replace("\\u007f", ""))
    painted = set()
    for arguments in (
        ("replay", str(capture), "--speed", "max"),
        ("parse", "11 2B 0E 01 01 00 00 01 00 02 1B 07"),
        ("check", str(capture), "--rules", str(rules)),
        ("export", str(capture)),
        ("export", str(capture), "--format", "csv", "--noise"),
        ("export", str(capture), "--format", "mcap"),
        ("report", str(capture)),
        ("open", NAME),
    ):
        terminal = Terminal(*arguments, columns=400)
        terminal.status()
        text = terminal.seen.decode().replace("\r\n", "\n")
        assert not foreign(text), (arguments, text)
        if "\x1b[0m" in text:
            painted.add(arguments[0])
    assert painted >= {"replay", "parse", "check", "report"}
    assert "cannot be shown on a terminal" in Terminal("export", str(capture), "--format", "mcap").whole()


@posix
def test_the_interface_lets_nothing_of_it_through(capture: Path) -> None:
    """Every view, on a terminal: what is drawn holds sequences of the interface's own making only."""
    place = {"port": 0, "start": 0, "comment": CANARY}
    notes = {"version": 1, "bookmarks": [place]}
    capture.with_name(capture.name + ".rtuscope.json").write_text(json.dumps(notes), encoding="utf-8")
    terminal = Terminal("open", str(capture))
    terminal.until(b"CANARY")
    for key in "12345678":
        terminal.press(key)
    terminal.press("\x0c")
    terminal.press(f"\x1b[200~{CANARY}\n11 03 00 6B 00 03 76 87\x1b[201~")
    terminal.until(b"unit 17")
    terminal.press("\x11")
    assert terminal.status() == 0
    for sequence in (b"\x1b]52", b"\x1b]0;owned", b"\x1b[5m", b"\x9b5m", b"\xc2\x9b", b"\xe2\x80\xae", b"\xe2\x81\xa6"):
        assert sequence not in terminal.seen, sequence


def test_the_interface_shows_it_readable_wherever_it_stands(capture: Path) -> None:
    place = {"port": 0, "start": 0, "comment": CANARY}
    notes = {"version": 1, "bookmarks": [place]}
    capture.with_name(capture.name + ".rtuscope.json").write_text(json.dumps(notes), encoding="utf-8")

    async def work(sitting: Seat) -> None:
        seen = ""
        for view in "1234567":
            await sitting.press(view)
            seen += sitting.shown()
        assert harmless(FILE)[:13] in seen and "[red]x[/red]" in seen
        await sitting.press("2", "semicolon")
        seen += sitting.shown()
        await sitting.press("escape", "slash")
        sitting.screen.query_one(FilterBar).line.value = CANARY
        await sitting.press("enter")
        seen += sitting.shown()
        await sitting.press("escape", "8")
        sitting.screen.query_one(PasteText).load_text(CANARY + " 11 03 00 6B 00 03 76 87")
        await sitting.press("f1")
        await sitting.press("escape")
        seen += sitting.shown()
        assert not foreign(seen), seen
        assert all("\x1b" not in notice for notice in sitting.notices())

    using(opened(capture), work, size=(200, 50))


def test_a_widget_that_forgets_is_caught_on_the_way_out() -> None:
    source = CaptureSource(Capture.of(LineSettings(), []), "empty")

    async def work(sitting: Seat) -> None:
        from rich.text import Text
        from textual.widgets import Label

        await sitting.screen.mount(Label(Text(ONE_LINE)))
        await sitting.pilot.pause()
        assert "CANARY" in sitting.shown()
        assert not foreign(sitting.shown()), sitting.shown()

    using(source, work, size=(120, 30))


SPOKEN = "\n".join(f"print({ONE_LINE!r}, file={file})" for file in ("sys.stdout", "sys.stderr"))


@pytest.mark.parametrize(
    "arguments",
    [("parse", "11 03 00 6B 00 03 76 87"), ("report",), ("check", "--rule", "no exceptions"), ("export", "-o", "-"),
     ("replay", "--speed", "max")],
)  # fmt: skip
def test_what_declared_functions_say_is_caught_on_the_way_out(
    arguments: tuple[str, ...], capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Code of others writes to the streams itself: only the streams are between it and the terminal."""
    path = tmp_path / "functions.py"
    source = (
        f"import sys, construct\nfrom dissectors import Function\n{SPOKEN}\nsys.stderr.writelines([{ONE_LINE!r}])\n"
    )
    path.write_text(source + "A = Function(65, 'A', construct.Pass, construct.Pass)\n", encoding="utf-8")
    command, *options = arguments
    given_to = [] if command == "parse" else [capture]
    done = clean(ran(capsys, command, *given_to, *options, "--functions", path))
    assert (done.out.count("]52;c;aGk="), done.err.count("]52;c;aGk=")) >= (1, 2), done


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_forgets_is_caught_on_the_way_out(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def forgets(_: object) -> int:
        print(ONE_LINE)
        sys.stdout.write(ONE_LINE)
        warnings.warn(ONE_LINE, stacklevel=1)
        print(ONE_LINE, file=sys.stderr)
        raise RuntimeError(ONE_LINE)

    command = SimpleNamespace(EXAMPLE="", configure=lambda _: None, run=forgets)
    monkeypatch.setattr("analyzer.cli.commands.load", lambda _: command)
    done = ran(capsys, name)
    assert not foreign(done.out) and not foreign(done.err), done
    assert (done.status, done.out.count("CANARY"), done.err.count("CANARY")) == (2, 2, 3)


@given(st.lists(st.text() | st.builds(painted, st.text(), st.sampled_from(("", "31")))))
def test_only_harmless_text_and_our_own_sequences_pass(parts: list[str]) -> None:
    ready = terminal_text(*parts)
    assert not {c for c in OURS.sub("", ready) if not c.isprintable() and c != "\n"}
    assert terminal_text(ready) == ready
    stream = io.StringIO()
    TerminalGate(stream).write(ready)
    assert stream.getvalue() == ready


def test_readable_text_passes_as_it_is_and_our_sequences_only_by_name() -> None:
    text = "Приёмка: 21 °C, 5 µs … ┌→\nzweite Zeile\n"
    assert terminal_text(text) == text
    assert terminal_text("\x1b[31mred\x1b[0m", ERASE_LINE) == "\\x1b[31mred\\x1b[0m\r\x1b[K"
    assert terminal_text(painted("\x1b[5m", "31")) == "\x1b[31m\\x1b[5m\x1b[0m"
    assert not isinstance(painted("a", "31") + "b", TerminalText)  # whoever forgets sees it escaped
    assert harmless("\ud800") == "\\ud800"


def test_streams_that_are_closed_lead_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    with gated_streams():
        print("nobody hears this")
        print("nor this", file=sys.stderr)
    assert sys.stdout is None and sys.stderr is None


@posix
def test_a_command_whose_standard_error_is_closed_keeps_its_status() -> None:
    command = f"{sys.executable} -c '{START}' report none 2>&-"
    done = subprocess.run(command, shell=True, capture_output=True, env=environment(), timeout=60)
    assert (done.returncode, done.stdout) == (2, b"")


@pytest.mark.filterwarnings("error")
def test_without_a_standard_output_any_language_goes_nowhere_whatever_the_code_page(monkeypatch):
    monkeypatch.setattr("sys.stdout", None)
    with gated_streams():
        assert sys.stdout.encoding == "utf-8"
        sys.stdout.write("кадры \ud800\n")
        sys.stdout.flush()


def test_a_byte_of_a_name_that_is_no_utf8_is_told_as_the_lake_tells_it() -> None:
    from analyzer.fleet.sources import readable
    from analyzer.terminal_text import terminal_text

    name = b"bad\xff.jsonl".decode("utf-8", "surrogateescape")
    assert terminal_text(name) == readable(name) == r"bad\xff.jsonl"
