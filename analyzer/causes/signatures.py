"""What became of one answer, read from its bytes: where it is damaged, and how.

The request says how the answer must begin (unit, function, byte count; all of an echo) and how long it is; a good
answer to the same poll says about what it holds. With so much known the check value can be asked what the bytes
themselves do not tell: whether the rest is whole when the first ones are put right, or only the last one is wrong.
"""

from __future__ import annotations

import builtins
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from itertools import pairwise
from typing import Final

from dissectors.crc import byte_between, crc16, crc_bytes, flipped_bit, matching, needed, registers
from dissectors.lengths import expectation
from dissectors.limits import EXCEPTION, EXCEPTION_ADU

from ..tables.schema import Kind
from .exchanges import Ending
from .rawbytes import COLON, KnownRequests, ascii_due, is_in_ascii, read_ascii
from .samples import Sample, SampleRow, asked_in_pieces

_HEAD_MOST: Final = 12  # bytes that may be put right
_LEAST: Final = 4
_ZEROS: Final = 8  # more is a break, not what a driver or a buffer adds
LONG: Final = 6  # bytes: noise of so many may have been a request
_LOST: Final = 2  # bytes of a head
_NO_CHECK: Final = "00 00"
AHEAD: Final = "before"  # what stands beside a good answer stands ahead of it
_HEAD: Final = 3  # bytes: of an answer the third is its byte count
_COUNTED: Final = 3  # bytes of an answer's header that has a byte count
_TAIL_BITS: Final = 2  # bits of a byte that must have come before its driver let go
_LOCAL: Final = 0.55  # share of bytes like those of a good answer: the damage is somewhere, not everywhere
_SURELY: Final = 1.5  # times what silences may be wrong by
_APART_CHARS: Final = 12.0  # silence behind which bytes are no longer of one answer


class AnswerDamage(Enum):
    """What happened to an answer."""

    NONE = "none"
    HEAD = "head"  # the first bytes, the rest is whole
    TAIL = "tail"  # the last bytes
    CUT = "cut"  # it begins well and ends early
    BITS = "bits"  # one byte has flipped bits
    MIDDLE = "middle"  # it begins well, and some of it is wrong
    LONG = "long"  # it begins well, and is longer than it may be
    CONVENTION = "convention"  # whole, by another check value
    COUNT = "count"  # whole, but its byte count is wrong
    CROSSED = "crossed"  # the next request comes into it
    OTHER = "other"  # a right frame, and not the answer
    WHOLE = "whole"  # nothing of it is right


class Behind(Enum):
    """What stood between a good answer and the next request."""

    NOTHING = "nothing"
    ZEROS = "zeros"  # a few 00 right behind it
    REQUEST = "request"  # a request, damaged
    ANSWER = "answer"  # a second answer
    NOISE = "noise"


@dataclass(frozen=True, slots=True)
class Signature:
    """The reading of one sample.

    `bytes` how many are damaged or lost, `length` how many came (of a good answer: behind it), `at` the first damaged byte (-1 unknown), `flips` the
    bits of it that are wrong (0 the earliest), `t_ns` when, `marks` bytes that the UART marked, `detail` a name, `heard` its
    bytes (of a good answer: those of no right frame behind it, or else before it).
    """

    damage: AnswerDamage
    behind: Behind = Behind.NOTHING
    bytes: int = 0
    length: int = 0
    due: int = 0
    at: int = -1
    flips: tuple[int, ...] = ()
    t_ns: int = -1
    marks: int = 0
    detail: str = ""
    t_behind: int = -1
    echoed: bool = False  # it begins with its request once more
    delay: int = -1  # ns from the request to its first byte
    heard: builtins.bytes = b""
    request: builtins.bytes = b""
    rested: int = -1  # ns from the end of a good answer to what came behind it
    most: int = 0  # of what came behind an answer: as many without a silence between them


def is_like_request(reading: Signature) -> bool:
    """Whether what stands behind an answer is a request, damaged: known again, or as long as one."""
    return reading.behind is Behind.REQUEST or (reading.behind is Behind.NOISE and reading.most >= LONG)


