"""The language in which reports and causes are told: one catalogue a language, English being the words in the code.

A catalogue is the TOML files of this package that begin with the language's name: `page` (words of the report, by
their English), `fragments` (words that are filled into others), `causes` (by id: text, share, test, remedy), `left`
(what no cause takes), `findings` (pieces of what findings say, by their English), `frames` (templates of what a frame
and its fields say), `fields` (names of fields), `errors` (templates of one-line errors), `interface` (words of the
interface), `registers` (what registers mean, and their maps), `columns` (of maps), `units` (of
measure) and `counted` (nouns behind a number, by their English singular, in all their forms). What a catalogue lacks
is told in English.

Templates of sentences have nouns that agree with what stands beside them, and clauses that are left out if they say
nothing:

    {asked:request|requests}             5 requests; Russian has three forms: {asked:запрос|запроса|запросов}
    {asked:|stays|stay}                  the word alone, in its form
    {units:unit|units}                   unit 5, or units 5, 7: a noun before a list
    [, {hits} of {trials} of others]     left out where its last number is 0, its last list or words empty
    {waited_ms:ms}, {cycle:sec}          a time in its natural unit: 258 ms, 12.5 s

Languages with a decimal comma write thousands apart by a space. A no-break space does not print as itself on every
terminal (`dissectors.values.harmless`); what wraps lines keeps a number whole (`reports.paragraphs`).

One-line errors, and what `--help` says, are told by what they say: what raises them stands on floors that know no
language, so a finished line is matched with the templates of `errors` (`{0}: no such file`, without the file: what
stands before a colon stays). What is filled in may be such a line itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from string import Formatter
from typing import Any, Final, NamedTuple

from dissectors.fields import ENGLISH, Wording

from ..words import UNITS_NS, decimal, duration, plural, write_units

APART: Final = " "
_ENGLISH: Final = re.compile(r"\d{1,3}(,\d{3})+")


class GroupedInt(int):
    """An integer that a template's `{count:,}` writes so."""

    def __format__(self, spec: str) -> str:
        return decimal(super().__format__(spec).replace(",", APART))


class CommaFloat(float):
    """A number that a template's `{share:.1%}` writes with a decimal comma, and a space before the sign."""

    def __format__(self, spec: str) -> str:
        return decimal(super().__format__(spec).replace(",", APART))


def regrouped(text: str) -> str:
    """Text that is one number, its thousands apart by commas, written so; any other as it is."""
    return text.replace(",", APART) if _ENGLISH.fullmatch(text) else text


CLAUSE: Final = re.compile(r"\[([^][]*)\]")


def form_of(number: int, forms: Sequence[str]) -> str:
    """That of two forms (one, more) or of three (one, two to four, five and more) which goes with a number."""
    if len(forms) == 2:
        return forms[number != 1]
    last, teens = number % 10, number % 100 // 10 == 1
    return forms[0 if last == 1 and not teens else 1 if last in (2, 3, 4) and not teens else 2]


_TIMES: Final = {"ms": UNITS_NS["ms"], "sec": UNITS_NS["s"]}


class TemplateFiller(Formatter):
    """Fills templates; lists are tuples."""

    def format_field(self, value: Any, spec: str) -> str:
        if spec in _TIMES:
            return duration(round(value * _TIMES[spec]))
        listed = isinstance(value, tuple)
        shown = ", ".join(map(str, value)) if listed else value
        noun, *forms = spec.split("|")
        if not forms:
            return str(super().format_field(shown, spec))
        word = form_of(len(value) if listed else round(value), forms if not noun else [noun, *forms])
        if not noun:
            return word
        return f"{word} {shown}" if listed else f"{grouped(round(value))} {word}"


_FILLER: Final = TemplateFiller()


def fill(template: str, numbers: Mapping[str, Any]) -> str:
    """The sentence of a template with its numbers."""

    def told(clause: re.Match[str]) -> str:
        names = [name for _, name, _, _ in Formatter().parse(clause[1]) if name]
        return clause[1] if not names or numbers[names[-1]] else ""

    return _FILLER.vformat(CLAUSE.sub(told, template), (), numbers)


LANGUAGES: Final = ("en", "ru")
LETTERS: Final = {"en": "", "ru": "Ж"}  # what a code page must have to carry a language
_NONE: Final[Mapping[str, Any]] = {}
_language: ContextVar[str] = ContextVar("language", default="en")


