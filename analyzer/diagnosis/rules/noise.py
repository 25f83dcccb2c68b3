"""Bytes that are no frames of this bus: noise, another protocol's, and windows that check by chance.

Noise belongs to no frame; its place says where it comes from. A stretch is judged when the rows on both its sides are
known. One that an autopsy explains, that the UART marked, or that hangs together with a damaged frame is said there
and not here; without any frame nothing is noise. Bytes of another protocol that shares the pair are named and counted,
and are nobody's fault.

Windows with a right CRC that are no frames (chance, a payload that holds whole frames, a beginning that checks) are
worth a note, since a tool that looks for right CRCs takes them for frames. Only frames about which the deframer had to
weigh other explanations can hold any; those are searched again, all at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from math import nan
from typing import Final, NamedTuple

import numpy as np

from dissectors.foreign import NAMES

from ...deframing.candidates import search_candidates
from ...deframing.rules import crc_windows
from ...languages import counted, phrase
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import GLITCHES, NO_GAP, Kind, Protocol, Rows
from ...tables.taps import TapKind, tap_kind
from ..view import DiagnosisStep, where

OTHER: Final = Rule(
    "other-protocol",
    Severity.NOTE,
    About.NOISE,
    when="bytes in no Modbus frame are those of another protocol",
    numbers=("protocol", "bytes"),
    text=lambda numbers: phrase(
        "{bytes} of {protocol}: not Modbus, and not a fault",
        bytes=counted(int(numbers["bytes"]), "byte", "bytes"),
        protocol=NAMES[int(numbers["protocol"])],
    ),
    cause="devices of another protocol share the pair with Modbus",
    remedy="nothing, while Modbus devices ignore its frames; otherwise move it to its own pair",
)


@looks_for(OTHER)
def other_protocols(view: DiagnosisStep) -> Iterator[Findings]:
    """Noise that the deframer knows for another protocol's."""
    rows = where(view.rows.foreign)
    if len(rows):
        noise = view.rows[rows]
        yield OTHER.on(noise, noise.foreign, noise.length)


_GLITCH_RUN: Final = 6  # bytes
_LINE_ENDS: Final = (b"\r", b"\n", b"\r\n")
_HARD: Final = 2.5  # characters: what stands closer belongs together
_HEAD: Final = 2  # bytes that two stretches begin with, which by chance one pair in 65,536 does
_BEFORE_FRAME: Final = 1  # the same of stretches right before frames
_USUAL_CHARACTER_NS: Final = 11e9 / 9600  # where nobody said how fast the line is


class Pattern(IntEnum):
    """Where noise stands."""

    STRAY = 0  # between frames
    BEFORE = 1  # 00 or FF hard before a frame
    AFTER = 2  # hard after one
    IDLE = 3  # by itself on an idle line
    LINE_END = 4  # CR, LF or both right behind a frame
    QUOTED = 5  # among the frames of a text's few lines
    ENVELOPE = 6  # there, and it begins as one before it


def _sender(numbers: Mapping[str, float]) -> str:
    return phrase("unit {unit:.0f}", numbers) if "unit" in numbers else phrase("the client")


def _text(numbers: Mapping[str, float]) -> str:
    return _told(_TEXTS, numbers, bytes=counted(int(numbers["bytes"]), "byte", "bytes"))


