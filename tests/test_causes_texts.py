"""What is said of causes reads well: nouns agree, nothing is counted of nobody, no word of English in Russian."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from analyzer import languages
from analyzer.causes.foreignframes import PROTOCOLS
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause, suspects
from analyzer.core import analyse
from analyzer.languages import CLAUSE, fill
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture
from captures.line import LineSettings

_CASES = (
    *(
        "dead-unit",
        "converter-gaps",
        "null-suffix",
        "unit-too-fast",
        "duplicate-address",
        "vendor-transfer",
        "emi-drive",
    ),
    *("tap-one-direction", "unit-line-settings", "bias", "missing-registers", "frozen-values", "rest-too-short-called"),
    *("word-order", "counter-torn", "values-stall", "value-lost", "values-changed", "counted-in-bytes"),
)
_SILLY = re.compile(
    r"\b0 (of|из) 0\b|(?<!unit )(?<![.\d])1 [a-z]+s\b|\bunits \d+\b(?!,)|\b([^\W\d]+) \2\b|  |, ,|\(\)|None|[][{}|]"
)
_ENGLISH = re.compile(r"\b(?!Modbus|BACnet|HDLC|DLMS|COSEM|UART|MODBUS|MAXIM|KERMIT|CRC)[A-Za-z]{4,}")


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


@pytest.mark.parametrize(
    ("template", "told"),
    [
        ("{units:Unit|Units} {units:|answers|answer}", "Units 1, 2, 3 answer"),
        ("{one:Unit|Units} {one:|answers|answer}", "Unit 7 answers"),
        ("{hits} of {answers:answer|answers}", "1 of 21 answers"),
        ("{hits:ответ|ответа|ответов} {hits:|пришёл|пришли|пришло}", "1 ответ пришёл"),
        ("{answers:ответ|ответа|ответов}, {few:ответ|ответа|ответов}", "21 ответ, 3 ответа"),
        ("all[, {hits} of {others} others]", "all"),
        ("all[, {none} of {answers} others][ of {nobody:unit|units}]", "all, 0 of 21 others"),
        ("set[ by {drift:+.0%}]", "set by -5%"),
    ],
)
def test_templates_agree_and_leave_out_what_says_nothing(template: str, told: str) -> None:
    numbers = {"units": (1, 2, 3), "one": (7,), "nobody": (), "hits": 1, "answers": 21, "few": 3, "drift": -0.05}
    numbers |= {"others": 0, "none": 0}
    assert fill(template, numbers) == told


@pytest.mark.parametrize("suspect", suspects(), ids=lambda suspect: suspect.cause)
def test_a_share_of_others_is_a_clause(suspect: object) -> None:
    """Where there are no others, nothing is counted of them."""
    words = languages.catalogue("ru")["causes"][suspect.cause]  # type: ignore[attr-defined]
    for english, part in ((suspect.text, "text"), (suspect.share, "share")):  # type: ignore[attr-defined]
        for template in (english, words[part]):
            assert "{others_" not in CLAUSE.sub("", template)
            assert len(CLAUSE.findall(english)) == len(CLAUSE.findall(words[part]))


def _sentences(cause: Cause) -> list[str]:
    return [cause.text, cause.share, cause.deciding_test, cause.remedy]


@pytest.mark.parametrize("name", _CASES)
def test_sentences_of_field_cases(name: str) -> None:
    made = field_cases()[name].capture("precise", 4)
    capture = Capture.of(made.line, made.chunks)
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    said = [sentence for cause in causes_of(ledger) for sentence in _sentences(cause)]
    assert said
    assert not [sentence for sentence in said if _SILLY.search(sentence)]
    languages.use_language("ru")
    russian = [sentence for cause in causes_of(ledger) for sentence in (cause.text, cause.share)]
    assert not [sentence for sentence in russian if _SILLY.search(sentence) or _ENGLISH.search(sentence)]


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"baud": 9600, "char_bits": 11}, "than the line (9600 bit/s, 11-bit characters):"),
        ({"baud": 9600, "char_bits": 11, "parity": "E"}, "than the line (9600 8E1):"),
        ({"char_bits": 11}, "than the line:"),
    ],
)
def test_settings_of_a_unit_stand_beside_those_of_the_line(known: dict[str, Any], said: str) -> None:
    made = field_cases()["unit-line-settings"].capture("precise", 4)
    line = LineSettings(**known)
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(Capture.of(line, made.chunks))), line)
    assert said in causes_of(ledger)[0].text


def test_names_of_protocols_are_told_in_russian() -> None:
    told = languages.catalogue("ru")["fragments"]
    assert not [name for name in PROTOCOLS if re.search(r"\b[a-z]{4,}", name) and name not in told]


def test_a_bus_of_one_unit_that_falls_silent_has_no_others() -> None:
    demo = "{silent} of {asked} requests to units {list}[, {others_silent} of {others_asked} to others]"
    numbers = {"silent": 45, "asked": 105, "list": (1, 2, 9, 17), "others_silent": 0, "others_asked": 0}
    assert fill(demo, numbers) == "45 of 105 requests to units 1, 2, 9, 17"