def use_language(language: str) -> None:
    """Tell everything in this language from now on (in this thread, or whatever context it is)."""
    if language not in LANGUAGES:
        raise ValueError(f"no such language: {language}; there are {', '.join(LANGUAGES)}")
    _language.set(language)
    write_units(catalogue(language).get("units", _NONE))


@contextmanager
def telling(language: str) -> Iterator[None]:
    """Tell everything in this language within the block, as `use` does."""
    before = in_use()
    use_language(language)
    try:
        yield
    finally:
        use_language(before)


def in_use() -> str:
    """The language in use here: a new thread begins in English."""
    return _language.get()


@cache
def catalogue(language: str) -> Mapping[str, Any]:
    """The words of a language; none of English, whose words are in the code."""
    if language == "en":
        return {}
    import tomllib
    from importlib.resources import files

    words: dict[str, Any] = {}
    for file in files(__name__).iterdir():
        if file.name.startswith(f"{language}.") and file.name.endswith(".toml"):
            for table, own in tomllib.loads(file.read_text(encoding="utf-8")).items():
                words.setdefault(table, {}).update(own)
    return words


def page_words(english: str, /, **numbers: object) -> str:
    """Words of the report page, in the language in use; a template is filled with its numbers."""
    return _worded("page", english, numbers)


def tr(english: str, /, **numbers: object) -> str:
    """Words of the interface, in the language in use; a template is filled with its numbers."""
    return _worded("interface", english, numbers)


def register_words(english: str, /, **numbers: object) -> str:
    """What is said of registers and their maps, in the language in use; a template's nouns agree with its numbers."""
    words: str = catalogue(_language.get()).get("registers", {}).get(english, english)
    return fill(words, _numerals(numbers)) if numbers else words


def _worded(table: str, english: str, numbers: Mapping[str, object]) -> str:
    words: str = catalogue(_language.get()).get(table, {}).get(english, english)
    return _FILLER.vformat(words, (), _numerals(numbers)) if numbers else words


def grouped(number: int) -> str:
    """A number with its thousands apart: `12,842`; in Russian, where a comma begins decimals, by a space."""
    return f"{number if _language.get() == 'en' else GroupedInt(number):,}"


def _numerals(numbers: Mapping[str, Any]) -> Mapping[str, Any]:
    """Numbers whose thousands a template sets apart as `grouped` does."""
    if _language.get() == "en":
        return numbers
    return {name: _numeral(value) for name, value in numbers.items()}


def _numeral(value: Any) -> Any:
    if type(value) is int:
        return GroupedInt(value)
    return CommaFloat(value) if isinstance(value, float) else value


def counted(number: int, one: str, many: str) -> str:
    """A number of things: `1 byte`, `2 bytes`; in Russian `1 байт`, `2 байта`, `5 байтов`."""
    forms = catalogue(_language.get()).get("counted", {}).get(one)
    if forms is None:
        return plural(number, one, many)
    return f"{grouped(number)} {form_of(number, forms)}"


def wording() -> Wording:
    """What frames are told in: templates and words by their English, nouns as `counted` has them."""
    words = catalogue(_language.get())
    if "frames" not in words:
        return ENGLISH
    own = words.get("fragments", {}) | words["frames"]  # what exceptions are called is told of causes too
    return Wording(
        lambda english: str(own.get(english, english)), lambda number, noun: counted(number, noun, f"{noun}s")
    )


def field_name(name: str) -> str:
    """A field's name for people; JSON and filters have it as it is."""
    return str(catalogue(_language.get()).get("fields", {}).get(name, name))


def column_name(name: str) -> str:
    """A map's column, or a key of its header, for people; its file has it as it is."""
    return str(catalogue(_language.get()).get("columns", {}).get(name, name))


def cause_words(cause: str, part: str, english: str) -> str:
    """A template of a cause: `text`, `share`, `test` or `remedy`."""
    words = catalogue(_language.get()).get("causes", {})
    return str(words.get(cause, {}).get(part, english))


def sentence(cause: str, part: str, english: str, numbers: Mapping[str, Any]) -> str:
    """A part of what is said of a cause, filled (a template), words among its numbers told in the language too."""
    return fill(cause_words(cause, part, english), _told(numbers))


