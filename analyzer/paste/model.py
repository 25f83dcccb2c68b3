"""What a paste holds: frames and what is none, in order, tiling its bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from dissectors.annotation import Context, annotate, summary
from dissectors.crc import crc_bytes
from dissectors.envelopes import Adu
from dissectors.fields import ENGLISH, Field, Wording
from dissectors.functions import function_name
from dissectors.length_rules import Role
from dissectors.limits import CRC_SIZE, EXCEPTION
from dissectors.subject import NOTHING, SpokenPdu, Subject, subject

from ..requests.advice import Advice, advice
from ..tables.spoken import spoken_json

if TYPE_CHECKING:
    from captures.text.logs import UnreadLine

    from ..tables.findings import Finding


Envelope = Literal["auto", "rtu", "ascii", "tcp", "pdu"]


class PastePart(NamedTuple):
    """Bytes of a paste that stand together; `mark` is 0, or 1 and 2 for what the text calls sent and received.

    `t_ns` is their time in ns; `ascii` says that the text shows them as an ASCII-mode frame.
    """

    data: bytes
    mark: int = 0
    t_ns: int | None = None
    ascii: bool = False


def edges_of(parts: Sequence[PastePart]) -> list[int]:
    """Where parts begin, and the end of the last."""
    return [*accumulate((len(part.data) for part in parts), initial=0)]


@dataclass(frozen=True, slots=True)
class PastedFrame:
    """A frame: whole, damaged (its check value is wrong) or cut (bytes of it are missing)."""

    adu: Adu
    role: Role
    start: int  # offset in the pasted bytes
    length: int  # pasted bytes that it takes
    request: bytes | None = None  # PDU of the request that it answers
    request_start: int | None = None
    also: Role | None = None  # its bytes read as this too
    missing: int = 0  # bytes still to come
    length_known: bool = True  # if not, `missing` is the least
    unchecked: bool = False  # its text leaves the check values of frames out
    confidence: float = 1.0
    t_start_ns: int | None = None
    t_end_ns: int | None = None
    response_time_ns: int | None = None
    mark: int = 0  # of the part that it begins in
    findings: tuple[Finding, ...] = ()

    @property
    def function(self) -> int | None:
        """The function code without the exception bit; None where it is missing."""
        return self.adu.pdu[0] & 0x7F if self.adu.pdu else None

    @property
    def exception(self) -> int | None:
        """The exception code of an exception answer."""
        pdu = self.adu.pdu
        return pdu[1] if len(pdu) > 1 and pdu[0] & EXCEPTION and self.role is Role.RESPONSE else None

    @property
    def check_ok(self) -> bool | None:
        """Check value right; None where the envelope has none, or the text leaves it out. A cut frame's is not."""
        return None if self.unchecked else False if self.missing else self.adu.check_ok

    @property
    def lacks_crc(self) -> bool:
        """Whether it is whole but for its CRC."""
        return self.adu.protocol == "rtu" and self.missing == CRC_SIZE and self.length_known

    @property
    def is_right(self) -> bool:
        """Whether it is whole, and no check value wrong."""
        return self.check_ok is not False

    @property
    def to_send(self) -> bytes | None:
        """Of an RTU frame that lacks its CRC alone, or the second byte of it, the frame with it; None of others."""
        body = self.adu.data[:-1] if self.missing == 1 else self.adu.data
        if self.adu.protocol != "rtu" or not self.length_known or self.missing not in (1, CRC_SIZE):
            return None
        whole = body + crc_bytes(body)
        return whole if whole.startswith(self.adu.data) else None

    def fields(self, role: Role | None = None, wording: Wording = ENGLISH) -> tuple[Field, ...]:
        """Every field, read as the frame's own role or as another."""
        role = self.role if role is None else role
        fields = annotate(self.adu, role, self._context(role), wording)
        return tuple(field for field in fields if field.length or not self.missing)

    def summary(self, role: Role | None = None, wording: Wording = ENGLISH) -> str:
        """The frame in words, on one line."""
        role = self.role if role is None else role
        return summary(self.adu, role, self._context(role), wording)

    @property
    def subject(self) -> Subject:
        """The address, quantity and values that it speaks of."""
        pdu = SpokenPdu(self.adu.pdu, self._context(self.role).request or b"")
        return NOTHING if self.function is None else subject(self.function, self.role, self.exception, pdu, self.fields)

    def _context(self, role: Role) -> Context:
        return Context(request=self.request) if role is Role.RESPONSE and self.request is not None else Context()

    @property
    def advice(self) -> Advice | None:
        """Why a unit refuses the request that this answers, or no unit can serve this request; None for neither."""
        if self.missing or self.check_ok is False or self.adu.unit is None or not self.adu.pdu:
            return None
        if self.role is Role.REQUEST:
            return advice(self.adu.unit, self.adu.pdu)
        return advice(self.adu.unit, self.request, self.exception) if self.request and self.exception else None

    def to_json(self, index: int) -> dict[str, Any]:
        """The keys of a frame's JSON line; `also`, `missing`, `to_send`, `reason`, `ask_instead` where there is any."""
        function = self.function
        line: dict[str, Any] = {
            "index": index,
            "start": self.start,
            "length": self.length,
            "t_start_ns": self.t_start_ns,
            "t_end_ns": self.t_end_ns,
            "protocol": self.adu.protocol,
            "direction": self.role.name.lower(),
            "unit": self.adu.unit,
            "function": function,
            "name": None if function is None else function_name(function),
            "exception": self.exception,
            "crc_ok": self.check_ok,
            "request_start": self.request_start,
            "taken_for_start": None,
            "unsure": False,
            "response_time_ns": self.response_time_ns,
            "hex": self.adu.data.hex(),
            "fields": [field.to_json() for field in self.fields()],
            **spoken_json(self.subject, self.summary(), self.t_start_ns),
            "confidence": round(self.confidence, 6),
            "findings": [finding.to_json() for finding in self.findings],
        }
        if (found := self.advice) is not None:
            line |= {"reason": found.reason, "ask_instead": [each.adu.hex() for each in found.ask_instead]}
        if self.missing:
            line["missing"] = self.missing
            if (whole := self.to_send) is not None:
                line["to_send"] = whole.hex()
        if self.also is not None:
            fields = [field.to_json() for field in self.fields(self.also)]
            line["also"] = {"direction": self.also.name.lower(), "fields": fields}
        return line


