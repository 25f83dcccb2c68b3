"""How a line is set, as options: one name with one meaning in every command that takes it.

    -b 19200              bit/s; 19200-8N1 sets parity, data bits and stop bits with it
    -P none               or N, in either case
    --bits 7, --stop 2    also --data-bits, --stop-bits

A command says what it makes of them (`LineWords`), and whether `auto` is a value.

In all commands --format is what is written, --input-format what is read, --from and --to are places. Names that once
meant something else stay (`add_kept_names`).
"""

from __future__ import annotations

import argparse
from copy import copy
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

PARITIES: Final = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}
_LETTERS: Final = {letter.lower(): letter for letter in PARITIES.values()}
_DATA_BITS: Final = ("7", "8")
_STOP_BITS: Final = ("1", "1.5", "2")
_DIGITS: Final = 8
_SLOWEST, _FASTEST = 50, 12_000_000  # bit/s


class RateWithFormat(NamedTuple):
    """`19200-8N1`."""

    baud: int
    bits: int
    parity: str
    stop: float


@dataclass(frozen=True, slots=True)
class LineWords:
    """What the options do in a command, in words of its help; `parities` are those that it takes."""

    baud: str = "bit/s of the line, or with its format: 19200-8N1"
    parity: str = "none, even, odd, mark, space"
    bits: str = "data bits per character"
    stop: str = "stop bits per character"
    parities: tuple[str, ...] = ("N", "E", "O", "M", "S")
    auto: bool = False


def add_kept_names(group: argparse._ActionsContainer, option: argparse.Action, *names: str) -> None:
    """Names that an option once had: scripts give them, so they stay; help shows the one name alone."""
    kept = copy(option)
    kept.option_strings, kept.help = names, argparse.SUPPRESS
    group._add_action(kept)


class _Rate(argparse.Action):
    def __call__(self, _: Any, namespace: argparse.Namespace, values: Any, __: str | None = None) -> None:
        if not isinstance(values, RateWithFormat):
            namespace.baud = values
            return
        for name, value in values._asdict().items():
            setattr(namespace, name, value)


def add_line_arguments(group: argparse._ActionsContainer, words: LineWords) -> None:
    """-b, -P, --bits and --stop; `baud`, `parity`, `bits` and `stop` of what is parsed, None where not given (with
    `auto` baud and parity are that)."""
    usual = "auto" if words.auto else None
    rate_of = rate_or_auto if words.auto else rate
    group.add_argument("-b", "--baud", action=_Rate, type=rate_of, default=usual, metavar="N", help=words.baud)
    letters = ("auto", *words.parities) if words.auto else words.parities
    group.add_argument("-P", "--parity", type=parity, choices=letters, default=usual, help=words.parity)
    group.add_argument("--bits", "--data-bits", dest="bits", type=int, choices=(7, 8), help=words.bits)
    group.add_argument("--stop", "--stop-bits", dest="stop", type=float, choices=(1, 1.5, 2), help=words.stop)


def rate(text: str) -> int | RateWithFormat:
    """A rate in bit/s, with the format of a character or without; for argparse."""
    number, dash, form = text.strip().replace(" ", "-").replace(",", "-").partition("-")
    known = number.isascii() and number.isdecimal() and len(number) <= _DIGITS
    if known and _SLOWEST <= int(number) <= _FASTEST:
        if not dash:
            return int(number)
        bits, letter, stop = form[:1], _LETTERS.get(form[1:2].lower()), form[2:]
        if bits in _DATA_BITS and letter is not None and stop in _STOP_BITS:
            return RateWithFormat(int(number), int(bits), letter, float(stop))
    raise argparse.ArgumentTypeError(f"{text!r} is not a rate in bit/s, or settings such as 19200-8N1")


def rate_or_auto(text: str) -> int | str | RateWithFormat:
    """The same, or `auto`; for argparse."""
    if text == "auto":
        return text
    try:
        return rate(text)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a rate in bit/s, settings such as 19200-8N1, or auto"
        ) from None


def parity(text: str) -> str:
    """The letter of a parity that is given by it or by its word; for argparse. What is neither is left as it is."""
    word = text.lower()
    return _LETTERS.get(word) or next((letter for name, letter in PARITIES.items() if name == word), text)
