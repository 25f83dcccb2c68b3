"""What stands around digits: the offset of a dump, a word that names something else, the rest of a cut text."""

from __future__ import annotations

import re
from typing import Final

from .candidates import H, HexWindow, TextLine, Writing
from .rows import ROWS

_OFFSET: Final = re.compile(
    rf"(?:^|[^\w.:-])(?P<all>(?:0[xX])?({H}{{4,8}}|{H}{{3}}(?=:)))[hH]?[ \t]*(?:[:|]|-(?=[ \t]))?[ \t]*$"
)
_ELLIPSIS: Final = re.compile(r"[ ,]?,? ?(?:\.\.\.(?![\w.])|…)")
_HALF_AFTER: Final = re.compile(rf"[ \t]{{1,4}}({H}|{H}{{3}})(?=[ \t]*$|[ \t]+{H}{{2}}(?:\s|$))")
_HALF_BEFORE: Final = re.compile(rf"(?:^|[ \t])({H})[ \t]{{1,4}}$")
_URL: Final = re.compile(r"://[^\s?=]*$")  # up to what it asks
_NAMES: Final = re.compile(r"[a-z][a-z0-9/]*")
_OTHER_THINGS: Final = frozenset(
    [
        "mac",
        "bssid",
        "uuid",
        "guid",
        "sha",
        "sha1",
        "sha256",
        "md5",
        "hash",
        "commit",
        "rev",
        "revision",
        "version",
        "serial",
        "s/n",
        "sn",
        "key",
        "token",
        "chip",
        "eui",
        "ip",
        "ptr",
        "pointer",
        "date",
        "time",
        "id",
        "chipid",
        "oid",
        "imei",
        "iccid",
    ]
)
_OF_THINGS: Final = frozenset(["address", "addr", "number", "id", "no", "nr"])
_OFFSET_ENDS: Final = frozenset("0123456789abcdefABCDEFhH")
_ELLIPSIS_STARTS: Final = frozenset(" ,.…")
_NUMBER: Final = 2  # bytes that may be one number
_FEW: Final = 17  # characters: six bytes


def in_its_place(found: HexWindow, line: TextLine) -> HexWindow:
    """A candidate with what stands before it taken into account."""
    before = line.before(found.start)
    bare = before.rstrip(" \t:|-")
    if found.shape in ROWS and bare[-1:] in _OFFSET_ENDS and (offset := _OFFSET.search(before)) is not None:
        begin = found.start - len(before) + offset.start("all")
        if begin in line.first:
            number = len(found.data) <= _NUMBER and line.text[found.start : found.end].isdigit()  # `40003: 1000`
            level = (
                found.level if number else max(found.level, Writing.BYTES if len(found.data) > 2 else Writing.LIKELY)
            )
            return found._replace(offset=offset[2], level=level, lead=begin)
    if found.level and not found.ascii and is_named_otherwise(before):
        return found._replace(level=Writing.NUMBER, lead=found.start)
    return found._replace(lead=found.start)


def is_named_otherwise(before: str) -> bool:
    """Whether the words before some digits say that they are an address, a name or the like, and no bytes."""
    if before.endswith(("@", "::")) or _URL.search(before):
        return True
    words = _NAMES.findall(before.lower())[-2:]
    return (
        bool(words)
        and len(before) - before.lower().rfind(words[-1]) - len(words[-1]) < 4
        and (words[-1] in _OTHER_THINGS or (words[-1] in _OF_THINGS and words[0] in _OTHER_THINGS))
    )


def is_cut(line: TextLine, end: int) -> bool:
    """Whether the text says, at the end of some bytes, that there are more."""
    return line.text[end : end + 1] in _ELLIPSIS_STARTS and _ELLIPSIS.match(line.text, end) is not None


def is_halved(line: TextLine, start: int, end: int) -> bool:
    """Whether half a byte stands beside these bytes."""
    if _HALF_AFTER.match(line.text, end):
        return True
    return end - start < _FEW and _HALF_BEFORE.search(line.before(start)) is not None
