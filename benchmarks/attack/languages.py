"""Targets that are languages: filters and rules, spoilt and derived, settings, and what prompts and flags take."""

from __future__ import annotations

import argparse
import os
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from itertools import pairwise
from random import Random
from typing import TYPE_CHECKING, Any, Final

import captures
from analyzer.settingfiles import OVERRIDE
from attack import sentences
from attack.inputs import spoilt
from attack.target import LINE, Target, conversation, folder
from captures import Capture, LineSettings

if TYPE_CHECKING:
    from analyzer.checks.model import CheckedBatch
    from analyzer.filters import BatchTable
    from analyzer.model.bus import Bus
    from analyzer.reports import Report

_WORDS: Final = (
    b" and ", b" or ", b"not ", b"(", b")", b" in ", b"..", b" ms", b" chars", b" unit ", b" where ", b":", b"17", b"%",
)  # fmt: skip
_RULES_FILES: Final = (
    b'[[rule]]\nname = "x"\ncheck = "no crc errors"\nseverity = "warning"\n',
    b'[[rule]]\ncheck = "every poll answered"\n[[rule]]\ncheck = "p95 response_time < 80 ms"\n',
)
_SETTINGS: Final = (
    b'port = "/dev/ttyUSB0"\ntz = "UTC"\nlang = "en"\ntheme = "dark"\nfunctions = ["a.py"]\n[line]\nbaud = 19200\n'
    b'parity = "E"\nstop_bits = 1\ndata_bits = 8\n[timing]\nt15_ms = 1.5\nidle_ms = 50\n',
    b'[maps]\n17 = "meter.csv"\nall = "xy-md02"\n[filters]\nmine = "unit == 17"\n',
    b'line.baud = "auto"\ntiming = { t35_ms = 4, turnaround_ms = 100 }\n',
)
_VALUES: Final = (
    "9600", "19200", '"auto"', '"E"', "1.5", "2", "8", "-1", "1e999", "nan", "0", "true", "[]", '["a.py", ""]', "{}",
    '"UTC"', '"Europe/Nowhere"', '"dark"', '"xy-md02"', '"unit == 1"', '"@mine"', '"~nobody-there/x"', "2026-11-21",
    '""', '"' + "x" * 300 + '"', r'"\u001b[2J\n"', r'"\u0000"', "9" * 400, "0x" + "F" * 300,
)  # fmt: skip
_PREFERENCES: Final = (
    b'{"version": 1, "filters": [{"name": "a", "filter": "unit == 1", "colour": "red"}], "past": ["noise"], '
    b'"hidden": ["gap"], "keys": {"quit": "q"}}',
)
_NOTES: Final = (
    b'{"version": 1, "bookmarks": [{"port": 0, "start": 5, "comment": "x"}], '
    b'"time_reference": {"port": 0, "start": 5}, "types": {"17:3:100": "f32"}}',
)
_GIVEN: Final = (
    b"12.5s", b"+200ms", b"-5s", b"08:29:51.5", b"2026-11-21 08:29", b"2026-01-31T08:30:00.5+02:00", b"50%", b"#12",
    b"14:00-16:00", b"yesterday 14-16", b"10s-25s", b"2026-11-21 14-16", b"0x03,0x02", b"value: 230.5", b"-7",
    b"text: read", b"'x'", b"bytes: 11 03", b"90s", b"15min", b"7d", b"2GB", b"500kB", b"auto", b"9600", b"1e6",
    b"120..180", b"plc=+250ms", b"127.0.0.1:502", b":8765", b"1234567890.5", b"24:00-24:00", b"0001-01-01 00:00",
    b"9999-12-31 23:59:59", b"9" * 400 + b"%", b"9" * 400 + b"s", b"9" * 5000, b"8" * 400 + b"GB", b"meter@17",
)  # fmt: skip


@cache
def _filters() -> Sequence[bytes]:
    """The examples of the language's own reference, and some of them joined."""
    from analyzer.filters.fields import FIELDS

    examples = [field.example for field in FIELDS]
    joined = [f"({one} or not {two}) and {one}" for one, two in pairwise(examples)]
    return [text.encode() for text in (*examples, *joined)]