def signature(sample: Sample, char_ns: float, requests: KnownRequests, *, off_ns: float) -> Signature:
    """Read a sample. `requests`: those of this bus, by which a damaged one is known again; `off_ns`: by how much silences
    may be wrong, infinite where nobody knows."""
    if sample.outcome in (Ending.OK, Ending.EXCEPTION):
        return _beside_good(sample, requests, _APART_CHARS * char_ns + off_ns)
    burst, rest = _first_burst(sample.pieces, _APART_CHARS * char_ns + 5e6 + _SURELY * off_ns)
    every = b"".join(piece.data for piece in sample.pieces)
    if not burst or _is_whole_in_pieces(sample, every):
        return Signature(AnswerDamage.NONE, due=sample.due)
    if _asks_in_pieces(sample, every, requests):
        return Signature(AnswerDamage.NONE, Behind.REQUEST, due=sample.due)
    data = b"".join(piece.data for piece in burst)
    echoed = data.startswith(sample.request) and len(data) > len(sample.request)
    data = data[len(sample.request) :] if echoed else data
    due = sample.due
    if is_in_ascii(sample.request):
        due = ascii_due(due)
        kind_word, count, at = read_ascii(data, due, _header(_rtu_of(sample.request)))
        found = _SignatureSums(AnswerDamage(kind_word), count, at)
    else:
        found = _read(sample, data, burst, requests)
    t = burst[0].t_start + int((max(found.at, 0) + 0.5) * char_ns)
    behind, t_behind = (_kind_of(rest, sample, requests), rest[0].t_start) if rest else (Behind.NOTHING, -1)
    marks = sum(piece.marks for piece in burst)
    return Signature(
        found.damage,
        behind,
        bytes=found.bytes,
        length=len(data),
        due=due,
        at=found.at,
        flips=found.flips,
        t_ns=t,
        marks=marks,
        detail=found.detail,
        t_behind=t_behind,
        echoed=echoed,
        delay=burst[0].t_start - sample.t_asked,
        heard=data,
        request=sample.request,
        most=_most(rest, _APART_CHARS * char_ns + off_ns),
    )


def _beside_good(sample: Sample, requests: KnownRequests, apart_ns: float) -> Signature:
    """What stands before a good answer, or behind it."""
    kind, t = _behind(sample, requests)
    at = next((i for i, piece in enumerate(sample.pieces) if piece.answers), 0)
    ahead = b"".join(piece.data for piece in sample.pieces[:at])
    if at and kind is Behind.NOTHING and (not is_in_ascii(sample.request) or ahead.strip(b"\r\n")):
        kind = Behind.NOISE
    others = [piece for piece in sample.pieces[at + 1 :] if not piece.answers]
    return Signature(
        AnswerDamage.NONE,
        kind,
        length=sum(len(piece.data) for piece in others),
        marks=sum(piece.marks for piece in sample.pieces if piece.answers),
        t_behind=t,
        detail=AHEAD if at else "",
        due=sample.due,
        rested=max(t - sample.pieces[at].t_end, 0) if t >= 0 and sample.pieces else -1,
        heard=b"".join(piece.data for piece in sample.pieces[at + 1 :] if not piece.check) or ahead,
        request=sample.request,
        most=_most(others, apart_ns),
    )


def _is_whole_in_pieces(sample: Sample, data: bytes) -> bool:
    """Whether the answer that is due is there, its rest held back by a tap, maybe with what was asked next behind it."""
    due = sample.due
    there = len(data) == due or (len(data) > due and len(sample.pieces) > 1)
    return there and crc16(data[:due]) == 0 and data.startswith(_header(sample.request))


def held_ns(sample: Sample, requests: KnownRequests) -> int:
    """The longest silence between pieces that make a whole frame: so long a tap held some of it back; 0 for none."""
    data = b"".join(piece.data for piece in sample.pieces)
    if len(sample.pieces) < 2 or not (_is_whole_in_pieces(sample, data) or _asks_in_pieces(sample, data, requests)):
        return 0
    return max(two.t_start - one.t_end for one, two in pairwise(sample.pieces))


