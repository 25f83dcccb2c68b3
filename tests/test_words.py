"""How people are spoken to: no turn of phrase that engineers stumble over, no sentence that one has to read twice.

English and Russian of the same texts: help, errors, findings, causes, reports.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from analyzer import languages
from analyzer.causes.registry import suspects
from analyzer.reference.causes import markdown as causes_page
from analyzer.reference.findings import markdown as findings_page
from analyzer.tables.findings import rules
from analyzer.words import between, compact, data_size, duration, percent, pointed_ms, rough_percent, short

ROOT = Path(__file__).resolve().parents[1]
LANGUAGES = ROOT / "analyzer" / "languages"
CATALOGUES = tuple(sorted(file.name[3:-5] or "ru" for file in LANGUAGES.glob("ru*.toml")))
LONGEST = 30  # words of a sentence
_SENTENCE = re.compile(r"(?<=[.;?!])\s+|:\s+")
_PLACE = re.compile(r"\{[^}]*\}")

OLD_TURNS = (
    "know whose it is", "what was done is kept", "tells the rest", "is among the findings", "so often: 1h",
    "give up files", "out of a spreadsheet", "what two maps have different", "which nothing here waits for",
    "it is listened to as it is", "its line settings count", "0 the least significant", "with it the CRC is right",
    "it answers otherwise", "a byte too many", "put back, the CRC", "and nobody asked it", "look at what became of",
    "that belong to no frame", "a gateway says it", "by default as it says itself", "speaks for itself",
    "what speaks for it", "a sick bus", "is there already", "is there no more", "there are no more",
    "goes with -", "says otherwise", "say otherwise", "says it all", "what came of it", "nobody takes",
    "before it said", "left as it was", "left alone", "taken away", "holds bytes back", "is wanted", "lasting name",
    "nothing is called", "if not given",
    "with TERM=dumb {", "which nobody", "begins anew", "made anew", "is told how",
)  # fmt: skip
NO_NOUN = re.compile(r"(?<!there )\b(?:is|are) no (?!longer\b|more\b)")  # "'x' is no number"
OLD_TURNS_RU = (
    "знайте, чей он", "истин", "находит на слух", "находятся на слух", "то же зерно", "спросить хранилище",
    "одна строка говорит почему", "попадани", "прослушк", "отвод", "больная шина", "верны её настройки", "CRC верен",
    "неверный CRC", "отовсюду", "ничто не называется", "скажет, что", "не говорят, кто", "там кончили",
    "что от них", "согласующего резистора или их", "кто достанет", "чем кончилось", "цела, но",
)  # fmt: skip


def _entries(name: str) -> Iterator[tuple[str, str]]:
    """English and Russian of a catalogue's entries whose key is the English text."""
    file = LANGUAGES / ("ru.toml" if name == "ru" else f"ru.{name}.toml")
    for table, entries in tomllib.loads(file.read_text(encoding="utf-8")).items():
        for english, russian in entries.items():
            if isinstance(russian, str):
                yield "" if table == "left" else english, russian
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
    assert not [text[max(0, found.start() - 40) :][:120] for text in texts for found in NO_NOUN.finditer(text)]


def test_old_turns_are_gone_in_russian() -> None:
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "ru").rglob("*.md")]
    texts = [russian for name in CATALOGUES for _, russian in _entries(name)]
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


def test_numbers_and_units_are_those_of_the_language() -> None:
    def told() -> list[str]:
        return [
            duration(31_300_000_000), duration(870_000), duration(100_000_000_000), between(9_100_000, 17_000_000),
            short(12_300_000), short(11_520 * 10**9), pointed_ms(4_210_000, 4_210_000), percent(0.004), compact(12_345),
            data_size(5_200), languages.fill("{load:.1%}, {waited_ms:ms}", {"load": 0.202, "waited_ms": 4.64}),
        ]  # fmt: skip

    english = told()
    assert english == [
        "31.3 s", "870 us", "1 min 40 s", "9.1..17 ms", "12.3ms", "3h12m", "    4.21 ", "0.4%", "12.3k", "5.2 kB",
        "20.2%, 4.64 ms",
    ]  # fmt: skip
    with languages.telling("ru"):
        assert told()[:-1] == [
            "31,3 с", "870 мкс", "1 мин 40 с", "9,1..17 мс", "12,3мс", "3ч12м", "    4,21 ", "0,4 %", "12,3к", "5,2 кБ",
        ]  # fmt: skip
        assert languages.page_words("{share:.1%} of the line's capacity", share=0.202).startswith("20,2 %")
        assert languages.filled("{waited_ms:ms}", {"waited_ms": 4.64}) == "4,64 мс"
        assert [percent(each) for each in (0, 0.0001, 0.123, 1)] == ["0 %", "<0,1 %", "12 %", "100 %"]
        assert [rough_percent(each) for each in (0, 0.001, 0.5)] == ["0 %", "<1 %", "50 %"]
        assert languages.page_words("{share:.0%} sure", share=1).endswith(" 100 %")  # of an integer, too
    assert told() == english


def test_a_russian_sentence_has_the_words_of_the_usage_line() -> None:
    """What stands for a value is `ФАЙЛ` in both; names of variables of the environment are names."""
    placeholders = [
        english for name in ("help", "agents", "twin") for english, _ in _entries(name) if english.isupper()
    ]
    assert {"FILE", "HOST", "PORT", "LAKE"} < {*placeholders}
    left = re.compile(rf"(?<![$\w])(?:{'|'.join(placeholders)})(?![\w=])")
    texts = [words for file in LANGUAGES.glob("ru*.toml") for words in _russian(file)]
    assert not [words for words in texts if left.search(words)]


_LATIN_UNIT = re.compile(r"[}\d] (?:ms|us|s|bit/s|Hz|kB|MB|MiB)(?![\w/-])")


def test_no_russian_sentence_has_a_latin_unit() -> None:
    texts = [words for file in LANGUAGES.glob("ru*.toml") for words in _russian(file) if "50 ms, а" not in words]
    assert len(texts) > 1500
    typed = "us, ms, s, min, h"  # what a filter takes
    assert not [words for words in texts if _LATIN_UNIT.search(words) and typed not in words]


def test_a_percent_sign_stands_as_each_language_has_it() -> None:
    """`20%`, and in Russian `20 %`; but for what one may type: `50%`, `silence@10%%`."""
    assert not [words for words in _english() if re.search(r"(?<!load < )[\d}] %(?!\w)", words)]
    texts = [words for file in LANGUAGES.glob("ru*.toml") for words in _russian(file)]
    tight = [words for words in texts if re.search(r"(?:\d|:g\}|:\.3g\}|\{\d\})%(?!%)(?![^{}]*\})", words)]
    assert all(re.search(r"\+200ms|например 50%", words) for words in tight) and tight


def _russian(file: Path) -> Iterator[str]:
    for table in tomllib.loads(file.read_text(encoding="utf-8")).values():
        for words in table.values():
            several = words.values() if isinstance(words, dict) else [words] if isinstance(words, str) else words
            yield from (each for each in several if isinstance(each, str))
