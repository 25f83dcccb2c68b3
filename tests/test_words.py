"""How people are spoken to: no turn of phrase that engineers stumble over, no sentence that one has to read twice.

English and Russian of the same texts: help, errors, findings, causes, reports.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from analyzer.causes.registry import suspects
from analyzer.reference.causes import markdown as causes_page
from analyzer.reference.findings import markdown as findings_page
from analyzer.tables.findings import rules

ROOT = Path(__file__).resolve().parents[1]
LANGUAGES = ROOT / "analyzer" / "languages"
CATALOGUES = ("help", "errors", "findings", "report")
LONGEST = 30  # words of a sentence
_SENTENCE = re.compile(r"(?<=[.;?!])\s+|:\s+")
_PLACE = re.compile(r"\{[^}]*\}")

OLD_TURNS = (
    "know whose it is", "what was done is kept", "tells the rest", "is among the findings", "so often: 1h",
    "give up files", "out of a spreadsheet", "what two maps have different", "which nothing here waits for",
    "it is listened to as it is", "its line settings count", "0 the least significant", "with it the CRC is right",
    "it answers otherwise", "a byte too many", "put back, the CRC", "and nobody asked it", "look at what became of",
    "that belong to no frame", "a gateway says it", "by default as it says itself", "speaks for itself",
    "what speaks for it", "a sick bus",
)  # fmt: skip
OLD_TURNS_RU = (
    "знайте, чей он", "истин", "находит на слух", "находятся на слух", "то же зерно", "спросить хранилище",
    "одна строка говорит почему", "попадани", "прослушк", "отвод", "больная шина", "верны её настройки", "CRC верен",
    "неверный CRC",
)  # fmt: skip


def _entries(name: str) -> Iterator[tuple[str, str]]:
    """English and Russian of a catalogue's entries whose key is the English text."""
    file = LANGUAGES / ("ru.toml" if name == "ru" else f"ru.{name}.toml")
    for table in tomllib.loads(file.read_text(encoding="utf-8")).values():
        for english, russian in table.items():
            if isinstance(russian, str):
                yield english, russian
            elif isinstance(russian, dict):
                yield from (("", each) for each in russian.values() if isinstance(each, str))


def _english() -> Iterator[str]:
    for name in CATALOGUES:
        yield from (english for english, _ in _entries(name))
    for rule in rules():
        yield rule.when
    for suspect in suspects():
        yield from (suspect.text, suspect.share, suspect.deciding_test, suspect.remedy)


def _sentences(text: str) -> list[str]:
    return _SENTENCE.split(_PLACE.sub("N", text))


def test_old_turns_are_gone_in_english() -> None:
    texts = [*_english(), (ROOT / "README.md").read_text(encoding="utf-8"), findings_page(), causes_page()]
    assert len(texts) > 900
    assert not [(turn, text[:200]) for turn in OLD_TURNS for text in texts if turn in text]


def test_old_turns_are_gone_in_russian() -> None:
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "ru").rglob("*.md")]
    texts = [russian for name in (*CATALOGUES, "ru") for _, russian in _entries(name)]
    texts += [*pages, (ROOT / "docs" / "ru.md").read_text(encoding="utf-8")]
    assert len(texts) > 900
    assert not [(turn, text[:200]) for turn in OLD_TURNS_RU for text in texts if turn in text.replace("отводит", "")]


def test_no_sentence_is_longer_than_one_breath() -> None:
    long = [sentence for text in _english() for sentence in _sentences(text) if len(sentence.split()) > LONGEST]
    assert not long


@pytest.mark.parametrize("name", CATALOGUES)
def test_neither_is_one_in_russian(name: str) -> None:
    found = [sentence for _, text in _entries(name) for sentence in _sentences(text)]
    assert found
    assert not [sentence for sentence in found if len(sentence.split()) > LONGEST]