def _asks_in_pieces(sample: Sample, data: bytes, requests: KnownRequests) -> bool:
    """Whether these bytes are a request and no answer at all, the same again or another, which a tap handed over in pieces."""
    return len(sample.pieces) > 1 and crc16(data) == 0 and (data == sample.request or requests.begin(data, sample.unit))


def known_header(request: bytes) -> bytes:
    """The first bytes on the line of a right answer to a request, in RTU or in ASCII."""
    if is_in_ascii(request):
        return COLON + _header(_rtu_of(request)).hex().upper().encode()
    return _header(request)


def _rtu_of(request: bytes) -> bytes:
    """A request in ASCII as it would be in RTU; empty where its digits are none."""
    try:
        body = bytes.fromhex(request[1:].rstrip(b"\r\n").decode("ascii"))[:-1]
    except ValueError:
        return b""
    return body + crc_bytes(body)


@lru_cache(maxsize=4096)
def _header(request: bytes) -> bytes:
    """The first bytes of a right answer: all of them, where it only echoes; none where the request cannot be read."""
    return expectation(request).header if len(request) >= _LEAST else b""


@dataclass(frozen=True, slots=True)
class _SignatureSums:
    damage: AnswerDamage
    bytes: int = 0
    at: int = -1
    flips: tuple[int, ...] = ()
    detail: str = ""


def _read(sample: Sample, data: bytes, burst: list[SampleRow], requests: KnownRequests) -> _SignatureSums:
    due, header = sample.due, _header(sample.request)
    refused = bytes((sample.unit, sample.function | EXCEPTION))
    whole = _whole(data, burst, due, header, refused)
    if whole is not None:
        return whole
    if due < _LEAST and len(header) >= _LEAST:  # of no known length: by its check value, if only its head is wrong
        may = (_of_length(sample, data, len(data) + lost, header) for lost in range(_LOST + 1))
        return next((each for each in may if each is not None), _SignatureSums(AnswerDamage.WHOLE, len(data), 0))
    if due < _LEAST or len(header) < 2:
        return _SignatureSums(AnswerDamage.WHOLE, len(data), 0)
    echo = b""  # the answer is the request once more
    if len(header) == due - 2:
        header += crc_bytes(header)
        echo = sample.request if header == sample.request else echo
    for length, head in ((due, header), (EXCEPTION_ADU, refused)):
        found = _of_length(sample, data, length, head)
        if found is not None:
            return found
    crossed = requests.are_in(data, echo) or requests.begin(data, sample.request[0])
    if crossed or any(piece.kind == Kind.REQUEST for piece in burst[1:]):
        return _SignatureSums(AnswerDamage.CROSSED, 1, 0)
    begins = data.startswith(header[:3]) if len(data) >= 3 else data == header[: len(data)]
    return (
        (_ends_otherwise(data, due) if begins else None)
        or _flipped(data, due)
        or _like_usual(sample, data, begins=begins)
    )


def _whole(data: bytes, burst: list[SampleRow], due: int, header: bytes, refused: bytes) -> _SignatureSums | None:
    """What is a right frame, though not the answer that is due."""
    right = crc16(data) == 0
    if right and len(data) > _LEAST and data[:2] == header[:2]:
        return _SignatureSums(AnswerDamage.COUNT if len(burst) == 1 or len(data) != due else AnswerDamage.NONE, 1, 2)
    if any(piece.check and piece.kind == Kind.RESPONSE for piece in burst):
        return _SignatureSums(AnswerDamage.OTHER, at=0)
    if right and len(data) == EXCEPTION_ADU and data.startswith(refused):
        return _SignatureSums(AnswerDamage.NONE)
    return None


