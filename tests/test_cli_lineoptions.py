"""The settings of a line are given alike to every command that takes them."""

from __future__ import annotations

import argparse
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
