"""The settings of a line are given alike to every command that takes them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import ran, refused

import captures
from analyzer.cli.app import Parser
from analyzer.cli.commands import COMMANDS, add_arguments
from analyzer.cli.lineoptions import RateWithFormat, rate

SETTINGS = {"--baud", "--parity", "--bits", "--data-bits", "--stop", "--stop-bits"}


def _parser(command: str) -> Parser:
    parser = Parser(prog=command)
    add_arguments(parser, command)
    return parser


def _options(parser: argparse.ArgumentParser) -> set[str]:
    return set(parser._option_string_actions)


TAKING = [command for command in COMMANDS if "--baud" in _options(_parser(command))]


def _given(command: str, *options: str) -> argparse.Namespace:
    parser = _parser(command)
    for action in parser._actions:
        action.required = False
    return parser.parse_known_args([*options])[0]


def test_there_are_many() -> None:
    assert {"report", "export", "sniff", "record", "between", "simulate", "twin"} <= set(TAKING)


@pytest.mark.parametrize("command", TAKING)
def test_every_command_has_every_name(command: str) -> None:
    assert _options(_parser(command)) >= SETTINGS


@pytest.mark.parametrize("command", ["report", "sniff", "between", "simulate"])
def test_words_formats_and_old_names_mean_the_same(command: str) -> None:
    ways = (
        ("-b", "19200-7E2"),
        ("-b", "19200", "-P", "even", "--bits", "7", "--stop", "2"),
        ("--baud", "19200", "--parity", "E", "--data-bits", "7", "--stop-bits", "2"),
        ("--baud", "19200 7e2"),
    )
    for way in ways:
        given_so = _given(command, *way)
        assert (given_so.baud, given_so.parity, given_so.bits, given_so.stop) == (19200, "E", 7, 2)
    assert _given(command, "-P", "none").parity == "N"


@given(
    st.integers(50, 12_000_000), st.sampled_from((7, 8)), st.sampled_from("NEOMS"), st.sampled_from(("1", "1.5", "2"))
)
def test_a_rate_with_its_format_is_read_back(baud: int, bits: int, letter: str, stop: str) -> None:
    assert rate(f"{baud}-{bits}{letter}{stop}") == RateWithFormat(baud, bits, letter, float(stop))
    assert rate(str(baud)) == baud


@given(st.text(max_size=12))
def test_what_is_no_rate_is_refused_in_words(text: str) -> None:
    try:
        assert rate(text)
    except argparse.ArgumentTypeError as error:
        assert "not a rate" in str(error)


@pytest.mark.parametrize("text", ["19200-9N1", "19200-8X1", "fast", "49", "12000001", "19200-8N3"])
def test_a_rate_that_cannot_be_is_one_line(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert "is not a rate in bit/s" in refused(capsys, "report", "bus.jsonl", "-b", text)


def test_a_simulated_line_has_the_bits_that_were_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bus = tmp_path / "bus.jsonl"
    assert ran(capsys, "simulate", bus, "-b", "9600-8N1", "--transactions", "20").status == 0
    assert (captures.open(bus).line.baud, captures.open(bus).line.char_bits) == (9600, 10)


_OTHERWISE = {"view_format": "format", "begin": "start", "names": "port_name", "to_format": "format"}  # dests


def _shown_options() -> Iterator[tuple[str, argparse.Action]]:
    """Every option that help shows, with its command."""
    for command in COMMANDS:
        parser = argparse.ArgumentParser()
        add_arguments(parser, command)
        waiting = [(command, parser)]
        for name, each in waiting:
            for action in each._actions:
                if isinstance(action, argparse._SubParsersAction):
                    waiting += [(f"{name} {word}", below) for word, below in action.choices.items()]
                elif action.option_strings and action.help is not argparse.SUPPRESS:
                    yield name, action


def _meaning(action: argparse.Action) -> str:
    """What an option sets; of one that sets a choice, which."""
    chosen = isinstance(action, argparse._StoreConstAction) and isinstance(action.const, str)
    return {"jsonl": "json"}.get(action.const, action.const) if chosen else _OTHERWISE.get(action.dest, action.dest)


def test_a_name_has_one_meaning_in_every_command() -> None:
    meanings: dict[str, set[str]] = {}
    for _, action in _shown_options():
        for name in action.option_strings:
            meanings.setdefault(name, set()).add(_meaning(action))
    assert len(meanings) > 100
    assert {name: found for name, found in meanings.items() if len(found) > 1} == {}


def test_a_meaning_has_one_name_in_every_command() -> None:
    names: dict[str, set[str]] = {}
    for _, action in _shown_options():
        names.setdefault(_meaning(action), set()).add(next(n for n in action.option_strings if n.startswith("--")))
    twice = {meaning: found for meaning, found in names.items() if len(found) > 1}
    assert twice == {"format": {"--format", "--to-format"}}  # `convert --format` was once what it reads


@pytest.mark.parametrize(
    ("command", "old", "new"),
    [
        ("report bus.jsonl", "--format text", "--input-format text"),
        ("convert bus.jsonl -o x.jsonl", "--format text", "--input-format text"),
        ("convert bus.jsonl -o x.jsonl", "--from 1s --to 2s", "--start 1s --end 2s"),
        ("convert bus.jsonl -o x.jsonl", "--port a --port b", "--port-name a --port-name b"),
        ("map import x.csv", "--format spreadsheet", "--input-format spreadsheet"),
        ("export bus.jsonl", "--to-format csv", "--format csv"),
    ],
)
def test_names_of_before_stay(command: str, old: str, new: str) -> None:
    name, *rest = command.split()
    parser = argparse.ArgumentParser()
    add_arguments(parser, name)
    before, now = (parser.parse_args([*rest, *options.split()]) for options in (old, new))
    assert before == now


@pytest.mark.parametrize("text", ["19200-9Z1", "fast", "19200-8N3"])
@pytest.mark.parametrize("command", ["report bus.jsonl", "sniff /dev/nowhere"])
def test_a_wrong_rate_is_told_how_one_is_written(capsys: pytest.CaptureFixture[str], command: str, text: str) -> None:
    assert "19200-8N1" in refused(capsys, *command.split(), "-b", text)