def left_sentence(part: str, english: str, numbers: Mapping[str, Any]) -> str:
    """A part of what is said of exchanges that no cause takes, filled (a template)."""
    words = catalogue(_language.get()).get("left", {})
    return fill(str(words.get(part, english)), _told(numbers))


def filled(template: str, numbers: Mapping[str, Any]) -> str:
    """A template of a finding with its numbers, those that are words told in the language too."""
    if _language.get() == "en" and ":ms}" not in template:
        return template.format_map(numbers)  # as the filler does it, and sooner
    return TemplateFiller().vformat(template, (), _told(numbers))


def _told(numbers: Mapping[str, Any]) -> Mapping[str, Any]:
    words = catalogue(_language.get()).get("fragments", {})
    if not words:
        return numbers
    return {k: _fragment(words, v) if isinstance(v, str) else v for k, v in _numerals(numbers).items()}


def _fragment(words: Mapping[str, str], english: str) -> str:
    """Words that are filled in; what stands between commas may be known part by part."""
    return words[english] if english in words else ", ".join(words.get(part, part) for part in english.split(", "))


def phrase(english: str, numbers: Mapping[str, object] = _NONE, /, **more: object) -> str:
    """A piece of what a finding says, in the language in use, filled with its evidence and what else it names."""
    words = catalogue(_language.get()).get("findings", {}).get(english, english)
    return filled(words, {**numbers, **more} if more else numbers)


_PLACE: Final = re.compile(r"\{\d+\}")
_COLONS: Final = 24  # so many at most in a line of ours
_LONGEST: Final = 2000  # characters: a longer line is somebody's data


class _Template(NamedTuple):
    pieces: tuple[str, ...]  # the words around its places
    words: str

    @property
    def weight(self) -> int:
        """How much of a line it says itself."""
        return sum(map(len, self.pieces))

    def matched(self, line: str) -> re.Match[str] | None:
        """The line as this template, if it is one; most are not by the first look."""
        if not all(piece in line for piece in self.pieces):
            return None
        return re.fullmatch("(.+?)".join(map(re.escape, self.pieces)), line, re.DOTALL)


@cache
def _templates(language: str, table: str) -> tuple[_Template, ...]:
    """Those that say most first."""
    known: dict[str, str] = catalogue(language).get(table, {})
    made = [_Template(tuple(_PLACE.split(english)), words) for english, words in known.items()]
    return tuple(sorted(made, key=lambda one: -one.weight))


def retold(line: str, table: str = "errors") -> str:
    """A line in the language in use; as it is where no template of the catalogue's table has its words."""
    templates = _templates(in_use(), table) if len(line) <= _LONGEST else ()
    return _by_templates(line, templates, {})[1] if templates else line


def error_words(error: BaseException) -> str:
    """What an error says, in the language in use; its type where it says nothing."""
    return retold(str(error)) or type(error).__name__


def _by_templates(line: str, templates: tuple[_Template, ...], known: dict[str, tuple[int, str]]) -> tuple[int, str]:
    """How many letters of a line templates have, and the line told: by one template, or what stands around a colon."""
    if line in known:
        return known[line]
    ways = [(0, regrouped(line))]
    for head, rest in _split(line):
        if (told := _by_templates(rest, templates, known))[0]:
            before = _by_templates(head, templates, known)
            ways.append((before[0] + told[0], f"{before[1]}: {told[1]}"))
    if (found := _match(line, templates)) is not None:  # last: a file's name before a colon is no part of a template
        template, match = found
        parts = [_by_templates(part, templates, known) for part in match.groups()]
        ways.append((template.weight + sum(n for n, _ in parts), template.words.format(*(part for _, part in parts))))
    known[line] = max(ways, key=lambda way: way[0])
    return known[line]


def _match(line: str, templates: tuple[_Template, ...]) -> tuple[_Template, re.Match[str]] | None:
    return next(((each, match) for each in templates if (match := each.matched(line)) is not None), None)


def _split(line: str) -> Iterator[tuple[str, str]]:
    """What stands before each colon, and what behind."""
    for match in re.finditer(": ", line) if line.count(": ") <= _COLONS else ():
        if match.end() < len(line):
            yield line[: match.start()], line[match.end() :]
