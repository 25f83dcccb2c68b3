"""`rtuscope parse`: pasted bytes, annotated. People type it all day: nothing heavy is imported unless needed."""

from __future__ import annotations

import argparse
import sys

from .app import DONE, FAILED, NO_FRAME, UsageError
from .inputs import add_check_argument, add_functions_argument, load_functions
from .terminal import coloured

EXAMPLE = """\
rtuscope parse 11 03 00 6B 00 03 76 87
rtuscope parse 11 03 00 6B 00 03 76 87 11 03 06 AE 41 56 52 43 40 49 AD
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
        "--as", dest="envelope", choices=("auto", "rtu", "ascii", "tcp"), default="auto", help="envelope"
    )
    parser.add_argument(
        "--role", choices=("auto", "request", "response"), default="auto", help="direction, if you know it"
    )
    parser.add_argument("--json", action="store_true", help="an object a line, with the keys of rtuscope export")
    parser.add_argument("--noise", action="store_true", help="with --json: lines for the bytes in no frame, too")
    parser.add_argument(
        "--values", action="store_true", help="registers as 32- and 64-bit integers and floats in every byte order"
    )
    add_check_argument(parser)
    add_functions_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what was read."""
    from analyzer.paste import read, tree

    text = _text(arguments)
    load_functions(arguments)
    try:
        paste = read(text, arguments.envelope, arguments.role)
    except ValueError as error:  # digits that are no bytes
        where = "" if arguments.hex else f"{_source(arguments)}: "
        raise UsageError(f"{where}{error}") from error
    if arguments.json:
        import json

        for line in paste.to_json(noise=arguments.noise):
            print(json.dumps(line, separators=(",", ":")))
    else:
        sys.stdout.write(tree(paste, colour=coloured(sys.stdout), values=arguments.values))
    if arguments.check and paste.errors:
        return FAILED
    return DONE if paste.holds_a_frame else NO_FRAME


def _source(arguments: argparse.Namespace) -> str:
    return "standard input" if arguments.file in (None, "-") else str(arguments.file)


def _text(arguments: argparse.Namespace) -> str:
    """What was pasted: arguments, a file, or standard input."""
    if arguments.hex and arguments.file:
        raise UsageError("bytes come from the arguments or from -f FILE, not from both")
    if arguments.hex:
        words: list[str] = arguments.hex
        return ("\n" if any(" " in word.strip() for word in words) else " ").join(words)
    if arguments.file and arguments.file != "-":
        with open(arguments.file, "rb") as file:  # noqa: PTH123 - pathlib takes 4 ms to import
            data = file.read(_LONGEST + 1)
    else:
        if sys.stdin.isatty():
            print("paste the bytes, then press Ctrl-D (Ctrl-Z Enter on Windows)", file=sys.stderr)
        data = sys.stdin.buffer.read(_LONGEST + 1)
    if len(data) > _LONGEST:
        raise UsageError(f"over {_LONGEST >> 20} MiB of text is no paste; rtuscope export reads captures of any size")
    from captures.text import encodings

    if encodings.is_binary(data[:_HEAD]):
        raise UsageError(
            f"{_source(arguments)}: bytes, not text: parse reads hex (xxd -p FILE | rtuscope parse); "
            "a capture is read by rtuscope export FILE.bin"
        )
    return encodings.decoded(data)
