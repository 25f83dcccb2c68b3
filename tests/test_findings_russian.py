"""Findings in Russian: no piece of what any of them says is left in English, whatever its figures."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from string import Formatter

import pytest

import analyzer
from analyzer import languages
from analyzer.diagnosis.rules.noise import Pattern
from analyzer.tables.findings import Rule, codes, rules
from dissectors.foreign import NAMES
from dissectors.functions import exception_name, function_code, function_name

_RULES = Path(analyzer.__file__).parent / "diagnosis" / "rules"
_SWEEP = (0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 21, 90, 130, 255)
_TERMS = re.compile(
    "|".join(
        re.escape(name)
        for number in range(256)
        for name in (function_name(number), function_code(number), exception_name(number))
        if name
    )
    + r"""
    | \b(?:us|ms|min)\b | stty\ .*\b | latency[_ ]timer | low-latency\ mode | --functions
    | CRC-16/[\w-]+ | \bt[13]\.5\b | \b[0-9A-F]{2,4}\b
    | \b(?:CRC|LRC|UART|XON|XOFF|FIFO|DMA|USB|FTDI|Modbus|RTU|TCP|coil)\b
    | \b(?:HDLC|DLMS|COSEM|IEC|DL/T|DCON|NMEA|GPS|BACnet|MS/TP|LIN|MIDI|M-Bus|ASCII)\b
    """,
    re.VERBOSE,
)


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


def _figures(rule: Rule) -> Iterator[dict[str, float]]:
    """Evidence that this finding may come with: each figure in turn swept, or left out where it may be unknown."""
    usual = dict.fromkeys(rule.numbers, 1.0)
    yield usual
    for name in rule.numbers:
        yield {other: 1.0 for other in rule.numbers if other != name}
        for value in _SWEEP:
            yield {**usual, name: float(value)}


def _said(rule: Rule, numbers: Mapping[str, float]) -> list[str]:
    """What it says of them; nothing where such figures make no finding (its declaration has no words for them)."""
    try:
        return [rule.words(words, numbers) for words in (rule.text, rule.cause, rule.remedy)]
    except (KeyError, IndexError, ValueError):
        return []


@pytest.mark.parametrize("rule", rules(), ids=lambda rule: rule.code)
def test_no_finding_is_left_in_english(rule: Rule) -> None:
    heard = 0
    for numbers in _figures(rule):
        languages.use_language("en")
        english = _said(rule, numbers)
        languages.use_language("ru")
        russian = _said(rule, numbers)
        assert len(russian) == len(english)
        heard += bool(russian)
        for before, words in zip(english, russian, strict=True):
            left = set(re.findall(r"[A-Za-z-]{2,}", _TERMS.sub(" ", words))) - set(codes())
            assert not left, f"{left} in {words!r}"
            assert words != before or not before
            assert "{" not in words
    assert heard >= min(2, 1 + len(rule.numbers))


def _pieces() -> Iterator[str]:
    """What the rules hand to the catalogue, as it stands in their source."""
    for path in _RULES.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                continue
            if node.func.id in ("phrase", "partial") and node.args:
                for each in ast.walk(node.args[0 if node.func.id == "phrase" else 1]):
                    if isinstance(each, ast.Constant) and isinstance(each.value, str) and " " in each.value:
                        yield each.value
    for rule in rules():
        yield from (words for words in (rule.text, rule.cause, rule.remedy) if isinstance(words, str) and words)


def _places(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def test_every_piece_is_in_the_catalogue_with_the_same_figures() -> None:
    known, pieces = languages.catalogue("ru")["findings"], set(_pieces())
    assert len(pieces) > 120
    assert not pieces - set(known)
    for english, words in known.items():
        assert _places(words) == _places(english), english


def test_nouns_and_senders_agree() -> None:
    languages.use_language("ru")
    by_code = {rule.code: rule for rule in rules()}
    noise = by_code["noise"]
    after = {"pattern": float(Pattern.AFTER), "bytes": 2.0, "unit": 7.0}
    assert noise.words(noise.text, after) == "00 или FF вплотную за кадром устройства 7: 2 байта"
    assert "передатчик клиента" in noise.words(noise.cause, {"pattern": float(Pattern.AFTER), "bytes": 1.0})
    cut = by_code["truncated"]
    said = cut.words(cut.text, {"bytes": 5.0, "due": 21.0})
    assert said == "кадр оборван: начинается как кадр длиной 21 байт, а пришло 5 байтов"
    other = by_code["other-protocol"]
    assert other.words(other.text, {"protocol": NAMES.index("HDLC (DLMS/COSEM meters)"), "bytes": 1.0}) == (
        "другой протокол, HDLC (счётчики DLMS/COSEM): 1 байт; это не Modbus и не неисправность"
    )


def test_who_asks_and_who_answers_have_one_name() -> None:
    """A client asks a device, which is a server; other names only where the glossary explains them."""
    others = re.compile("мастер|ведущ|ведом|слейв", re.IGNORECASE)
    root = Path(__file__).parent.parent
    pages = [*(root / "analyzer" / "languages").glob("ru*.toml"), *(root / "docs" / "ru").rglob("*.md")]
    assert len(pages) > 10
    found = [
        line
        for page in [*pages, root / "docs" / "ru.md"]
        for line in page.read_text(encoding="utf-8").splitlines()
        if others.search(line) and not line.startswith("| client, server |")
    ]
    assert not found