def _ends_otherwise(data: bytes, due: int) -> _SignatureSums | None:
    """What begins well and is shorter or longer than is due."""
    if len(data) == due - 1:
        return _SignatureSums(AnswerDamage.MIDDLE, 1, _HEAD)  # the check value is there, so it is lost inside
    if len(data) < due:
        return _SignatureSums(AnswerDamage.CUT, due - len(data), len(data))
    if len(data) > due + 2:
        return _SignatureSums(AnswerDamage.LONG, len(data) - due, due)
    return None


def _of_length(sample: Sample, data: bytes, due: int, header: bytes) -> _SignatureSums | None:
    """What is right but for its head, its tail, its convention or one bit, if it should have had this length."""
    count = len(data)
    if count == due and crc16(data) == 0:
        return None  # whole, and something else: a request in two pieces, say
    usual = sample.usual if sample.usual is not None and len(sample.usual) == due else b""
    known = header + usual[len(header) : max(due - 2, 0)]
    if count == due and data.startswith(header[:3]):
        variant = next(matching(data), None)
        if variant is not None or not any(data[-2:]):
            return _SignatureSums(AnswerDamage.CONVENTION, 2, due - 2, (), variant.name if variant else _NO_CHECK)
    for head in range(1, min(len(known), _HEAD_MOST, due - 3) + 1):
        rest = due - head
        if count >= rest and crc16(known[:head] + data[count - rest :]) == 0:
            return _headless(data, known[:head]) if count == due else _SignatureSums(AnswerDamage.HEAD, head, 0)
    if data.startswith(header[: min(3, due - 2)]) and count >= due - 1:
        return _tail(data, due)
    return None


def _headless(data: bytes, head: bytes) -> _SignatureSums:
    """What is wrong with the first bytes of an answer as long as is due: damage at its head begins with its first byte."""
    wrong = [i for i, (one, two) in enumerate(zip(head, data, strict=False)) if one != two]
    at = wrong[0]
    flips = _bits(data[at] ^ head[at]) if len(wrong) == 1 else ()
    if not at:
        return _SignatureSums(AnswerDamage.HEAD, len(head), 0, flips if len(head) == 1 else ())
    return _SignatureSums(AnswerDamage.BITS if flips else AnswerDamage.MIDDLE, len(wrong), at, flips)


def _tail(data: bytes, due: int) -> _SignatureSums | None:
    """The check value's bytes lost or with high bits set, all before them right."""
    first, second = crc_bytes(data[: due - 2])
    rest = data[due - 2 :]
    if rest[:1] == bytes((first,)):
        if len(rest) == 1 or (rest[1] != second and _let_go(rest[1], second)):
            return _SignatureSums(AnswerDamage.TAIL, 1, due - 1)
        return None
    if rest and _let_go(rest[0], first) and (len(rest) == 1 or rest[1] == 0xFF):
        return _SignatureSums(AnswerDamage.TAIL, 2, due - 2)
    return None


def _let_go(byte: int, sent: int) -> bool:
    """Whether a byte is what is left when its driver lets go: some low bits as sent, then ones."""
    for count in range(_TAIL_BITS, 8):
        mask = (1 << count) - 1
        if byte == (sent & mask) | (0xFF & ~mask):
            return True
    return byte == 0xFF


def _flipped(data: bytes, due: int) -> _SignatureSums | None:
    if len(data) != due:
        return None
    if (bit := flipped_bit(crc16(data), due)) is not None:
        return _SignatureSums(AnswerDamage.BITS, 1, bit[0], (bit[1],))
    before, after = registers(data), needed(data)
    fits = [(i, byte) for i in range(due) if (byte := byte_between(before[i], after[i + 1])) is not None]
    short = [(i, _bits(byte ^ data[i])) for i, byte in fits]
    runs = [(i, bits) for i, bits in short if bits and bits[-1] - bits[0] < len(bits) + 1]
    if len(runs) == 1:
        return _SignatureSums(AnswerDamage.BITS, 1, runs[0][0], runs[0][1])
    return None


def _bits(pattern: int) -> tuple[int, ...]:
    return tuple(i for i in range(8) if pattern >> i & 1)


