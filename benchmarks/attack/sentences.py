"""Texts that a grammar allows: derived from the rules of the product's own parser, so that what is behind it is hit.

Tests of filters are made after the kind of their field, most of them such as make sense: a text of which a part makes
none is refused before anything of it is worked out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from random import Random
from typing import TYPE_CHECKING, Final

from lark import Lark
from lark.grammar import NonTerminal, Symbol

from attack.mapfiles import OWN
from attack.target import LINE

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

Words = Callable[[Random], str]
_DEEPEST: Final = 12  # rules in each other, from where on the shortest way out is taken
NUMBERS: Final = (
    "0", "1", "2", "3", "17", "42", "99", "100", "247", "255", "256", "1000", "9999", "40108", "65535", "65536",
    "400108", "0x0", "0x6B", "0xFFFF", "0x10000", "-1", "-32768", "0.5", "3.5", "1.75", "0.000000001", "1e3",
    "2147483648", "4611686018427387904", "9223372036854775807", "9223372036854775808", "18446744073709551616",
    "9" * 40, "9" * 400, "0" * 60, "1." + "3" * 60,
)  # fmt: skip
_TEXTS: Final = (
    '"Voltage L1"', '"*"', "'a?b*'", '""', '"\u017f\u0130"', "'[x]'", '"03 02"', "'0x03,0x02'", '"0302"', '"0"',
    '"2026-11-21 08:29:51"', '"0001-01-01"', '"9999-12-31T23:59:59.999999+00:00"', '"0001-01-01T00:00+23:59"',
    "'1970-01-01T00:00Z'", '"%s"', '"' + "x" * 300 + '"', "'\x1b[2J'",
)  # fmt: skip
_NAMES: Final = ('"Voltage L1"', '"Energy"', "Mode", '"*"', "'?n*'", '"no such"')
_UNITS: Final = ("", " ms", "us", " s", " min", "h", " chars", "char", " ns", " µs")


class Sentences:
    """Random derivations of a grammar; `words` makes what stands for a terminal, or in place of a whole rule."""

    def __init__(self, grammar: Lark, words: Mapping[str, Words]) -> None:
        self._words = words
        self._rules: dict[str, list[Sequence[Symbol]]] = {}
        for rule in grammar.rules:
            self._rules.setdefault(rule.origin.name, []).append(rule.expansion)
        self._fixed = {each.name: each.pattern.value for each in grammar.terminals if each.pattern.type == "str"}
        self._least = self._heights()

    def _heights(self) -> dict[str, int]:
        """How many rules stand in each other below each of them, at least."""
        least: dict[str, int] = {}
        while len(least) < len(self._rules):
            for name, expansions in self._rules.items():
                ready = [each for each in expansions if all(_name(one) in least for one in each if _is_rule(one))]
                if name not in least and ready:
                    least[name] = 1 + min(self._height(each, least) for each in ready)
        return least

    @staticmethod
    def _height(expansion: Sequence[Symbol], least: Mapping[str, int]) -> int:
        return max((least[_name(one)] for one in expansion if _is_rule(one)), default=0)

    def derived(self, chance: Random, start: str = "start") -> str:
        """One text."""
        found: list[str] = []
        self._derive(chance, start, 0, found)
        blank = chance.choice((" ", " ", " ", " ", " ", " ", "\t", "  ", "\n", ""))
        return blank.join(found)

    def _derive(self, chance: Random, name: str, depth: int, found: list[str]) -> None:
        made = self._words.get(name)
        if made is not None and (
            name not in self._rules or (chance.random() < 0.9 and not _opens(name, chance, depth))
        ):
            found.append(made(chance))
        elif name in self._fixed:
            found.append(self._fixed[name])
        else:
            choices = self._rules[name]
            if depth > _DEEPEST or (depth and chance.random() < 0.35):
                choices = [min(choices, key=lambda each: self._height(each, self._least))]
            for one in chance.choice(choices):
                self._derive(chance, _name(one), depth + 1, found)


def _opens(name: str, chance: Random, depth: int) -> bool:
    """Whether a rule is derived although words for all of it are there: a test as a negation or in parentheses."""
    return depth < _DEEPEST and chance.random() < (0.3 if name == "one" else 0.02)


def _is_rule(symbol: Symbol) -> bool:
    return isinstance(symbol, NonTerminal)


def _name(symbol: Symbol) -> str:
    return str(symbol.name)


def of(*texts: str) -> Words:
    """One of these."""
    return lambda chance: chance.choice(texts)


@cache
def maps() -> UnitMaps:
    """Where values have their names from, for filters and rules."""
    from dissectors.maps.files import UnitMaps
    from dissectors.maps.table import read_table

    return UnitMaps(other=read_table(OWN, "own.csv"))


@cache
def filters() -> Sentences:
    """Of the display filter."""
    from analyzer.filters.fields import by_name
    from analyzer.filters.parsing import grammar

    names = tuple(by_name())
    return Sentences(
        grammar(),
        {
            "one": _test,
            "called": lambda chance: f"value({chance.choice(_NAMES)})",
            "literal": lambda chance: chance.choice(_items_of(chance.choice(names))[0]).partition("..")[0],
            "NAME": of(*names, "value", "name"),
            "WORD": of("true", "false", "request", "read", "late-response", "Voltage", "nothing"),
            "COMPARED": of("==", "!=", "<", "<=", ">", ">=", "="),
            "HOLDS": of("contains", "matches"),
            "NUMBER": of(*NUMBERS),
            "ADDRESS": of("4x108", "3x1", "1x20", "4x65536", "4x0", "4x" + "9" * 30),
            "STRING": of(*_TEXTS),
            "UNIT": of(*(unit.strip() for unit in _UNITS if unit)),
            "MEASURE": of("V", "kW", "kWh", "°C", "%", "m3/h", "Ω"),
            "AND": of("and", "&&", "AND"),
            "OR": of("or", "||"),
            "NOT": of("not", "!"),
            "IN": of("in"),
        },
    )


def _test(chance: Random) -> str:
    """A test of a field, or of a value of a register map; most of them make sense."""
    from analyzer.filters.fields import FIELDS

    if chance.random() < 0.1:
        return _measured(chance)
    field = chance.choice(FIELDS)
    name = chance.choice((field.name, *field.aliases))
    if chance.random() < 0.1:
        return name
    good, others = _items_of(field.name)
    items = [
        chance.choice(good if chance.random() < 0.98 or not others else others)
        for _ in range(chance.choice((1, 1, 1, 1, 1, 2, 3)))
    ]
    if len(items) == 1 and ".." not in items[0]:
        return f"{name} {chance.choice(field.kind.operators)} {items[0]}"
    sign = chance.choice((" in ", " not in "))
    return f"{name}{sign}{items[0] if len(items) == 1 else '(' + ', '.join(items) + ')'}"


@cache
def _items_of(name: str) -> tuple[Sequence[str], Sequence[str]]:
    """Values and ranges that a field may be compared with, and those that it is not to be."""
    from analyzer.filters import check
    from analyzer.filters.fields import by_name

    field, chance, values = by_name()[name], Random(name), _values_of(name)
    ranges = [f"{chance.choice(values)}..{chance.choice(values)}" for _ in range(100)]
    good, others = list[str](), list[str]()
    charts = maps()
    for item in (*values, *ranges):
        sign = "in" if "in" in field.kind.operators or ".." in item else field.kind.operators[0]
        (good if check(f"{name} {sign} {item}", LINE, charts) is None else others).append(item)
    return good, others


@cache
def _values_of(name: str) -> Sequence[str]:
    """What a field may be compared with."""
    from analyzer.filters import kinds
    from analyzer.filters.fields import by_name

    kind = by_name()[name].kind
    plain = [text for text in NUMBERS if len(text) < 40 and "e" not in text]
    if isinstance(kind, kinds.Named | kinds.Flag):
        numbers = plain if isinstance(kind, kinds.Named) and kind.numeric else ()
        return (*(choice.text for choice in kind.choices()), *numbers)
    if isinstance(kind, kinds.Duration | kinds.Moment):
        dates = [text for text in _TEXTS if text[1:3].isdecimal()] if isinstance(kind, kinds.Moment) else ()
        return (*(number + unit for number in NUMBERS for unit in _UNITS if "x" not in number), *dates)
    if isinstance(kind, kinds.Addresses):
        return ("40108", "4x108", "400108", "10017", "1x17", "17", "0x6B", "30001", "3x1", "00001", "65535", "65536")
    if isinstance(kind, kinds.NumberKind):
        return plain
    return _TEXTS


def _measured(chance: Random) -> str:
    """A test of a value of a register map."""
    name = chance.choice(_NAMES)
    units = {'"Voltage L1"': ("", " V", " kV", "mV"), '"Energy"': ("", " kWh", " Wh", " J")}
    number = chance.choice((*NUMBERS[:20], *NUMBERS)) + chance.choice(units.get(name, ("", "", "", " W", "%")))
    sign = chance.choice(("==", "!=", "<", ">=", "in 1 .."))
    return chance.choice(
        (f"value({name})", f"value({name}) {sign} {number}", f"name contains {name}", "name matches '?*'")
    )


@cache
def rules() -> Sentences:
    """Of the rules that captures are held against."""
    from analyzer.checks.parsing import grammar
    from analyzer.tables.findings import Severity, codes

    few = [str(number) for number in (0, 1, 2, 3, 17, 42, 99, 100)]
    many = [number for number in NUMBERS if number.replace(".", "").isdecimal()]
    ranges = ("4x0-100", "40001-40100", "0-10", "1x5", "00001-00016", "100-1", "0x0", "4x70000", "400001..465536")
    return Sentences(
        grammar(),
        {
            "thing": of(*codes(), "crc errors", "retries", "timeouts", "late responses", "exceptions", "writes"),
            "NUMBER": lambda chance: chance.choice(few if chance.random() < 0.8 else many),
            "COMPARED": of("<", "<=", ">", ">="),
            "SHARE": of("p50", "p95", "p99", "max", "min", "mean"),
            "UNIT": of("ns", "us", "ms", "s", "min", "h"),
            "RANGE": of(*ranges, "9" * 40, "0" * 40),
            "WORD": of(*(grade.name.lower() for grade in Severity), "grave"),
            "FILTER": filters().derived,
        },
    )