def _told(words: Mapping[Pattern, str], numbers: Mapping[str, float], **more: str) -> str:
    """The words for the pattern of these numbers."""
    first = int(numbers.get("head", 0))
    head = first.to_bytes((first.bit_length() + 7) // 8, "big").hex(" ").upper()
    return phrase(words[Pattern(int(numbers["pattern"]))], sender=_sender(numbers), head=head, **more)


_TEXTS: Final = {
    Pattern.STRAY: "{bytes} outside any frame",
    Pattern.BEFORE: "{bytes} of 00 or FF right before the frame of {sender}",
    Pattern.AFTER: "{bytes} of 00 or FF right after the frame of {sender}",
    Pattern.IDLE: "{bytes} outside any frame on an idle line",
    Pattern.LINE_END: "{bytes}, a newline (0D, 0A), right after the frame of {sender}",
    Pattern.QUOTED: "{bytes} outside any frame",
    Pattern.ENVELOPE: "{bytes} outside any frame, which begin like earlier ones: {head}",
}
_CAUSES: Final = {
    Pattern.STRAY: "interference, bytes of a damaged frame, or a device that speaks another protocol",
    Pattern.BEFORE: "the driver of {sender} is enabled too early or too late, and the line floats while it switches",
    Pattern.AFTER: "the driver of {sender} is disabled too late or too early, and the line floats while it switches",
    Pattern.IDLE: "the idle line floats: bias resistors are missing or too weak, or there is interference",
    Pattern.LINE_END: "the frame of {sender} ends like a line of text; a strict unit drops it or answers into them",
    Pattern.QUOTED: "the envelope or the frames of another protocol; part of a frame; or interference",
    Pattern.ENVELOPE: "the frames of another protocol on this line, or an envelope that a program puts around frames",
}
_REMEDIES: Final = {
    Pattern.STRAY: "look at what comes before and after; check wiring, shield and termination",
    Pattern.BEFORE: "correct the driver-enable timing of {sender}; add bias resistors",
    Pattern.AFTER: "correct the driver-enable timing of {sender}; add bias resistors",
    Pattern.IDLE: "bias the line at one end (some 560 ohms to each rail), check termination and shield",
    Pattern.LINE_END: "send the bytes of the frame alone: write, not println; no line ending in a terminal",
    Pattern.QUOTED: "compare how these bytes begin and end: what is the same each time is an envelope, and no fault",
    Pattern.ENVELOPE: "see that the client skips these bytes and waits for the answer behind them",
}
NOISE: Final = Rule(
    "noise",
    Severity.WARNING,
    About.NOISE,
    when="bytes stand between frames, or right beside them",
    numbers=("pattern", "bytes", "unit", "head"),
    varies="pattern",
    text=_text,
    cause=lambda numbers: _told(_CAUSES, numbers),
    remedy=lambda numbers: _told(_REMEDIES, numbers),
)


class _OpenStretch(NamedTuple):
    """A stretch of noise that waits for the row behind it."""

    row: Rows  # one
    before: Rows  # one
    captured: bytes
    known: bool  # frames came before it

    @property
    def glitch(self) -> bool:
        return GLITCHES.issuperset(self.captured)


class _NoiseSide(NamedTuple):
    """A row beside a stretch."""

    floats: Pattern  # what a floating line looks like from it
    row: Rows  # one
    gap_ns: int  # between both
    is_frame: bool
    is_explained: bool = False  # as damage

    @property
    def is_damaged(self) -> bool:
        return self.is_explained or not self.row.check[0]

    @property
    def sender(self) -> float:
        """The unit that sent it; nan of the client's frames."""
        return float(self.row.unit[0]) if self.row.kind[0] == Kind.RESPONSE else nan


def _pattern(view: DiagnosisStep, stretch: _OpenStretch, close: Sequence[_NoiseSide]) -> tuple[Pattern, float]:
    """Where a stretch stands among the frames close to it, and the unit to whose frame it belongs, or nan."""
    if close and stretch.glitch and stretch.row.length[0] <= _GLITCH_RUN:
        nearest = min(close, key=lambda side: side.gap_ns)
        return nearest.floats, nearest.sender
    if close and close[0].floats is Pattern.AFTER and stretch.captured in _LINE_ENDS:
        return Pattern.LINE_END, close[0].sender
    if tap_kind(view.line) is TapKind.EXCERPT:
        return Pattern.QUOTED, nan
    return Pattern.STRAY if close else Pattern.IDLE, nan


@looks_for(NOISE)
class NoiseStretches:
    """Rows in turn; a stretch at the end waits for the next one."""

    _explained_before: bool
    _waiting: _OpenStretch | None
    _frames: int
    _heads: set[bytes]

    def __init__(self) -> None:
        self._explained_before = False  # the row before was noise, and is explained otherwise
        self._waiting = None
        self._frames = 0
        self._heads = set()  # of stretches in a text

    @property
    def open_from(self) -> int | None:
        return self._frames - 1 if self._frames else None  # noise behind it may be its own

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        rows = view.rows
        if not len(rows):
            return
        if self._waiting is not None:
            yield from self._judge(view, self._waiting, rows[:1], explained=0 in view.verdicts)
            self._waiting = None
        first = int(view.frames[0]) if len(view.frames) else len(rows)
        unknown = (rows.errors == 0) & (rows.foreign == 0) & (rows.protocol != Protocol.TCP)
        for number in view.noise[unknown[view.noise]].tolist():
            if number in view.verdicts:
                continue
            before = rows[number - 1 : number] if number else view.trail.newest
            explained_before = (
                number - 1 in view.verdicts and before.kind[0] == Kind.NOISE if number else self._explained_before
            )
            if explained_before and _hard(rows.gap_before_ns[number], view):
                continue
            known = self._frames > 0 or number > first
            stretch = _OpenStretch(rows[number : number + 1], before, view.bytes_of(number), known)
            if number + 1 < len(rows):
                yield from self._judge(
                    view, stretch, rows[number + 1 : number + 2], explained=number + 1 in view.verdicts
                )
            else:
                self._waiting = stretch._replace(row=stretch.row.copy(), before=stretch.before.copy())
        self._explained_before = len(rows) - 1 in view.verdicts and bool(rows.kind[-1] == Kind.NOISE)
        if len(view.frames):
            self._frames = int(rows.index[view.frames[-1]]) + 1

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """Nothing comes after the last stretch, which may be the beginning of a frame that the capture's end cut."""
        if self._waiting is not None and (self._waiting.glitch or self._waiting.captured in _LINE_ENDS):
            yield from self._judge(view, self._waiting, Rows.zeros(1), explained=False)

    def _judge(self, view: DiagnosisStep, stretch: _OpenStretch, after: Rows, *, explained: bool) -> Iterator[Findings]:
        row, is_end = stretch.row, bool(after.kind[0]) or explained
        again = self._head_again(view, stretch, before_frame=bool(after.kind[0]))
        if not (after.kind[0] or stretch.known):
            return
        if not stretch.before.length[0] and not stretch.glitch:
            return  # the capture begins with it: rather the end of a frame
        sides = (
            _NoiseSide(Pattern.AFTER, stretch.before, row.gap_before_ns[0], bool(stretch.before.kind[0])),
            _NoiseSide(Pattern.BEFORE, after, after.gap_before_ns[0], is_end, explained),
        )
        close = [side for side in sides if side.is_frame and _hard(side.gap_ns, view)]
        if not any(side.is_damaged for side in close):
            pattern, sender = _pattern(view, stretch, close)
            if pattern is Pattern.QUOTED and again:
                yield NOISE.on(row, float(Pattern.ENVELOPE), row.length, sender, int.from_bytes(again))
            else:
                yield NOISE.on(row, float(pattern), row.length, sender, nan)

    def _head_again(self, view: DiagnosisStep, stretch: _OpenStretch, *, before_frame: bool) -> bytes:
        """The first bytes of a stretch in a text, with which one before it began; nothing where none did."""
        captured = stretch.captured
        if tap_kind(view.line) is not TapKind.EXCERPT or len(captured) <= _HEAD or captured[0] in GLITCHES:
            return b""
        heads = {captured[:_HEAD], captured[: _BEFORE_FRAME if before_frame else _HEAD]}
        again = heads & self._heads
        self._heads |= heads
        return max(again, default=b"")


def _hard(gap_ns: int, view: DiagnosisStep) -> bool:
    """Whether what stands there is as near as bytes of one frame; in one read nothing shows that it is not."""
    return bool(gap_ns == NO_GAP or gap_ns < _HARD * (view.line.nominal_character_ns or _USUAL_CHARACTER_NS))


_LEAST: Final = 4  # bytes of a frame

COLLISION: Final = Rule(
    "crc-collision",
    Severity.NOTE,
    About.FRAME,
    when="a window of bytes has a correct CRC, but a better explanation covers it",
    clause="[2] 2.5.1.2",
    numbers=("window_start", "window_length", "windows"),
    text=lambda numbers: phrase(
        "{bytes} from byte {window_start:.0f} on also have a matching CRC, but are only part of this frame"
        if numbers["window_start"]
        else "the first {bytes} also have a matching CRC, but are only part of this frame",
        numbers,
        bytes=counted(int(numbers["window_length"]), "byte", "bytes"),
    ),
    cause="a coincidence (1 window in 65,536), or registers that contain a whole frame",
    remedy="nothing; it only misleads tools that look for nothing but matching CRCs",
)


@looks_for(COLLISION)
def inner_windows(view: DiagnosisStep) -> Iterator[Findings]:
    """Frames with such a window inside them."""
    rows, contested = view.rows, view.right(where(view.rows.contested))
    if not len(contested):
        return
    lengths = rows.length[contested]
    ends = np.cumsum(lengths)
    begins = ends - lengths
    data = view.batch.data[np.repeat(rows.at[contested] - begins, lengths) + np.arange(int(ends[-1]))]
    crc = crc_windows(data)
    candidates = search_candidates(data, crc)
    heads = np.repeat(begins, lengths)
    early = where(crc.heads.take(heads) == crc.tails[1:]) + 1  # ends of windows that begin where their frame does
    start, end = np.concatenate((candidates.start, heads[early - 1])), np.concatenate((candidates.end, early))
    start, end = np.unique(np.stack((start, end)), axis=1)
    owner = np.searchsorted(ends, start, side="right")
    inside = (end <= ends[owner]) & (end - start < lengths[owner]) & (end - start >= _LEAST)
    inside[inside] = [data[s:e].any() for s, e in zip(start[inside], end[inside], strict=True)]
    frames, first, counts = np.unique(owner[inside], return_index=True, return_counts=True)
    if len(frames):
        first_start, first_end = start[inside][first], end[inside][first]
        yield COLLISION.on(rows[contested[frames]], first_start - begins[frames], first_end - first_start, counts)
