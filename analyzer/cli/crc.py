"""`rtuscope crc`: compute the check value of bytes and print the whole frame."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from dissectors.values import harmless

from ..languages import tr
from .commands import DONE, UsageError
from .terminal import put_json

EXAMPLE = """\
rtuscope crc 11 03 00 6B 00 03
rtuscope crc --json 1103006B0003"""
_LONGEST = 65_536  # bytes: far more than any frame
_BYTE, _DIGITS = 255, 3
_HEX = frozenset("0123456789abcdefABCDEF")
_BETWEEN = str.maketrans(",;:-|[]{}()", " " * 11)


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
    """The bytes that a text gives, all of it, for the frame is sent: what may be another byte, or none, is refused."""
    from dissectors.crc import lrc

    is_ascii = text.startswith(":")
    words = text.removeprefix(":").replace("\\x", " 0x").translate(_BETWEEN).split()
    data = _octets(["".join(words)] if is_ascii else words)
    if is_ascii and len(data) > 2 and lrc(data[:-1]) == data[-1]:
        data = data[:-1]
    if not 0 < len(data) <= _LONGEST:
        raise UsageError(f"{len(data):,} bytes: a check value needs 1 to {_LONGEST:,} bytes")
    return data


def _octets(words: Sequence[str]) -> bytes:
    """The bytes of words: pairs of hex digits, with 0x or not; hex or decimal numbers without zeros before them."""
    plain = [word for word in words if not _is_marked(word)]
    digits = [word[2:] if _is_marked(word) else word for word in words]
    for word, shown in zip(words, digits, strict=True):
        if not shown or not set(shown) <= _HEX:
            raise _no_byte(word)
    odd = [word for word in plain if len(word) % 2]
    if odd and any(word.startswith("0") for word in plain if len(word) > 1):
        raise _no_byte(odd[0])  # a digit of it is lost: zeros are written
    if odd and all(map(str.isdigit, plain)):
        longest = max(map(len, plain))
        return b"".join(_pairs(word[2:]) if _is_marked(word) else _decimal(word, longest) for word in words)
    if any(len(word) > 1 for word in odd):
        raise _no_byte(max(odd, key=len))
    return b"".join(map(_pairs, digits))


def _is_marked(word: str) -> bool:
    return word[:2].lower() == "0x"


def _pairs(digits: str) -> bytes:
    return bytes.fromhex(digits.rjust(len(digits) + len(digits) % 2, "0"))


def _decimal(word: str, longest: int) -> bytes:
    """A number among decimal digits alone, which are hex just as well unless the longest has three."""
    if len(word) > _DIGITS or int(word) > _BYTE:
        raise _no_byte(word)
    if int(word) in range(10, 100) and longest < _DIGITS:
        raise UsageError(f"'{word}' may be hex or decimal: write two hex digits for each byte, or 0x{word}")
    return bytes((int(word),))


def _no_byte(word: str) -> UsageError:
    return UsageError(f"'{harmless(word)}' is not a byte: write two hex digits for each, such as 11 03 00 6B")


def _spaced(data: bytes) -> str:
    return data.hex(" ").upper()