@cache
def rules() -> Sequence[bytes]:
    """The examples of all forms."""
    from analyzer.checks.model import forms

    return [example.encode() for form in forms() for example in form.examples]


def _some_spoilt(derived: Callable[[Random], str]) -> Callable[[Random], bytes]:
    """What a grammar derives, one in eight spoilt."""

    def make(chance: Random) -> bytes:
        text = derived(chance).encode()
        return spoilt(chance, [text], _WORDS) if chance.random() < 1 / 8 else text

    return make


@cache
def _checked() -> tuple[CheckedBatch, Report]:
    """A capture with troubles, analysed once."""
    from analyzer.checks.model import CheckedBatch
    from analyzer.core import analyse
    from analyzer.filters import BatchTable
    from analyzer.reports import Summary
    from captures.samples import path

    capture = captures.open(path("troubled.jsonl"))
    analysed = next(iter(analyse(capture)))
    table = BatchTable(analysed.batch, capture.line, transactions=analysed.transactions)
    summary = Summary(capture.line.character_ns)
    summary.feed(analysed)
    checked = CheckedBatch(analysed.batch, analysed.transactions, analysed.findings, table)
    return checked, summary.report(capture)


@cache
def _table() -> BatchTable:
    return _checked()[0].table


def _filter(data: bytes, chance: Random) -> None:
    from analyzer.filters import check, compile_filter, complete

    text = data.decode(errors="replace")[:5000]
    way = chance.random()
    if way < 0.05:
        check(text, LineSettings())
    elif way < 0.1:
        complete(text, chance.randint(-1, len(text)))
    compiled = compile_filter(text, LINE, sentences.maps() if way > 0.05 else None)
    compiled.mask(_table())


def _rule(data: bytes, chance: Random) -> None:
    from analyzer.checks import compile_check, run

    charts = sentences.maps() if chance.random() < 0.95 else None
    rule = compile_check(data.decode(errors="replace")[:5000], LINE, charts=charts)
    if chance.random() < 0.003:
        run(Capture.of(LINE, conversation(chance)), [rule])
    checked, report = _checked()
    measure = rule.start()
    measure.feed(checked)
    assert "\n" not in measure.verdict(report).measured


def _rules_file(data: bytes, _: Random) -> None:
    from analyzer.checks import load_rules

    path = folder() / "rules.toml"
    path.write_bytes(data)
    load_rules(path, LINE)


def _settings(data: bytes, chance: Random) -> None:
    """A settings file as the user's or a project's, and as the defaults of a command."""
    from analyzer import settings
    from analyzer.cli.commands import UsageError
    from analyzer.cli.config import settled

    path = folder() / chance.choice(("rtuscope.toml", "config.toml"))
    path.write_bytes(data)
    os.environ[OVERRIDE] = str(path)
    name = chance.choice(("sniff", "open", "parse"))
    with suppress(UsageError):  # the command says it in one line
        settled(_parser(name), name, ["--filter", "@mine"] if name == "sniff" else [])
    for value in settings.read_settings().values.values():
        assert value.key and "\n" not in value.where


def _settings_text(chance: Random) -> bytes:
    """Settings that there are, with values of their kind or not; one in three spoilt files as well."""
    from analyzer.settings import SETTINGS

    if chance.random() < 1 / 3:
        return spoilt(chance, _SETTINGS, (b"line.", b"[line]", b"= 1e999\n"))
    chosen = [(setting.key, setting.kind) for setting in chance.sample(SETTINGS, chance.randint(1, 4))]
    chosen += chance.sample([("maps.17", str), ("maps.all", str), ("filters.mine", str)], chance.choice((0, 0, 1, 2)))
    lines = []
    for key, kind in chosen:
        fitting = [text for text in _VALUES if isinstance(_read_value(text), kind)]
        lines.append(f"{key} = {chance.choice(fitting if chance.random() < 0.9 else _VALUES)}")
    return "\n".join(lines).encode()


@cache
def _read_value(text: str) -> object:
    return tomllib.loads(f"a = {text}")["a"]


def _parser(name: str) -> argparse.ArgumentParser:
    """Of one command, new: settings change it."""
    from analyzer.cli.app import Parser
    from analyzer.cli.commands import add_arguments

    parser = Parser(prog=f"rtuscope {name}")
    add_arguments(parser, name)
    return parser


