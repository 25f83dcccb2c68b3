"""The command line as a whole: help, usage errors, completion, start-up, Ctrl-C and closed pipes."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from running import ROOT, START, environment, ran, refused, spawned

from analyzer import cli
from analyzer.cli.app import Parser
from analyzer.cli.commands import COMMANDS, DONE, ENDLESS, FAILURES, add_arguments, load, meanings
from analyzer.cli.manpage import man_page
from analyzer.version import __version__
from captures import samples


def test_the_version(capsys):
    assert ran(capsys, "--version").out == f"rtuscope {__version__}\n"


def test_no_arguments_show_the_help(capsys):
    done = ran(capsys)
    assert done.status == 0
    assert all(name in done.out for name in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_tells_the_example(capsys, command):
    done = ran(capsys, command, "--help")
    assert done.status == 0
    for line in load(command).EXAMPLE.splitlines():
        assert f"  {line}\n" in done.out
    for status, meaning in meanings(command):
        assert f"  {status:<5}{meaning}\n" in done.out
    assert ("\n  1    " in done.out) == (command in FAILURES)


def test_help_of_what_a_signal_ends_says_that_it_is_done_then():
    """`tests/test_live_sniffing.py` and others end them so."""
    ending = {
        name
        for name in COMMANDS
        if "ended_from_outside" in Path(cli.__file__).with_name(f"{name}.py").read_text("utf-8")
    }
    assert ending
    for command in COMMANDS:
        told = dict(meanings(command))[DONE]
        assert ("Ctrl-C" in told) == (command in ENDLESS), command
    assert ending <= ENDLESS


LAKE_COMMANDS = ("ask", "batch", "watch")


@pytest.mark.parametrize("command", ["batch bus.jsonl -o lake", "watch lake --from bus.jsonl --once"])
def test_a_lake_without_its_extra_is_one_line(command: str, tmp_path: Path) -> None:
    start = f"import sys; sys.modules['pyarrow'] = None; {START}"
    done = subprocess.run(
        [sys.executable, "-c", start, *command.split(), "--site", "x"],
        capture_output=True, text=True, cwd=tmp_path, env=environment(), timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert re.fullmatch(r"rtuscope: a lake needs pyarrow: .* install .*\[fleet\].\n", done.stderr), done.stderr


# Those need a tap, go on until they are ended, or write into the user's folders of Wireshark (tests/test_wireshark.py).
@pytest.mark.parametrize(
    "command", sorted(COMMANDS.keys() - {"sniff", "between", "mcp", "record", "tap", "twin", "wireshark"})
)
def test_the_example_works(capsys, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if command in LAKE_COMMANDS:
        pytest.importorskip("pyarrow", reason="the extra `fleet` is not installed")
    for line in load(command).EXAMPLE.splitlines():
        program, *arguments = shlex.split(line)
        assert program == "rtuscope"
        done = ran(capsys, *arguments)
        if command == "open" and "needs a terminal" in done.err:
            continue  # tests/test_cli_open.py gives it one
        assert done.status == 0, (line, done)
        told = r"rtuscope: wrote \S+ and its ground truth \S+\n" if arguments[0] == "simulate" else ""
        assert re.fullmatch(told, done.err), done.err


def test_the_example_of_the_first_help_works(capsys):
    line = next(line for line in ran(capsys).out.splitlines() if line.startswith("  rtuscope "))
    assert ran(capsys, *shlex.split(line)[1:]).status == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["frobnicate"], "no command 'frobnicate'"),
        (["--frobnicate"], "unrecognized arguments"),
        (["--baud", "9600", "export", "x"], "--baud goes after the command: rtuscope export --baud ..."),
        (["--language", "ru", "export", "x"], "unrecognized arguments: --language: did you mean --lang?"),
        (["sniff", "x", "--tui"], "--tui needs a terminal"),
        (["sniff", "x", "--tui", "--until", "unit == 3"], "--until is for output by line"),
        (["sniff", "x", "--tui", "--json"], "--format is for output by line"),
        (["sniff", "x", "--rotate-every", "1h"], "--rotate-every needs -o FILE"),
        (["export"], "required: CAPTURE"),
        (["report", "a.jsonl", "b.json"], "unrecognized arguments: b.json (see"),
        (["parse", "--as", "canbus", "11"], "invalid choice: 'canbus'"),
        (["report", "no-such-file.jsonl"], "no-such-file.jsonl: no such file"),
        (["export", "."], "is a directory"),
        (["simulate", "x.jsonl", "--baud", "-1"], "-1"),
        (["simulate", "x.jsonl", "--transactions", "none"], "'none' is not a whole number"),
        (["simulate", "x.weird"], "suffix"),
    ],
)
def test_unusable_arguments_are_one_line(capsys, arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, *arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_completion_scripts(capsys, shell):
    done = ran(capsys, "completion", shell)
    assert done.status == 0
    assert "rtuscope" in done.out
    assert "ARGCOMPLETE" in done.out


@pytest.mark.skipif(os.name == "nt", reason="completion hands over by a descriptor")
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("rtuscope ex", {"export"}),
        ("rtuscope parse --as r", {"rtu"}),
        ("rtuscope export --fo", {"--format"}),
        ("rtuscope sniff rfc", {"rfc2217://"}),
        ("rtuscope export bus.jsonl --filter respon", {"response", "response_time"}),
        ("rtuscope report --map eastron-sdm6", {"eastron-sdm630"}),
        ("rtuscope help glo", {"glossary"}),
        ("rtuscope map sh", {"show"}),
    ],
)
def test_completion_completes(tmp_path, line, offered):
    answers = tmp_path / "answers"
    done = subprocess.run(
        [sys.executable, "-c", START],
        capture_output=True,
        timeout=60,
        env=environment(
            _ARGCOMPLETE="1",
            _ARGCOMPLETE_IFS="\n",
            _ARGCOMPLETE_STDOUT_FILENAME=str(answers),
            _ARGCOMPLETE_COMP_WORDBREAKS=" ",
            COMP_LINE=line,
            COMP_POINT=str(len(line)),
        ),
    )
    assert done.stderr == b""
    assert {word.strip() for word in answers.read_text(encoding="utf-8").split("\n") if word.strip()} == offered


def test_parse_imports_nothing_heavy():
    heavy = {"numpy", "textual", "mcap", "orjson", "argcomplete", "json", "asyncio", "captures.text", "dissectors.maps"}
    code = (
        "import sys; from analyzer.cli import main; status = main(['parse', '11 03 00 6B 00 03 76 87']);"
        f"heavy = {heavy} & set(sys.modules);"
        "sys.exit(f'{status} {heavy}' if status or heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment(), timeout=60, text=True)
    assert done.returncode == 0, done.stderr


def test_a_reader_that_has_had_enough_ends_it_quietly(tmp_path, capsys):
    bus = tmp_path / "bus.jsonl"
    assert ran(capsys, "simulate", bus, "--transactions", "2000").status == 0
    command = [sys.executable, "-c", START, "export", str(bus)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment())
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait(timeout=60) == 0
    process.stderr.close()


def long_bus(folder, capsys):
    """A capture that takes seconds to read."""
    bus = folder / "bus.jsonl"
    assert ran(capsys, "simulate", bus, "--tap", "untimed", "--transactions", "300").status == 0
    lines = bus.read_text(encoding="utf-8").splitlines(keepends=True)
    with bus.open("w") as file:
        file.write(lines[0])
        for _ in range(400):
            file.writelines(lines[1:])
    return bus


def begun_export(bus, out, least, *options):
    """An export of which so many bytes are written already."""
    command = [sys.executable, "-c", START, "export", str(bus), "-o", str(out), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment())
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and not any(
        part.stat().st_size >= least for part in out.parent.glob(f".{out.stem}*")
    ):
        time.sleep(0.02)
    return process


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
@pytest.mark.parametrize("way", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_keeps_what_was_done(tmp_path, capsys, way):
    out = tmp_path / "frames.jsonl"
    process = begun_export(long_bus(tmp_path, capsys), out, 1_000_000)
    process.send_signal(getattr(signal, way))
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert not [*tmp_path.glob(".frames*")]
    assert err == b"rtuscope: interrupted; partial output is kept\n"
    kept = out.read_text(encoding="utf-8").splitlines()
    assert kept
    assert kept[-1].endswith("}")


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_a_part_does_not_replace_a_whole_file(tmp_path, capsys):
    out = tmp_path / "frames.jsonl"
    out.write_text("whole\n")
    process = begun_export(long_bus(tmp_path, capsys), out, 1_000_000, "--overwrite")
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130 and b"frames.partial.jsonl; the file that was there stays" in err
    assert out.read_text() == "whole\n" and not [*tmp_path.glob(".frames*")]
    assert (tmp_path / "frames.partial.jsonl").read_text(encoding="utf-8").splitlines()[-1].endswith("}")


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_a_signal_before_anything_passes_a_filter_leaves_what_is_there(tmp_path, capsys):
    out = tmp_path / "frames.jsonl"
    out.write_text("precious")
    process = begun_export(long_bus(tmp_path, capsys), out, 0, "--overwrite", "--filter", "unit == 240")
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130 and b"frames.jsonl: not written" in err and err.count(b"\n") == 1
    assert [out.read_text(), *tmp_path.glob(".frames*")] == ["precious"]
    assert not list(tmp_path.glob(".frames*"))


@pytest.mark.skipif(os.name != "posix" or not os.path.exists("/dev/full"), reason="no /dev/full here")  # noqa: PTH110
@pytest.mark.parametrize(
    "arguments",
    [["parse", "11 03 00 6B 00 03 76 87"], ["demo"], ["completion", "bash"], ["--help"], ["demo", "--help"]],
)
def test_a_full_disk_behind_standard_output_is_one_line(arguments):
    with open("/dev/full", "wb") as full:  # noqa: PTH123
        done = subprocess.run(
            [sys.executable, "-c", START, *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            env=environment(),
            timeout=60,
        )
    assert done.returncode == 2
    assert done.stderr == b"rtuscope: standard output: no space left on device\n"


def test_a_terminal_without_our_characters_gets_twins_or_escapes():
    done = spawned("parse", "11 03 10" + " 00" * 16 + " 00 00", PYTHONIOENCODING="ascii")
    assert "defect" not in done.err
    assert done.out.isascii()


@pytest.mark.parametrize("page", ["cp866", "cp1251"])
def test_what_programs_read_is_utf8_whatever_the_code_page(page, tmp_path):
    chart = tmp_path / "счётчик.yaml"
    chart.write_text("registers: [{area: holding, address: 107, name: Ток≈, unit: °C}]", encoding="utf-8")
    for told in (
        ("replay", samples.path("healthy.jsonl"), "--speed", "max", "--json", "--map", f"{chart}@17"),
        ("replay", samples.path("healthy.jsonl"), "--speed", "max", "--influx", "--map", f"{chart}@17"),
        ("map", "show", chart, "--format", "yaml"),
        ("map", "show", chart, "--format", "csv"),
    ):
        done = spawned(*told, PYTHONIOENCODING=page)
        assert (done.status, done.err.count("defect")) == (0, 0), done
        assert "Ток≈" in done.raw.decode(), told


def test_a_word_that_is_no_command_says_what_to_do(capsys):
    assert refused(capsys, "exprot", "bus.jsonl") == "no command 'exprot': did you mean export?"
    assert "give a file, a port, bytes, or a command" in refused(capsys, "frobnicate")


def plug_in(folder: Path, group: str, name: str, source: str) -> None:
    """An installed package that offers something in an entry point group."""
    (folder / f"{name}.py").write_text(source, encoding="utf-8")
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{name} = {name}:OFFERED\n")


@pytest.mark.skipif(bool(sys.flags.ignore_environment), reason="this Python reads no PYTHONPATH")
def test_a_broken_plug_in_is_named_and_left_out_and_the_others_are_not(tmp_path: Path) -> None:
    plug_in(tmp_path, "rtuscope.functions", "broken_vendor", "1 / 0\n")
    good = "from construct import Pass\nfrom dissectors import Function\nOFFERED = Function(101, 'Good', Pass, Pass)\n"
    plug_in(tmp_path, "rtuscope.functions", "good_vendor", good)
    plug_in(tmp_path, "rtuscope.captures", "broken_format", "raise SystemExit('no license\\nfound')\n")
    paths = f"{tmp_path}{os.pathsep}{ROOT}"
    for arguments, status in ((("parse", "11 65 0B 1B"), 0), (("report", samples.path("healthy.jsonl")), 0)):
        done = spawned(*arguments, PYTHONPATH=paths)
        assert done.status == status, done
        vendor, *formats = done.err.splitlines()
        assert vendor == (
            "rtuscope: plug-in broken_vendor (broken_vendor:OFFERED) is skipped: ZeroDivisionError: division by zero"
        )
        assert all("plug-in broken_format (broken_format:OFFERED) is skipped: " in line for line in formats)
        assert bool(formats) == (arguments[0] == "report")  # formats of others are asked before our own
    assert "FC 101 (0x65) Good" in spawned("parse", "11 65 0B 1B", PYTHONPATH=paths).out
    (tmp_path / "what.xyz").write_bytes(b"\x00\x01")
    done = spawned("export", tmp_path / "what.xyz", PYTHONPATH=paths)
    assert done.status == 2 and len(done.err.splitlines()) == 3, done
    assert "plug-in broken_format (broken_format:OFFERED) is skipped: SystemExit: no license found" in done.err


def test_the_manual_page_is_the_parser_s():
    page = (ROOT / "docs" / "rtuscope.1").read_text(encoding="utf-8")
    assert page == man_page(), "python -m analyzer.cli.manpage > docs/rtuscope.1"
    assert all(f".SS rtuscope {name}" in page for name in COMMANDS)


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed")
def test_the_manual_page_has_no_mistakes():
    done = subprocess.run(["man", "-l", "--warnings", ROOT / "docs" / "rtuscope.1"], capture_output=True, text=True)
    assert done.stderr == ""
    assert "rtuscope export" in done.stdout


def test_flags_that_other_tools_use(capsys, tmp_path):
    bus, out = samples.path("troubled.jsonl"), tmp_path / "out.csv"
    assert ran(capsys, "export", "-r", bus, "-Y", "exception", "-w", out).status == 0
    assert out.read_text(encoding="utf-8") == ran(capsys, "export", bus, "--filter", "exception", "--format", "csv").out
    assert "-b/--baud: '1' is not a rate" in refused(capsys, "sniff", "/dev/nowhere", "-b", "1", "-P", "E")


def test_the_recorder_s_sample_and_the_workflows_are_what_they_should_be():
    compose = yaml.safe_load((ROOT / "packaging" / "compose.yaml").read_text(encoding="utf-8"))
    words = compose["services"]["recorder"]["command"].split()
    parser = Parser()
    add_arguments(parser, words[0])
    assert parser.parse_args(words[1:]).metrics == ("0.0.0.0", 9617)
    tests = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    versions = tests["jobs"]["tests"]["strategy"]["matrix"]["python"]
    assert versions == ["3.11", "3.12", "3.13", "3.14"]
    about = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.findall(r'"Programming Language :: Python :: (3\.\d+)"', about) == versions
    assert yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("flag", "text"), [("--rotate-size", "9" * 400 + "GB"), ("--keep", "9" * 400 + "d"), ("--baud", "9" * 5000)]
)
def test_numbers_beyond_all_bounds_are_one_line(capsys, tmp_path, flag, text):
    said = refused(capsys, "record", "/dev/nowhere", "-o", tmp_path / "bus.mcap", flag, text)
    assert flag in said and "defect" not in said


def test_a_wrong_value_of_many_is_one_short_line(capsys):
    done = ran(capsys, "simulate", "x.jsonl", "--defect", "foo")
    assert done.err == "rtuscope: argument --defect: invalid choice: 'foo' (see rtuscope simulate --help)\n"


def test_one_read_is_not_many(capsys, tmp_path):
    out, sample = tmp_path / "one.jsonl", samples.path("troubled.jsonl")
    assert ran(capsys, "convert", sample, "-o", out, "--frames", "10").out == f"{out}: 1 read, 8 bytes of the line\n"
    said = ran(capsys, "convert", sample, "-o", out, "--overwrite", "--lang", "ru").out
    assert said == f"{out}: 236 чтений, 1 590 байтов с линии\n"
