"""What became of one answer, damaged or well, and what stood beside it."""

from __future__ import annotations

import builtins
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from itertools import pairwise
from typing import Final

from dissectors.crc import crc16, crc_bytes
from dissectors.lengths import expectation
from dissectors.limits import EXCEPTION

from ..tables.schema import Kind
from ..tables.transactions import NEVER
from .answerdamage import LEAST, AnswerDamage, DamageRead, HeardAnswer, read_damage
from .exchanges import Ending
from .rawbytes import COLON, KnownRequests, ascii_due, is_in_ascii, read_ascii
from .samples import Sample, SampleRow, asked_in_pieces

__all__ = (
    "AHEAD",
    "LONG",
    "AnswerDamage",
    "Behind",
    "Signature",
    "held_ns",
    "is_like_request",
    "known_header",
    "signature",
)

_ZEROS: Final = 8  # more is a break, not what a driver or a buffer adds
LONG: Final = 6  # bytes: noise of so many may have been a request
AHEAD: Final = "before"  # what stands beside a good answer stands ahead of it
_COUNTED: Final = 3  # bytes of an answer's header that has a byte count
_SURELY: Final = 1.5  # times what silences may be wrong by
_APART_CHARS: Final = 12.0  # silence behind which bytes are no longer of one answer


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
    left: int = NEVER  # ns from the end of what came there to the next request, as far as clocks tell
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
        found = DamageRead(AnswerDamage(kind_word), count, at)
    else:
        found = read_damage(_heard(sample, data, burst, requests))
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
        left=sample.t_next - max((piece.t_end for piece in sample.pieces), default=NEVER),
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
    return expectation(request).header if len(request) >= LEAST else b""


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


def _heard(sample: Sample, data: bytes, burst: list[SampleRow], requests: KnownRequests) -> HeardAnswer:
    """A damaged answer with what is known of the right one."""
    request = sample.request

    def asked(right: bytes) -> bool:
        found = requests.are_in(data, request if right == request else b"") or requests.begin(data, request[0])
        return found or any(piece.kind == Kind.REQUEST for piece in burst[1:])

    return HeardAnswer(
        data,
        sample.due,
        _header(request),
        bytes((sample.unit, sample.function | EXCEPTION)),
        sample.usual or b"",
        len(burst),
        any(piece.check and piece.kind == Kind.RESPONSE for piece in burst),
        asked,
    )


def _behind(sample: Sample, requests: KnownRequests) -> tuple[Behind, int]:
    at = next((i for i, piece in enumerate(sample.pieces) if piece.answers), -1)
    rest = list(sample.pieces[at + 1 :])
    return (_kind_of(rest, sample, requests), rest[0].t_start) if rest else (Behind.NOTHING, -1)


def _follow(rest: Sequence[SampleRow], sample: Sample) -> bool:
    """Whether bytes are nearer to what came before them than to the next request."""
    ended = max((piece.t_end for piece in sample.pieces[: -len(rest)]), default=sample.t_asked)
    return rest[0].t_start - ended <= abs(sample.t_next - rest[-1].t_end)  # far below 0 where none comes


def _kind_of(rest: list[SampleRow], sample: Sample, requests: KnownRequests) -> Behind:
    again = [piece.check and piece.kind == Kind.RESPONSE and piece.unit == sample.unit for piece in rest]
    if any(again):
        first = again.index(True)
        asked = asked_in_pieces(b"".join(piece.data for piece in rest[:first]), rest[first].data)
        return Behind.NOTHING if asked else Behind.ANSWER
    data, header = b"".join(piece.data for piece in rest), _header(sample.request)[:_COUNTED]
    kinds: tuple[tuple[Behind, Callable[[], bool]], ...] = (
        (Behind.NOTHING, lambda: all(piece.check for piece in rest)),
        (Behind.NOTHING, lambda: crc16(data) == 0 and len(data) >= LEAST),  # whole after all, in pieces
        (Behind.NOTHING, lambda: len(data) > 2 * LEAST and requests.asks_and_gets(data)),
        (
            Behind.NOTHING,
            lambda: is_in_ascii(sample.request) and not data.strip(b"\r\n"),
        ),  # a line's end, after a pause
        (Behind.ZEROS, lambda: len(data) <= _ZEROS and not any(data) and _follow(rest, sample)),
        (
            Behind.ANSWER,
            lambda: len(header) == _COUNTED and header != sample.request[:_COUNTED] and data.startswith(header),
        ),
        (Behind.REQUEST, lambda: requests.end(data) or any(piece.kind == Kind.REQUEST for piece in rest)),
    )
    return next((kind for kind, is_so in kinds if is_so()), Behind.NOISE)
