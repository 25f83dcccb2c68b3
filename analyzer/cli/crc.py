"""`rtuscope crc`: compute the check value of bytes and print the whole frame."""

from __future__ import annotations

import argparse

from ..languages import tr
from .commands import DONE, UsageError
from .terminal import put_json

EXAMPLE = """\
rtuscope crc 11 03 00 6B 00 03
rtuscope crc --json 1103006B0003"""
_LONGEST = 65_536  # bytes: far more than any frame


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("hex", nargs="+", metavar="HEX", help="the frame's bytes, without a check value or with one")
    parser.add_argument("--json", action="store_true", help="an object with crc, lrc, rtu and ascii")


def run(arguments: argparse.Namespace) -> int:
    """Print them."""
    from dissectors.crc import crc_bytes, crc_ok, lrc

    data = _bytes(" ".join(arguments.hex))
    checked = len(data) > 2 and crc_ok(data)
    body = data[:-2] if checked else data
    crc = crc_bytes(body)
    made = {
        "crc": _spaced(crc),
        "lrc": f"{lrc(body):02X}",
        "rtu": _spaced(body + crc),
        "ascii": f":{body.hex().upper()}{lrc(body):02X}",
    }
    if arguments.json:
        put_json(made)
        return DONE
    if checked:
        print(tr("The last two bytes are the correct CRC of the bytes before them."))
    print(tr("CRC    {crc}  (low byte first, as it is sent; as a number 0x{number:04X})",
             crc=made["crc"], number=int.from_bytes(crc, "little")))  # fmt: skip
    print(tr("RTU    {frame}", frame=made["rtu"]))
    print(tr("ASCII  {frame}  (LRC {lrc})", frame=made["ascii"], lrc=made["lrc"]))
    return DONE


def _bytes(text: str) -> bytes:
    """The bytes that a text gives, all of them."""
    from captures.errors import HexError
    from captures.hexwords import read_text

    digits = text.replace("0x", " ").replace("\\x", " ").replace(",", " ")
    try:
        data = bytes.fromhex("".join(digits.split()))
    except ValueError:
        try:
            data = b"".join(words.data for words in read_text(text))
        except HexError as error:
            raise UsageError(str(error)) from error
    if not 0 < len(data) <= _LONGEST:
        raise UsageError(f"{len(data):,} bytes: a check value needs 1 to {_LONGEST:,} bytes")
    return data


def _spaced(data: bytes) -> str:
    return data.hex(" ").upper()
