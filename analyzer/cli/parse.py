"""`rtuscope parse`: pasted bytes, annotated. People type it all day: nothing heavy is imported unless needed."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING

from .commands import DONE, FAILED, NO_FRAME, UsageError
from .inputs import (
    add_check_argument,
    add_functions_argument,
    add_map_argument,
    add_zone_argument,
    chosen_charts,
    load_functions,
)
from .terminal import coloured, put_json, shell_word, tell_user

if TYPE_CHECKING:
    from datetime import tzinfo

EXAMPLE = """\
rtuscope parse 11 03 00 6B 00 03 76 87
rtuscope parse 11 03 00 6B 00 03 76 87 11 03 06 AE 41 56 52 43 40 49 AD
rtuscope parse --map eastron-sdm630 01 04 00 00 00 02 71 CB 01 04 04 43 66 33 34 1B 38
rtuscope parse --json :1103006B00037E"""
_LONGEST = 8 << 20  # characters of text: no paste is longer
_HEAD = 1 << 16  # bytes by which text is told from other data


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "hex", nargs="*", metavar="HEX", help="bytes in any form: 11 03 .., 1103.., 0x11,0x03, :1103.., a log line"
    )
    parser.add_argument("-f", "--file", metavar="FILE", help="read the text from a file; - is standard input")
    parser.add_argument(
        "--as", dest="envelope", choices=("auto", "rtu", "ascii", "tcp", "pdu"), default="auto", help="envelope"
    )
    parser.add_argument(
        "--role", choices=("auto", "request", "response"), default="auto", help="direction, if you know it"
    )
    parser.add_argument(
        "--json", action="store_true", help="one JSON object per line, with the keys of rtuscope export"
    )
    parser.add_argument("--noise", action="store_true", help="with --json: also lines for bytes outside frames")
    parser.add_argument(
        "--values", action="store_true", help="registers as 32- and 64-bit integers and floats in every byte order"
    )
    add_zone_argument(parser)
    add_map_argument(parser)
    add_check_argument(parser)
    add_functions_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what was read."""
    from captures.errors import HexError

    from ..paste import left_out, read, tree

    text = _pasted_text(arguments)
    load_functions(arguments)
    charts = chosen_charts(arguments) if arguments.map else {}  # what maps are is not imported for nothing
    try:
        paste = read(text, arguments.envelope, arguments.role, _zone(arguments.tz))
    except HexError as error:  # digits that are no bytes
        where = "" if arguments.hex else f"{_source(arguments)}: "
        raise UsageError(_named_file(arguments.hex) or f"{where}{error}") from error
    if arguments.json:
        lines = list(paste.to_json(noise=arguments.noise))
        if charts:
            from ..paste.meaning import mapped_readings, refused_requests

            refused = refused_requests(lines)
            known: dict[int, dict[tuple[str, int], int]] = {}
            for line in lines:
                if (chart := charts.get(line.get("unit") or 0)) is not None:
                    registers = known.setdefault(line.get("unit") or 0, {})
                    readings = [] if line["start"] in refused else mapped_readings(line, chart, registers)
                    line["mapped"] = [reading.to_json() for reading in readings]
        for line in lines:
            put_json(line)
        for left in left_out(paste):
            tell_user(f"not read: {left}")
    else:
        sys.stdout.write(tree(paste, colour=coloured(sys.stdout), values=arguments.values))
        if charts:
            from ..paste.meaning import meaning_text

            sys.stdout.write(meaning_text(paste.to_json(), charts))
    if arguments.check and paste.errors:
        return FAILED
    return DONE if paste.holds_a_frame else NO_FRAME


def _zone(name: str | None) -> tzinfo | None:
    if name is None:
        return None
    from captures.io import time_zone

    return time_zone(name)


def _named_file(words: list[str]) -> str | None:
    """What to do where a file was named in place of bytes."""
    if len(words) != 1:
        return None
    if not os.path.isfile(words[0]):  # noqa: PTH113 - pathlib takes 4 ms to import
        from .door import FILE_NAME

        return f"{words[0]}: no such file" if FILE_NAME.search(words[0]) else None
    name = shell_word(words[0])
    return (
        f"{words[0]!r} is a file, not bytes: read it with rtuscope parse -f {name}, view it with rtuscope open {name}"
    )


def _source(arguments: argparse.Namespace) -> str:
    return "standard input" if arguments.file in (None, "-") else str(arguments.file)


def _pasted_text(arguments: argparse.Namespace) -> str:
    """What was pasted: arguments, a file, or standard input."""
    if arguments.hex == ["-"]:
        arguments.hex, arguments.file = [], "-"
    if arguments.hex and arguments.file:
        raise UsageError("give bytes as arguments or with -f FILE, not both")
    if arguments.hex:
        words: list[str] = arguments.hex
        return ("\n" if any(" " in word.strip() for word in words) else " ").join(words)
    if arguments.file and arguments.file != "-":
        if os.path.isdir(arguments.file):  # noqa: PTH112 - Windows says that permission is denied
            raise UsageError(f"{arguments.file}: is a directory: name a file in it")
        with open(arguments.file, "rb") as file:  # noqa: PTH123 - pathlib takes 4 ms to import
            data = file.read(_LONGEST + 1)
    else:
        if sys.stdin.isatty():
            tell_user("paste the bytes, then press Ctrl-D (Ctrl-Z Enter on Windows)")
        data = sys.stdin.buffer.read(_LONGEST + 1)
    if len(data) > _LONGEST:
        raise UsageError(
            f"over {_LONGEST >> 20} MiB of text is too long to paste; rtuscope export reads captures of any size"
        )
    from captures.text import encodings

    if encodings.is_binary(data[:_HEAD]):
        raise UsageError(
            f"{_source(arguments)}: binary, not text: parse reads hex (xxd -p FILE | rtuscope parse); for a capture "
            "use rtuscope export FILE.bin"
        )
    return encodings.decoded(data)