@dataclass(frozen=True, slots=True)
class PastedNoise:
    """Bytes that no frame explains."""

    start: int
    data: bytes
    findings: tuple[Finding, ...] = ()

    @property
    def length(self) -> int:
        return len(self.data)

    def to_json(self) -> dict[str, Any]:
        """The keys of a noise line."""
        return {
            "kind": "noise",
            "start": self.start,
            "length": self.length,
            "t_start_ns": None,
            "t_end_ns": None,
            "hex": self.data.hex(),
            "findings": [finding.to_json() for finding in self.findings],
        }


Piece = PastedFrame | PastedNoise


def frames_of(pieces: Iterable[Piece]) -> list[PastedFrame]:
    """The frames of some pieces, damaged and cut ones among them."""
    return [piece for piece in pieces if isinstance(piece, PastedFrame)]


def right_frames(pieces: Iterable[Piece]) -> list[PastedFrame]:
    """The frames of some pieces that are whole, no check value wrong."""
    return [frame for frame in frames_of(pieces) if frame.is_right]


def tiled(data: bytes, start: int, frames: Sequence[PastedFrame]) -> list[Piece]:
    """The frames of these bytes, which begin at an offset of the paste, with what lies between them as noise."""
    pieces: list[Piece] = []
    at = start
    for frame in frames:
        pieces += [PastedNoise(at, data[at - start : frame.start - start]), frame]
        at = frame.start + frame.length
    pieces.append(PastedNoise(at, data[at - start :]))
    return [piece for piece in pieces if piece.length]


@dataclass(frozen=True, slots=True)
class Paste:
    """A paste with its reading: the envelope that was taken, why, the pieces, and the lines that were not read."""

    protocol: str  # rtu, ascii, tcp or pdu; of several the one of most lines
    why: str
    pieces: tuple[Piece, ...]
    unread: tuple[UnreadLine, ...] = ()

    def frames(self) -> Iterator[PastedFrame]:
        """The frames, cut ones among them."""
        return iter(frames_of(self.pieces))

    @property
    def holds_a_frame(self) -> bool:
        """Whether a frame, right or damaged, is there whole."""
        return any(not frame.missing for frame in self.frames())

    @property
    def errors(self) -> int:
        """How many findings are errors."""
        return sum(finding.severity.name == "ERROR" for piece in self.pieces for finding in piece.findings)

    def to_json(self, *, noise: bool = False) -> Iterator[dict[str, Any]]:
        """A JSON object a frame, and a piece of noise if asked."""
        index = 0
        for piece in self.pieces:
            if isinstance(piece, PastedFrame):
                yield piece.to_json(index)
                index += 1
            elif noise:
                yield piece.to_json()
