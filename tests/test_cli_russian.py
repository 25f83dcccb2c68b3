"""One-line errors in Russian: what any floor raises has its words in the catalogue, and no English is left in them."""

from __future__ import annotations

import ast
import errno
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from running import spawned

import analyzer
import captures
import dissectors
from analyzer import languages
from analyzer.cli import main
from analyzer.cli.ports import port_lines
from analyzer.cli.taps import Teller
from analyzer.languages import retold
from analyzer.outages import Deaf, unheard
from captures.live.ports import PortInfo
from captures.live.tap import high_line_words, refusal

_PACKAGES = (analyzer, captures, dissectors)
_RAISED = re.compile(
    "(Cell|Usage|Check|Capture|Port|PortGone|TapSetup|Map|Export|Fleet|Notes|Limits|Paste|Panel|Settings|ValueForm|ArgumentType)Error$"
)
_INSIDE = ("fleet", "reference")  # a batch's own business, read by who runs it


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


def _template(node: ast.expr) -> str:
    """A text of the source with `⟨⟩` where something is filled in."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_template(part) for part in node.values)
    if isinstance(node, ast.BinOp):
        return _template(node.left) + _template(node.right)
    return "⟨⟩"


def _said() -> Iterator[str]:
    """What the source raises for people, or tells them."""
    for package in _PACKAGES:
        root = Path(str(package.__file__)).parent
        for path in root.rglob("*.py"):
            if path.relative_to(root).parts[0] in _INSIDE:
                continue
            tree = ast.parse(path.read_text(encoding="utf-8"))
            functions = {each.name: each for each in tree.body if isinstance(each, ast.FunctionDef)}
            for node in ast.walk(tree):
                if not isinstance(node, ast.Call):
                    continue
                name = str(getattr(node.func, "id", None) or getattr(node.func, "attr", ""))
                if name == "tell" and "cli" not in path.parts:
                    continue
                if (name in ("tell", "tell_user", "note") or _RAISED.search(name)) and node.args:
                    words = node.args[-1 if "ArgumentType" not in name else 0]
                    yield _template(words)
                    yield from _returned(words, functions)


def _returned(words: ast.expr, functions: dict[str, ast.FunctionDef]) -> Iterator[str]:
    """What functions of the same module return for a place in such words."""
    for call in ast.walk(words):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in functions:
            for node in ast.walk(functions[call.func.id]):
                if isinstance(node, ast.Return) and isinstance(node.value, ast.Constant | ast.JoinedStr):
                    yield _template(node.value)


_FLAGS = re.compile(r"--?[a-z][\w-]*|⟨⟩|\b(?:line|row|unit|function|recording|metrics|foxglove|standard output)\b")


_PORT = PortInfo("/dev/ttyUSB0", link="/dev/serial/by-id/x", latency_ms=16, used_by=["a (1)"], advice="`b`")


@pytest.mark.parametrize(
    "line",
    [
        *(
            refusal("/dev/ttyUSB0", OSError(code, "x"))
            for code in (errno.EBUSY, errno.EACCES, errno.ENOENT, errno.ENOTTY)
        ),
        *(f"/dev/ttyUSB0: {words}" for high in (None, ["RTS"], ["RTS", "DTR"]) for words in high_line_words(high)),
        "/dev/ttyUSB0: no permission: `sudo usermod -aG dialout $USER`, then log in again",
        "/dev/ttyUSB0: the adapter delays bytes by 16 ms, which hides gaps between frames: `echo 1`",
        "/dev/ttyUSB0: parity and framing errors cannot be seen here (x)",
        "listening: no rate to set",
        *map(str.strip, port_lines(_PORT)[1:]),
        "listening: 19200 8E1, as the port server is set",
        "the computer's clock was changed, or it slept: now +3600.000 s off the recorded times",
    ],
)
def test_what_a_port_is_told_of_is_whole_in_russian(line: str) -> None:
    languages.use_language("ru")
    left = re.sub(r"`[^`]*`|/\S+|docs/\S+", "", retold(line))
    assert re.search("[а-я]{3}", left), left
    assert not re.search(r"\b(?!RTS|DTR|udev|dialout|rtuscope)[A-Za-z]{3,}", left), left


def test_every_error_is_in_the_catalogue() -> None:
    languages.use_language("ru")
    said = {words for words in _said() if re.search("[a-z]{3}.* ", _FLAGS.sub("", words))}
    assert len(said) > 200
    missing = [words for words in said if not re.search("[а-я]{2}", retold(words.replace("⟨⟩", "'x 1'")))]
    assert not missing, missing


_TELLING = (
    "captures/recording/recorder.py", "analyzer/simulation/bus.py", "captures/live/tapserver.py",
    "captures/live/taproom.py",
)  # fmt: skip
_EVENTS = (
    "captures/live/reader.py", "captures/live/tap.py", "captures/live/gateway.py", "captures/live/tapviewer.py",
    "analyzer/live/tapsource.py", "analyzer/live/session.py",
)  # fmt: skip
_LAST_LINES = (
    "recorded 12 bytes of the line", "/dev/ttyX: no such port; `rtuscope ports` lists the ports", "recorded 12 bytes "
                                                                                                  "of the line, 3 "
                                                                                                  "deleted by someone, "
                                                                                                  "LOST 4",
    "mqtt: broker:1883: connected again", "/dev/ttyX: open", "/dev/ttyX: is back",
    "COM3: lost (closed by the other end)",
    "mqtt: broker:1883: connection lost; the latest states go out when it is back",
    "mqtt: broker:1883: cannot be reached (connection refused); the latest states go out when it is back",
    "mqtt: broker:1883: closed before it answered; with TLS it is mqtts://; the latest states go out when it is back",
    "mqtt: broker:8883: cannot be reached (its certificate is not trusted: self-signed certificate); "
    "SSL_CERT_FILE=FILE adds one to trust; the latest states go out when it is back",
    "mqtt: broker:1883: connected again; 27 older messages were dropped",
    "mqtt: broker:1883: not connected at the end, 4 messages were not sent; 6 older messages were dropped",
    "2 lines could not be shown",
)  # fmt: skip


def test_what_is_told_while_it_runs_and_at_its_end_is_in_the_catalogue() -> None:
    root, said = Path(str(analyzer.__file__)).parents[1], [*_LAST_LINES]
    for name in _TELLING:
        for node in ast.walk(ast.parse((root / name).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and (
                "tell" in ast.unparse(node.func) or "ValueError" in ast.unparse(node)[:10]
            ):
                said += [_template(each).replace("⟨⟩", "x 1") for each in node.args[:1]]
    for name in _EVENTS:
        for node in ast.walk(ast.parse((root / name).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and re.search("([eE]vent|notices.append)$", ast.unparse(node.func)):
                said += [words.replace("⟨⟩", "x 1") for each in node.args for words in _texts(each)]
    said = [words for words in said if re.search("[a-z]{3}.* ", words)]
    assert len(said) > 30
    languages.use_language("ru")
    missing = [words for words in said if not re.search("[а-я]{2}", retold(words))]
    assert not missing, missing


def test_a_session_tells_in_the_language_in_use(capfd: pytest.CaptureFixture[str]) -> None:
    languages.use_language("ru")
    with Teller() as tell:
        tell("/dev/ttyX: open")
        tell("listening: 19200 8N1")
    assert capfd.readouterr().err == "rtuscope: /dev/ttyX: открыт\nrtuscope: слушаю: 19200 8N1\n"


def _notices() -> Iterator[str]:
    """What captures say of how they were read."""
    for path in Path(str(captures.__file__)).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            said: list[ast.AST] = []
            if isinstance(node, ast.FunctionDef) and node.name == "notices":
                said = [each.value for each in ast.walk(node) if isinstance(each, ast.Yield) and each.value]
            elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign) and node.value is not None:
                target = ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target)
                said = [node.value] if re.search(r"\b(notices|told|_NOTICES)$|\[INFERRED\]$", target) else []
            elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("notices.append"):
                said = list(node.args)
            for each in said:
                yield from _texts(each)


def _texts(node: ast.AST) -> Iterator[str]:
    """The whole texts in an expression."""
    if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        yield _template(node)
    else:
        for child in ast.iter_child_nodes(node):
            yield from _texts(child)


def test_notices_of_captures_are_in_the_catalogue() -> None:
    said = {words.replace("⟨⟩", "x 1").replace("{}", "x 1") for words in _notices() if re.search("[a-z]{3}.* ", words)}
    assert len(said) > 10
    languages.use_language("ru")
    missing = [words for words in said if re.search("[a-z]{3,} [a-z]{3,}", retold(words)) or retold(words) == words]
    assert not missing, missing


def test_places_are_the_same() -> None:
    errors = languages.catalogue("ru")["errors"]
    assert len(errors) > 300
    for english, words in errors.items():
        known = set(re.findall(r"\{\d+\}", english))
        assert set(re.findall(r"\{\d+\}", words)) <= known == {f"{{{n}}}" for n in range(len(known))}, english


_COMMANDS = (
    "parse xx yy", "parse 11 03 0", "parse --foo", "parse --as foo", "parse --as rtuu 11", "parse --as", "parse -f",
    "parse -f {0}/none", "parse 1 2 3 4 5", "parse {0}", "open {0}/none", "open {0}", "open --plain", "report",
    "repord x", "foo", "help filtres", "report {0}/none --tz nowhere", "export {0}/none --filter unt==3",
    "export {0}/empty.bin", "report {0}/hex.txt", "convert {0}/a.jsonl", "sniff nowhere --baud x", "check {0}/none",
    "export --t15-ms nine {0}/none", "--baud 9600 report x", "report {0}/a.jsonl b.json", "config shw",
    "sniff {0}/a.jsonl", "sniff x --keep 7d",
)  # fmt: skip
_NAMES = re.compile(
    r"'[^']*'|\([\w, -]*\)|есть [\w, -]+|/\S*|--?[a-z][\w-]*|\brtuscope (?:--help|[a-z]+(?: [A-Z]+)?)|\b[A-Z]{2,}\b"
    r"|hex|Ctrl-\w|:1103…"
    r"|может быть, [\w-]+\?|Europe/Berlin|\blocal\b|\bauto\b|\bbit/s"
    r"|0x11|\\x\d+|\(11 03.*?\[43?\]\)|\((?:11 03|11)[^)]*\)|\bms\b|\.\w+"
)


@pytest.mark.parametrize("command", _COMMANDS)
def test_no_error_is_left_in_english(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty.bin").write_bytes(b"")
    (tmp_path / "hex.txt").write_text("nothing here\n")
    (tmp_path / "a.jsonl").write_text("{}\n")
    words = [word.format(tmp_path) for word in command.split()]
    assert main(["--lang", "ru", *words])
    line = capsys.readouterr().err
    assert line.startswith("rtuscope: ") and line.count("\n") == 1
    left = re.findall(
        r"[A-Za-z]{3,}",
        _NAMES.sub(" ", line.removeprefix("rtuscope: ").replace(str(tmp_path), "").replace(os.sep, "/")),
    )
    assert not left, line


@pytest.mark.parametrize(("page", "used"), [("cp1252", "utf-8"), ("cp1251", "cp1251")])
def test_a_code_page_without_the_letters_gives_no_escapes(page: str, used: str) -> None:
    done = spawned("parse", "11 03 06 AE 41 56 52 43 40 49 AE", "--lang", "ru", PYTHONIOENCODING=page)
    assert "регистра: 44609" in done.raw.decode(used) and b"\\u" not in done.raw


def test_the_environment_s_language_tells_errors_too(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RTUSCOPE_LANG", "ru")
    assert main(["report", "x", "--lang", "de"]) == 2
    assert "такого значения нет: 'de'" in capsys.readouterr().err
    assert main(["report"]) == 2
    assert capsys.readouterr().err == "rtuscope: не хватает: ЗАПИСЬ (подробнее: rtuscope report --help)\n"
    assert main(["repord"]) == 2
    assert capsys.readouterr().err == "rtuscope: нет команды 'repord': может быть, report?\n"


def test_data_and_names_stay_as_they_are() -> None:
    languages.use_language("ru")
    assert retold("a file: b.csv: no such file") == "a file: b.csv: нет такого файла"
    assert retold("anything else: at all") == "anything else: at all"
    assert retold("x: " * 5000) == "x: " * 5000
    languages.use_language("en")
    assert retold("b.csv: no such file") == "b.csv: no such file"


def test_what_a_batch_came_to_is_told_in_russian(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyarrow", reason="lakes need pyarrow")
    from analyzer.cli.batch import tell_result
    from analyzer.fleet.batch import BatchResult
    from analyzer.fleet.packs import LakePacking

    languages.use_language("ru")
    tell_result(BatchResult(lines=2, captures=3, frames=1_200, octets=9_600_000, skipped=1, damaged=2, seconds=0.5))
    tell_result(BatchResult(packed=LakePacking(12, 2)))
    said = capsys.readouterr().out.splitlines()
    assert (
        said[0]
        == "принято: 3 записи, 2 линии, из них повреждённых: 2, уже были: 1; 1 200 кадров, с линии 9,6 МБ за 0,5 с"
    )
    assert said[2] == "малых файлов хранилища было 12, стало 2"


def test_lines_of_several_templates_are_told_by_the_one_that_says_all() -> None:
    languages.use_language("ru")
    for english, russian in (
        ("/tmp/a.mcap: not a capture but an ELF program", "/tmp/a.mcap: не запись, а программа (ELF)"),
        (
            "x: not a capture but a Parquet table: open the capture it was made from",
            "x: не запись, а таблица Parquet: откройте запись, из которой она сделана",
        ),
        (
            "'foo' is unknown; rtuscope help findings lists all codes",
            "неизвестно, что такое 'foo'; все коды: rtuscope help findings",
        ),
        (
            "no format 'foo'; formats: csv, jsonl (by suffix or --format)",
            "нет формата 'foo'; форматы: csv, jsonl (по расширению или --format)",
        ),
        ("/dev/null: not a serial port", "/dev/null: не последовательный порт"),
        ("/tmp/a: 1,590 bytes sent", "/tmp/a: отправлено байтов: 1 590"),
    ):
        assert retold(english) == russian


@pytest.mark.skipif(os.name != "posix", reason="the language of Windows is not the environment's")
@pytest.mark.parametrize(
    ("locale", "arguments", "word"),
    [
        ({"LANG": "ru_RU.UTF-8"}, [], "запрос"),
        ({"LANG": "ru_RU.UTF-8", "LC_ALL": "C"}, [], "request"),
        ({"LANG": "de_DE.UTF-8"}, [], "request"),
        ({"LANG": "ru_RU.UTF-8"}, ["--lang", "en"], "request"),
        ({"LANG": "ru_RU.UTF-8", "RTUSCOPE_LANG": "en"}, [], "request"),
    ],
)
def test_the_system_says_the_language_where_nobody_else_does(
    locale: dict[str, str],
    arguments: list[str],
    word: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("LC_ALL", "LC_MESSAGES", "LANG", "RTUSCOPE_LANG"):
        monkeypatch.delenv(name, raising=False)
    for name, value in locale.items():
        monkeypatch.setenv(name, value)
    assert main(["parse", *arguments, "01 03 00 00 00 01 84 0A"]) == 0
    assert word in capsys.readouterr().out


def test_a_time_in_which_nothing_was_heard_is_whole_in_russian() -> None:
    languages.use_language("ru")
    told = unheard(Deaf(1_763_121_886_000_000_000, None, "/dev/ttyX: lost (closed by the other end, or unplugged)"))
    assert told.endswith("UTC до конца: /dev/ttyX: пропал (закрыто другой стороной или отключено)")