def _preferences(data: bytes, _: Random) -> None:
    from analyzer.tui.desk import Preferences

    path = folder() / "interface.json"
    path.write_bytes(data)
    read = Preferences.read(path)
    assert "\n" not in read.trouble
    read.save()
    if read.path is not None:
        assert Preferences.read(path) == read


def _notes(data: bytes, _: Random) -> None:
    from analyzer.usernotes import Notes

    path = folder() / "bus.mcap"
    path.with_name("bus.mcap.rtuscope.json").write_bytes(data)
    notes = Notes.beside(path)
    notes.refer(notes.reference)
    assert Notes.beside(path).comments == notes.comments


@cache
def _bus() -> Bus:
    from analyzer.core import analyse
    from analyzer.model.bus import Bus
    from captures.samples import path

    capture = captures.open(path("troubled.jsonl"))
    bus = Bus(capture.line)
    for analysed in analyse(capture):
        bus.feed(analysed)
    bus.close()
    return bus


@cache
def _flags() -> Sequence[tuple[argparse.ArgumentParser, argparse.Action]]:
    """Every argument of every command that reads its value in a way of its own."""
    from analyzer.cli.commands import COMMANDS

    def inside(parser: argparse.ArgumentParser) -> Iterator[tuple[argparse.ArgumentParser, argparse.Action]]:
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for each in action.choices.values():
                    yield from inside(each)
            elif action.type is not None:
                yield parser, action

    return [each for name in COMMANDS for each in inside(_parser(name))]


def _given(data: bytes, chance: Random) -> None:
    """A value as it is given to a flag of a command or typed into a prompt."""
    from datetime import UTC, timedelta, timezone

    from analyzer.cli.amounts import moment, time_span
    from analyzer.cli.commands import UsageError
    from analyzer.model import search, times

    text = data.decode(errors="replace")[:6000]
    zone = chance.choice((UTC, timezone(timedelta(hours=14)), timezone(-timedelta(hours=12))))
    bus = _bus()
    takers: tuple[Callable[[], Any], ...] = (
        lambda: search.row_named(text, bus, chance.randrange(bus.count), zone),
        lambda: times.span(text, bus, zone),
        lambda: search.wanted(text).hits(bus, 0, min(bus.count, 40)),
        lambda: moment(text, "--from", chance.choice((bus.t_first, 0, -(10**15), 10**18)), zone),
        lambda: time_span(text, "--shift"),
    )
    parser, action = chance.choice(_flags())
    with suppress(argparse.ArgumentError, UsageError):
        parser._get_value(action, text)
    with suppress(UsageError):  # the command says it in one line
        chance.choice(takers)()


def language_targets() -> list[Target]:
    """All of them."""
    from analyzer.checks import CheckError
    from analyzer.checks.parsing import RulesFileError
    from analyzer.filters import FilterError
    from analyzer.model.search import SearchError
    from analyzer.model.times import GotoError
    from analyzer.settings import SettingsError
    from analyzer.usernotes import NotesError

    derived_filters = _some_spoilt(lambda chance: sentences.filters().derived(chance))
    derived_rules = _some_spoilt(lambda chance: sentences.rules().derived(chance))
    said = (GotoError, SearchError)
    return [
        Target("filters", _filters, _filter, (FilterError,), _WORDS, 30),
        Target("filters derived", _filters, _filter, (FilterError,), share=30, make=derived_filters),
        Target("rules", rules, _rule, (CheckError, FilterError), _WORDS, 30),
        Target("rules derived", rules, _rule, (CheckError, FilterError), share=30, make=derived_rules),
        Target("rule files", lambda: _RULES_FILES, _rules_file, (RulesFileError,), _WORDS, 5),
        Target("settings files", lambda: _SETTINGS, _settings, (SettingsError,), share=5, make=_settings_text),
        Target("preferences", lambda: _PREFERENCES, _preferences, share=5),
        Target("notes beside", lambda: _NOTES, _notes, (NotesError,), share=5),
        Target("given values", lambda: _GIVEN, _given, said, (*_GIVEN[:12], b"e", b".", b"-", b"+"), 5),
    ]