def _like_usual(sample: Sample, data: bytes, *, begins: bool) -> _SignatureSums:
    """How much of it is as in a good answer, from its beginning and from its end."""
    usual = sample.usual
    if usual is None or len(usual) != sample.due:
        if begins:
            return _SignatureSums(AnswerDamage.MIDDLE, 1, 3)
        header = _header(sample.request)
        wrong = [i for i, (one, two) in enumerate(zip(header, data, strict=False)) if one != two]
        return _SignatureSums(AnswerDamage.WHOLE, len(data), wrong[0] if wrong else 0)
    body = len(usual) - 2
    ahead = [one == two for one, two in zip(usual[:body], data, strict=False)]
    aback = [one == two for one, two in zip(reversed(usual[:body]), reversed(data[:-2]), strict=False)]
    share = max(sum(ahead), sum(aback)) / max(body, 1)
    if share < _LOCAL:
        return _SignatureSums(AnswerDamage.WHOLE, len(data), 0)
    if sum(aback) > sum(ahead) and not begins:
        first = len(aback) - next((i for i, same in enumerate(aback) if not same), 0)
        headless = all(aback[: len(aback) // 2])
        return _SignatureSums(
            AnswerDamage.HEAD if headless else AnswerDamage.MIDDLE, max(1, first) if headless else 1, 0
        )
    wrong = [i for i, same in enumerate(ahead) if not same]
    at = wrong[0] if wrong else body
    flips = _bits(usual[at] ^ data[at]) if len(wrong) == 1 and at < min(len(data), 3) else ()
    return _SignatureSums(AnswerDamage.MIDDLE, max(len(wrong), 1), at, flips)


def _most(pieces: Sequence[SampleRow], apart_ns: float) -> int:
    """The bytes of the longest run of pieces between which there is no such silence."""
    longest, run, end = 0, 0, -1
    for piece in pieces:
        run = len(piece.data) + (run if end >= 0 and piece.t_start - end <= apart_ns else 0)
        longest, end = max(longest, run), piece.t_end
    return longest


def _first_burst(pieces: tuple[SampleRow, ...], apart_ns: float) -> tuple[list[SampleRow], list[SampleRow]]:
    """The pieces that one silence ends, and those behind it."""
    for i in range(1, len(pieces)):
        if pieces[i].t_start - pieces[i - 1].t_end > apart_ns:
            return list(pieces[:i]), list(pieces[i:])
    return list(pieces), []


def _behind(sample: Sample, requests: KnownRequests) -> tuple[Behind, int]:
    at = next((i for i, piece in enumerate(sample.pieces) if piece.answers), -1)
    rest = [piece for i, piece in enumerate(sample.pieces) if i > at]
    if not rest:
        return Behind.NOTHING, -1
    return _kind_of(rest, sample, requests), rest[0].t_start


def _kind_of(rest: list[SampleRow], sample: Sample, requests: KnownRequests) -> Behind:
    again = [piece.check and piece.kind == Kind.RESPONSE and piece.unit == sample.unit for piece in rest]
    if any(again):
        first = again.index(True)
        asked = asked_in_pieces(b"".join(piece.data for piece in rest[:first]), rest[first].data)
        return Behind.NOTHING if asked else Behind.ANSWER
    if all(piece.check for piece in rest):
        return Behind.NOTHING
    data = b"".join(piece.data for piece in rest)
    if crc16(data) == 0 and len(data) >= _LEAST:
        return Behind.NOTHING  # whole after all, in pieces
    if len(data) > 2 * _LEAST and requests.asks_and_gets(data):
        return Behind.NOTHING
    if is_in_ascii(sample.request) and not data.strip(b"\r\n"):
        return Behind.NOTHING  # the end of a line, behind a pause of the tap's
    if not any(data) and len(data) <= _ZEROS:
        return Behind.ZEROS
    header = _header(sample.request)[:_COUNTED]
    if len(header) == _COUNTED and header != sample.request[:_COUNTED] and data.startswith(header):
        return Behind.ANSWER
    if requests.end(data) or any(piece.kind == Kind.REQUEST for piece in rest):
        return Behind.REQUEST
    return Behind.NOISE
