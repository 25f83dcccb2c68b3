"""Words of other tools, and what they are here: a table to add rows to, for commands, first options and options."""

from __future__ import annotations

from collections.abc import Container
from typing import Final

NOUN: Final = ""  # a verb that says no more than the noun behind it does
VERBS: Final[dict[str, str]] = {  # words of other tools, and what they are here
    "decode": "parse",
    "dissect": "parse",
    "read": NOUN,
    "view": NOUN,
    "show": NOUN,
    "load": NOUN,
    "monitor": "sniff",
    "live": "sniff",
    "listen": "sniff",
    "capture": "sniff",
    "dump": "sniff",
    "stats": "report",
    "stat": "report",
    "statistics": "report",
    "analyze": "report",
    "analyse": "report",
    "diagnose": "report",
    "summary": "report",
    "list": "ports",
    "devices": "ports",
    "list-ports": "ports",
    "interfaces": "ports",
    "tui": "open",
    "gui": "open",
    "save": "export",
    "player": "replay",
    "play": "replay",
    "generate": "simulate",
    "checksum": "crc",
}
OPTIONS: Final[dict[str, str]] = {  # first words that are options of other tools
    "-V": "--version",
    "-v": "--version",
    "version": "--version",
    "-D": "ports",
    "--list-interfaces": "ports",
    "--list-ports": "ports",
    "-r": NOUN,
    "-i": NOUN,
}
INSTEAD: Final[dict[str, tuple[tuple[str, str], ...]]] = {  # an option: where this is known, that is meant; or words
    "--unit": (("--filter", "--filter 'unit == N'"), ("--map", "--map MAP@N")),
    "--slave": (("--filter", "--filter 'unit == N'"),),
    "-a": (("--filter", "--filter 'unit == N'"), ("--duration", "--duration TIME")),
    "--address": (("--filter", "--filter 'address == N'"), ("--like", "--like VALUE")),
    "--function": (("--filter", "--filter 'function == N'"),),
    "--errors": (("--filter", "--filter 'exception or crc_ok == false'"),),
    "--from": (("--as", "--as tcp"), ("--input-format", "--input-format NAME")),
    "--hex": (("--as", "bytes need no option, as in rtuscope parse 11 03 00 6B 00 03 76 87"),),
    "--baudrate": (("--baud", "--baud N"),),
    "--bytesize": (("--bits", "--bits N"),),
    "--stopbits": (("--stop", "--stop N"),),
    "--databits": (("--bits", "--bits N"),),
    "--columns": (("--fields", "--fields NAME,NAME"),),
    "-T": (("--fields", "--fields NAME,NAME"),),
    "-e": (("--fields", "--fields NAME,NAME"),),
    "-z": (("--html", "a report has units, polls and causes without an option"),),
    "-n": (("--count", "--count N"),),
    "-q": (("--json", "> FILE behind the command keeps the terminal quiet"),),
    "--quiet": (("--json", "> FILE behind the command keeps the terminal quiet"),),
}


def instead_of(option: str, known: Container[str]) -> str | None:
    """What to give in place of an option that another tool has; None where nothing is known of it."""
    return next((words for needed, words in INSTEAD.get(option, ()) if needed in known), None)
