"""The interface in Russian: one catalogue holds every word of it, and no English is left on a screen."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from string import Formatter

import pytest
from pictures import compare
from seats import Seat, opened, sample_in, using

import analyzer
import captures
from analyzer import languages, paste
from analyzer.causes.registry import suspects
from analyzer.filters import FilterError, compile_filter
from analyzer.filters.completion import complete
from analyzer.languages import counted, page_words, tr
from analyzer.model import search
from analyzer.model.bus import Bus
from analyzer.model.source import CaptureSource
from analyzer.model.spoken import spoken
from analyzer.paste import tree
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.pastepane import PasteText
from analyzer.tui.registerlist import RegisterList
from captures.line import LineSettings
from dissectors.functions import functions

_PARTS = ("tui", "model", "filters", "live", "paste", "cli")
_SOURCES = [path for part in _PARTS for path in (Path(analyzer.__file__).parent / part).glob("*.py")]
_PASTED = "11 03 00 6B 00 03 76 87"
_TERMS = re.compile(
    r"""
    [a-z]+(?:_[a-z]+)+ | [a-z]+(?:-[a-z]+)+                 # names of fields, codes of findings
    | (?:Read|Write|Mask|Diagnostics|Report|Get|Encapsulated)\b.*   # functions, as the specification calls them
    | \b(?:CRC|LRC|UART|ADU|PDU|TCP|RTU|ASCII|Modbus|UTC|MHz|bit|s)\b
    | \b(?:[NEO]\d?|p50|p95|R|W)\b
    | \b(?:Esc|Tab|Enter|Ctrl|Shift|Space|Home|End|PgUp|PgDn|Alt|F1|palette|space)\b
    | \b\d+(?:\.\d+)?(?:us|ms|s|m\d+s|h\d+m|d|k|M|MB)\b | \b(?:us|ms|kB|MB|min|h|d)\b
    | \b[uisf]\d+(?:\s[A-D]{2,8})?\b
    | \b(?:hex|float|text|bits|Python|rtuscope|parse|fromhex|bytes\.|C|OSC|coil|on|off)\b
    | \bt[13]\.5\b | \b[0-9A-F]{2}\b | 0x[0-9A-F]+
    """,
    re.VERBOSE,
)


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def _calls(name: str) -> Iterator[tuple[str, ast.Call]]:
    for path in _SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == name:
                yield path.name, node


def _empty_lists() -> Iterator[str]:
    """What lists say that hold nothing."""
    for path in _SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "EMPTY" and (said := _text(node.value)):
                yield said


def _text(node: ast.expr) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _places(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def _parts(template: str) -> list[tuple[str, str]]:
    return [(name, noun or "") for _, name, noun, _ in Formatter().parse(template) if name]


@pytest.mark.parametrize("language", [each for each in languages.LANGUAGES if each != "en"])
def test_every_word_of_the_interface_is_in_the_catalogue(language: str) -> None:
    known = languages.catalogue(language)
    words = {text: call for _, call in _calls("tr") if (text := _text(call.args[0]))}
    assert len(words) > 200
    assert not {*words, *_empty_lists()} - set(known["interface"])
    for english, call in words.items():
        if call.keywords:
            given = {keyword.arg for keyword in call.keywords}
            assert _places(known["interface"][english]) <= given, english
    nouns = {text for _, call in _calls("counted") if (text := _text(call.args[1]))}
    assert nouns and not nouns - set(known["counted"])
    assert all(len(forms) == 3 for forms in known["counted"].values())


def test_frames_of_every_function_are_told_in_the_catalogue_s_words() -> None:
    known = languages.catalogue("ru")
    templates = {
        words for each in functions().values() for side in ("request", "response") for words in each.words(side)
    }
    assert len(templates) > 25
    assert not templates - set(known["frames"])
    for english in templates:
        assert sorted(_parts(english)) == sorted(_parts(known["frames"][english]))
    nouns = {noun for english in templates for _, noun in _parts(english) if noun}
    assert nouns and not nouns - set(known["counted"])


def test_a_frame_is_told_and_found_in_russian(capture: Path) -> None:
    bus = Bus.of(source := CaptureSource(captures.open(capture), "bus"))
    for analysed in source.steps(bool):
        bus.feed(analysed)
    languages.use_language("ru")
    row = next(row for row in range(bus.count) if bus.frame(row).function == 3)
    assert bus.frame(row).summary(languages.wording()) == "читать 3 регистра хранения с 107 (40108)"
    assert bus.frame(row).summary() == "read 3 holding registers from 107 (40108)", "for scripts it stays English"
    assert search.find(bus, search.for_text("регистра хранения"), -1) == row
    assert search.find(bus, search.for_text("holding"), -1) == row


def test_a_paste_is_told_in_russian(asked: _Asked) -> None:
    languages.use_language("ru")
    cut = tree(paste.read("11 03 00 6B 00 03"))
    assert "запрос    устройство 17: читать 3 регистра хранения с 107 (40108)" in cut
    assert cut.splitlines()[0] == "RTU: похоже по заголовку; конец с CRC обрезан, заголовка MBAP нет"
    whole = tree(paste.read(_PASTED)).splitlines()[0]
    assert whole == "RTU: CRC верна на ожидаемой длине, 1 кадр на все 8 байтов"
    assert "! обрезан: не хватает 2 байтов, это CRC; кадр целиком: 11 03 00 6B 00 03 76 87" in cut
    wrong = tree(paste.read("11 03 00 6B 00 03 76 87 11 03 06 AE 41 56 52 43 40 49 AE"))
    assert "CRC неверна: принята 49 AE, вычислена 49 AD" in wrong and "\n  вероятно: " in wrong
    assert not asked.missed, asked.missed


def test_nouns_in_templates_agree_with_their_number() -> None:
    languages.use_language("ru")
    told = [tr("{some:,} of {all:,} rows shown", some=0, all=rows) for rows in (1, 2, 3432)]
    assert told == ["показано 0 из 1 строки", "показано 0 из 2 строк", "показано 0 из 3 432 строк"]
    english = "{bad} of {all} requests without a good answer"
    assert page_words(english, bad=1, all=391) == "1 из 391 запроса без корректного ответа"


def test_nouns_agree_with_their_number() -> None:
    languages.use_language("ru")
    said = [counted(number, "byte", "bytes") for number in (1, 2, 5, 11, 12, 21, 22, 111, 1_003)]
    assert said == [
        "1 байт", "2 байта", "5 байтов", "11 байтов", "12 байтов", "21 байт", "22 байта", "111 байтов", "1 003 байта",
    ]  # fmt: skip
    languages.use_language("en")
    assert (counted(1, "byte", "bytes"), counted(2, "byte", "bytes"), tr("Home")) == ("1 byte", "2 bytes", "Home")


class _Asked(dict[str, str]):
    """A catalogue that knows what it was asked for in vain."""

    def __init__(self, words: Mapping[str, str]) -> None:
        super().__init__(words)
        self.missed: set[str] = set()

    def get(self, key: str, default: str = "") -> str:  # type: ignore[override]
        if key not in self and re.search(r"[A-Za-z]{3}", key):
            self.missed.add(key)
        return super().get(key, default)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> _Asked:
    words = languages.catalogue("ru")
    asked = _Asked(words["interface"])
    told = {**words, "interface": asked}
    monkeypatch.setattr(languages, "catalogue", lambda language: told if language == "ru" else {})
    return asked


def _english_left(shown: str, foreign: Callable[[str], str]) -> list[str]:
    """Latin words that are neither terms nor data."""
    left = []
    for line in shown.splitlines():
        rest = _TERMS.sub(" ", foreign(line))
        left += [f"{word} in {line.strip()}" for word in re.findall(r"\b[A-Za-z]{2,}\b", rest)]
    return left


_WRONG = (
    "unit = = 3", "unt == 3", "retries", "unit == 3.5", "unit == 999", "index in 5..1", "unit contains 3", "gap > 5",
    "gap > x", "crc_ok == 1", "finding == 7", "finding == crc-eror", "severity == 9", "hex contains abc",
    "hex == 03 ms", 'hex contains "0"', 'text contains ""', "time > 3 chars", 'time > "yesterday"', "register == 00108",
    "bit == 40108", "address == 4x108", "register in 40108..30109", 'value("Voltage") > 3', 'name contains "V"',
    'sum("x") > 3', 'unit == "17', "(" * 60 + "unit" + ")" * 60, "unit == 3 or", "x" * 5000, "confidence == 1.5",
    "text == 3..4", "register == 49999999", "unit 3",
)  # fmt: skip
_BEGUN = (
    "",
    "unit ",
    "unit == 3 ",
    "finding == ",
    "gap > 3 ",
    "hex ",
    "function == ",
    "crc_ok == ",
    "time > 5 ",
    "not ",
)


@pytest.mark.parametrize("text", _WRONG)
def test_what_is_wrong_with_a_filter_is_told_in_russian(asked: _Asked, text: str) -> None:
    languages.use_language("ru")
    with pytest.raises(FilterError) as caught:
        compile_filter(text, LineSettings())
    assert re.search("[а-я]{3}", caught.value.message)
    assert str(caught.value).startswith("место ")
    assert not asked.missed - {"'contains'", "'and'"}, asked.missed


def test_what_could_be_typed_next_is_told_in_russian(asked: _Asked) -> None:
    languages.use_language("ru")
    offers = [offer for text in _BEGUN for offer in complete(text, len(text))]
    assert {"unit", "==", "chars", "and", "crc-error"} <= {offer.text.strip('"') for offer in offers}
    assert all(not offer.help or re.search("[а-я]", offer.help) for offer in offers)
    assert not asked.missed, asked.missed


def test_a_capture_is_spoken_in_russian(capture: Path, asked: _Asked) -> None:
    languages.use_language("ru")
    lines = list(spoken(CaptureSource(captures.open(capture), "bus"), "unit < 99"))
    assert lines[1] == "3 причины."
    assert any("устройство 2 не ответило за" in line for line in lines)
    assert not asked.missed, asked.missed


_PROMPTS = ("g", "f", "T", "S", "C", "equals_sign", "y", "e", "semicolon", "M", "ctrl+o", "question_mark", "ctrl+p")


def test_no_english_is_left_on_a_screen(capture: Path, asked: _Asked) -> None:
    languages.use_language("ru")

    def foreign(line: str) -> str:
        """Without what is data or of another layer: the file, filters, findings' own texts, fields' names."""
        line = re.sub(r"troubled\S*|frames\.csv|/\S*|unit ==[^│]*|'[^']*'", " ", line)
        line = re.sub("|".join(suspect.cause for suspect in suspects()), " ", line)
        line = re.sub("(no-response|retry): ", " ", line)  # codes of findings
        return re.sub(r"(?<=[а-яё│]) [a-z][a-z ,]+\d.*$", " ", line)

    async def work(sitting: Seat) -> None:
        left: list[str] = []
        for view in "0124568":
            await sitting.press(view)
            if view == "0":
                await sitting.until(lambda: "объясня" in sitting.shown())
            if view == "5":
                await sitting.until(lambda: "показани" in sitting.shown())
                assert sitting.screen.query_one(RegisterList).count()
            if view == "8":
                sitting.screen.query_one(PasteText).load_text(_PASTED)
                sitting.screen.query_one("#pieces").focus()
                await sitting.settle()
            lines = sitting.shown().splitlines()
            # what a frame says is Modbus; the lists' heads, the footer and the line of state are ours
            ours = "\n".join([*lines[:3], *lines[-2:]]) if view in "128" else "\n".join(lines)
            left += _english_left(ours, foreign)
            assert len(lines[0].rstrip()) <= 120 and "Обзор" in lines[0]
        assert not left, "\n".join(left)
        await sitting.press("1", "home")
        for key in _PROMPTS:
            await sitting.press(key)
            if len(sitting.app.screen_stack) > 1:
                await sitting.press("escape")
        for key in ("m", "m", "u", "n", "escape", "r", "r", "t", "z", "z", "d", "d", "P", "c", "2", "w", "right"):
            await sitting.press(key)
        sitting.screen.query_one(FilterBar).use_filter("unit == 99")
        await sitting.settle()
        for view in "01234567":
            await sitting.press(view)
        for key in ("/", "u"):
            await sitting.press({"/": "slash"}.get(key, key))
        assert not asked.missed, asked.missed

    using(opened(capture), work, size=(120, 40), view=None)


@pytest.mark.parametrize("width", [40, 80, 120])
def test_russian_fits_where_english_does(capture: Path, width: int) -> None:
    languages.use_language("ru")

    async def work(sitting: Seat) -> None:
        for view in "012345678":
            await sitting.press(view)
            lines = sitting.shown().splitlines()
            assert {len(line) for line in lines} == {width}, view
            assert view in lines[0], "each tab has its number in sight"

    using(opened(capture), work, size=(width, 24))


def test_home_looks_as_it_did_in_russian(capture: Path) -> None:
    languages.use_language("ru")

    async def work(sitting: Seat) -> None:
        await sitting.press("0")
        await sitting.until(lambda: "объясня" in sitting.shown())
        compare("home-80x24-russian", sitting.screen)

    using(opened(capture), work, size=(80, 24), view=None)
