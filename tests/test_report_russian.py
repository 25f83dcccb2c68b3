"""The report in Russian: all that page and HTML ask the catalogue for is there, with the same figures."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Formatter

import pytest

import analyzer
import captures
from analyzer import languages
from analyzer.causes.registry import Suspect, suspects
from analyzer.cli import main
from analyzer.languages import cause_words, fill

SAMPLES = Path(captures.__file__).parent / "samples"
_REPORTS = Path(analyzer.__file__).parent / "reports"
_PAGES = (_REPORTS, _REPORTS.parent / "fleet" / "pages")
_PIECE = re.compile(r"""\bw\((?:"([^"]+)"|'([^']+)')""")


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


def _literals(name: str) -> Iterator[str]:
    """What the code of the report hands to a function of the catalogue, as it stands there."""
    sources = [path for folder in _PAGES for path in folder.rglob("*.py")]
    for path in (*sources, _REPORTS.parent / "outages.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name and node.args:
                for each in ast.walk(node.args[0]):
                    if isinstance(each, ast.Constant) and isinstance(each.value, str):
                        yield each.value


def _places(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def test_every_piece_of_the_report_is_in_the_catalogue() -> None:
    known = languages.catalogue("ru")["page"]
    templates = "".join(path.read_text(encoding="utf-8") for folder in _PAGES for path in folder.rglob("*.j2"))
    asked = {*_literals("page_words"), *(one or other for one, other in _PIECE.findall(templates))} - {": {words}"}
    assert len(asked) > 120
    assert not asked - set(known)
    for english, words in known.items():
        assert _places(words) <= _places(english), english


class _Asked(dict[str, str]):
    """A catalogue that knows what it was asked for in vain."""

    missed: set[str]

    def get(self, key: str, default: str = "") -> str:  # type: ignore[override]
        if key not in self and re.search(r"[A-Za-z]{3}", key):
            self.missed.add(key)
        return super().get(key, default)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> _Asked:
    words: Mapping[str, Mapping[str, str]] = languages.catalogue("ru")
    missed: set[str] = set()
    told: dict[str, object] = dict(words)
    for table in ("page", "counted", "findings"):
        told[table] = wary = _Asked(words[table])
        wary.missed = missed
    monkeypatch.setattr(languages, "catalogue", lambda language: told if language == "ru" else {})
    return wary


_MADE = (
    ("brutal", "precise", ""),
    ("hard", "ftdi16", ""),
    ("broadcast", "untimed", ""),
    ("clean", "irq", "slow-device"),
    ("clean", "precise", "late-response"),
    ("clean", "irq", "poll-waste"),
    ("clean", "irq", "other-protocol"),
)


@pytest.mark.parametrize(("wire", "tap", "defect"), _MADE)
def test_reports_ask_for_nothing_in_vain(tmp_path: Path, asked: _Asked, wire: str, tap: str, defect: str) -> None:
    capture, page = tmp_path / "bus.jsonl", tmp_path / "bus.html"
    fault = [f"--defect={defect}"] if defect else []
    assert main(["simulate", str(capture), "--wire", wire, "--tap", tap, "--seed", "3", *fault]) == 0
    assert main(["report", str(capture), "--lang", "ru", "--by", "hour"]) == 0
    assert main(["report", str(capture), "--lang", "ru", "--html", str(page)]) == 0
    assert main(["report", str(capture), "--lang", "ru", "--against", str(SAMPLES / "healthy.jsonl")]) == 0
    assert not asked.missed, asked.missed


def test_nouns_agree_with_their_number(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(SAMPLES / "troubled.jsonl"), "--lang", "ru"]) == 0
    page = capsys.readouterr().out
    assert "165: 112 запросов, 53 ответа; с неверной контрольной суммой: 13" in page
    assert "35 повторов" in page
    assert "потеряно: 3 ответа и 525 мс" in page
    assert "и ещё 1 вид или устройство (всё — в --json)" in page
    assert {len(line) for line in page.splitlines()} <= set(range(81))


@pytest.mark.parametrize("suspect", suspects(), ids=lambda suspect: suspect.cause)
def test_causes_agree_with_their_numbers(suspect: Suspect) -> None:
    languages.use_language("ru")
    for part, english in (("text", suspect.text), ("share", suspect.share), ("remedy", suspect.remedy)):
        for number in (1, 3, 21.0, 112):
            words = fill(cause_words(suspect.cause, part, english), dict.fromkeys(_places(english), number))
            assert "{" not in words and "|" not in words
            for noun in ("запрос", "ответ", "обмен"):
                for before, form in re.findall(rf"(из |из его |около |у )?\b{number:.0f} ({noun}\w*)", words):
                    assert (form[-2:] == "ов") == (number == 112 or (number == 3 and bool(before))), words
