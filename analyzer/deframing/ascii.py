"""ASCII mode: frames say themselves where they begin and end, so no lattice is needed.

A frame runs from `:` to CR LF ([2] 2.5.2); whatever stands between frames is noise. Direction comes from the
conversation, as in RTU mode.
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np

from dissectors.envelopes import Adu, ascii_frames
from dissectors.length_rules import Role
from dissectors.lengths import Expectation, expectation, pdu_length
from dissectors.limits import EXCEPTION, MAX_PDU

from ..options import Options
from ..tables.schema import Protocol
from .buffer import CharacterTime
from .segments import NOISE, NOISE_MOST, noise_parts
from .selfdelimited import SelfDelimitedEngine

_LONGEST: Final = 2 * (MAX_PDU + 2) + 3 + 4  # characters of a frame ([2] 2.5.2), and some that a fault may have added
_FRAME: Final = re.compile(rb"[:>][0-9A-Fa-f]{6,%d}(?:\r\n?|\n)" % _LONGEST)
_PATIENCE_NS: Final = 1_000_000_000  # that may pass between characters of one frame ([2] 2.5.2.1): a tap held them back


class AsciiEngine(SelfDelimitedEngine):
    """The same contract as `engine.Engine`, for a port that speaks ASCII mode."""

    _asked: Expectation | None
    _bare: bool
    _open: bool

    def __init__(self, character: CharacterTime, options: Options = Options(), role: Role | None = None) -> None:  # noqa: B008
        super().__init__(character, options, role)
        self._asked = None
        self._bare = False  # frames end with CR alone here
        self._open = False  # whether the last one does, what follows it tells

    def _work(self, *, last: bool = False, silence_ns: int = 0) -> None:
        buffer = self.buffer
        ready = buffer.ready
        text = (buffer.data[:ready] & 0x7F).tobytes()
        if self._open and text:
            self._bare, self._open = not text.startswith(b"\n"), False
        found: list[tuple[int, int, Adu | None]] = []
        done = 0
        for match in _FRAME.finditer(text):
            begin, behind = match.span()
            patience_ns = self._options.idle_ns if self._bare else max(self._options.idle_ns, _PATIENCE_NS)
            bare = text[behind - 1 : behind] == b"\r"
            if bare and behind == ready and silence_ns < patience_ns and not last:
                break  # a line feed may follow
            if text[behind - 2 : behind] == b"\r\n" and len(buffer.quiet(behind - 2, behind, patience_ns)):
                behind -= 1  # the line feed came too late to belong to it
            self._open = bare and behind == ready
            self._bare = bare and not self._open
            found += [(*cut, None) for cut in noise_parts(done, begin)]
            found.append((begin, behind, ascii_frames(match[0])[0]))
            done = behind
        rest = ready if last else done + max(ready - _LONGEST - done, 0) // NOISE_MOST * NOISE_MOST
        found += [(*cut, None) for cut in noise_parts(done, rest)]
        if not found:
            return
        start = np.array([each[0] for each in found], np.intp)
        end = np.array([each[1] for each in found], np.intp)
        roles = [NOISE if adu is None else self._role_of(adu) for *_, adu in found]
        check = np.array([adu is not None and bool(adu.check_ok) for *_, adu in found], np.bool_)
        heads = np.array([_head(adu) for *_, adu in found], np.uint8)
        self._give(Protocol.ASCII, start, end, np.array(roles, np.uint8), check, heads, rest)

    def _role_of(self, adu: Adu) -> Role:
        """The direction of a frame: its length tells, else the port, else the request before it."""
        fits = [role for role in Role if pdu_length(adu.pdu, role) == len(adu.pdu)]
        asked = self._asked
        answers = asked is not None and (
            asked.fits(adu.data) or (not adu.check_ok and (asked.unit, asked.function) == (adu.data[0], adu.pdu[0]))
        )
        role = self._role if self._role is not None else Role.RESPONSE if answers else Role.REQUEST
        if len(fits) == 1:
            role = fits[0]
        elif adu.pdu[0] & EXCEPTION:
            role = Role.RESPONSE
        if role is Role.RESPONSE:
            self._asked = None
        elif adu.check_ok and len(adu.data) > len(adu.pdu):
            self._asked = expectation(adu.data)
        return role


def _head(adu: Adu | None) -> tuple[int, int, int]:
    """Unit, function and the byte behind it."""
    if adu is None:
        return 0, 0, 0
    return adu.data[0], adu.pdu[0] if adu.pdu else 0, adu.pdu[1] if len(adu.pdu) > 1 else 0
