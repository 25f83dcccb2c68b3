"""Silences against the specification's, as far as this tap's clock can carry it (`analyzer.deframing.tap_clock`).

[2] 2.5.1.1: at least 3.5 characters of silence between frames, at most 1.5 inside one; [2] 2.4.1: a pause after a
broadcast, 100 ms at least by custom. What the clock cannot show is said once, and no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...deframing.tap_clock import UNKNOWN, silences
from ...languages import phrase
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import NO_GAP, Kind, Protocol, Rows
from ..view import DiagnosisStep, where

_TIMER_NS: Final = 10e6  # a tap this far off, or more, accuses nobody
_TOLERANCE: Final = 0.02  # of a limit

GAP_INSIDE: Final = Rule(
    "gap-in-frame",
    Severity.WARNING,
    About.FRAME,
    when="a silence inside a frame is longer than 1.5 characters",
    clause="[2] 2.5.1.1",
    numbers=("gap_ms", "characters", "byte", "t35_ms"),
    text=lambda numbers: (
        phrase(
            "a gap of {gap_ms:ms} ({characters:.1f} characters) inside the frame, before byte {byte:.0f}; a strict "
            "t1.5 receiver discards the frame",
            numbers,
        )
        + (
            phrase(", a t3.5 receiver takes the rest for another frame")
            if numbers["gap_ms"] > numbers["t35_ms"]
            else ""
        )
    ),
    cause="the sender is interrupted while it sends, or a converter or radio between passes bytes on in pieces",
    remedy="send from a buffer or by DMA; where a converter does it, let the receiver wait longer between characters",
)
GAP_SHORT: Final = Rule(
    "gap-too-short",
    Severity.WARNING,
    About.FRAME,
    when="the silence before a frame is shorter than 3.5 characters",
    clause="[2] 2.5.1.1",
    numbers=("gap_ms", "characters", "due_ms", "is_response"),
    varies="is_response",
    text=lambda numbers: phrase(
        "the response starts {gap:ms} ({passed:.1f} characters) after the previous frame instead of {due_ms:ms}"
        if numbers["is_response"]
        else "the client starts its request {gap:ms} ({passed:.1f} characters) after the previous frame instead of "
        "{due_ms:ms}",
        numbers,
        gap=max(numbers["gap_ms"], 0),
        passed=max(numbers["characters"], 0),
    ),
    cause=lambda numbers: phrase(
        "the device answers without waiting for 3.5 characters"
        if numbers["is_response"]
        else "the client's inter-frame delay is too short"
    ),
    remedy=lambda numbers: phrase(
        "none while the client takes these answers; where it misses them, a response delay in the device, well below "
        "the client's timeout"
        if numbers["is_response"]
        else "none while the devices answer; where some miss requests, a delay of 3.5 characters between polls in the "
        "client, which makes a round of polls longer"
    ),
)
TURNAROUND: Final = Rule(
    "turnaround-short",
    Severity.WARNING,
    About.FRAME,
    when="a request comes sooner than 100 ms after a broadcast",
    clause="[2] 2.4.1",
    numbers=("pause_ms", "due_ms"),
    text="a request {pause_ms:ms} after a broadcast instead of {due_ms:.0f} ms; no answer shows when the units are "
    "done",
    cause="the client does not wait after a broadcast",
    remedy="set the client's turnaround delay to 100 to 200 ms",
)


def _blind(numbers: Mapping[str, float]) -> str:
    if "off_by_ms" not in numbers:
        return phrase("this capture's timestamps are too coarse to show gaps and response times")
    if not numbers["off_by_ms"]:
        return phrase(
            "each read delivers a whole frame, {bytes_a_read:.2g} bytes at once: t1.5 and t3.5 cannot be checked",
            numbers,
        )
    return phrase(
        "times are off by up to {off_by_ms:ms}, with {bytes_a_read:.2g} bytes per read: t1.5 and t3.5 cannot be "
        "checked",
        numbers,
    )


def _remedy(numbers: Mapping[str, float]) -> str:
    off = numbers.get("off_by_ms", 0.0)
    if "off_by_ms" not in numbers:
        return phrase("capture with timestamps and the line's settings: baud rate, bits per character")
    if off > 25:
        return phrase("tap the serial line itself rather than the network behind a gateway")
    if off > _TIMER_NS / 1e6:
        return phrase(
            "set the USB adapter's latency timer to 1 ms (FTDI: latency_timer, low-latency mode), or tap byte by byte"
        )
    return phrase("use a tap that stamps each byte, such as a logic analyser, or switch the UART's FIFO off")


BLIND: Final = Rule(
    "timing-blind",
    Severity.NOTE,
    About.BUS,
    when="the times of this tap cannot show the silences that the specification sets",
    clause="[2] 2.5.1.1",
    numbers=("off_by_ms", "bytes_a_read"),
    text=_blind,
    cause="a FIFO, a latency timer or a network between the line and the clock, or a capture without times",
    remedy=_remedy,
)


@looks_for(GAP_INSIDE, GAP_SHORT, TURNAROUND, BLIND)
class Timing:
    """Frames with the row before each; the first ones wait for the clock's first verdict."""

    _waiting: list[tuple[Rows, Rows]]
    _frames: int

    def __init__(self) -> None:
        self._waiting = []
        self._frames = 0

    @property
    def open_from(self) -> int | None:
        return int(self._waiting[0][0].index[0]) if self._waiting else None

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        rows, suspects = view.rows, _suspects(view)
        self._frames += int(np.count_nonzero(view.rows.protocol[view.frames] == Protocol.RTU))
        if len(suspects):
            before = rows[np.maximum(suspects - 1, 0)]
            if suspects[0] == 0:
                before.put(slice(1), view.trail.newest)
            self._waiting.append((rows[suspects], before))
        if view.clock.known:
            yield from self._judge(view)

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """What still waits, and what the tap cannot show."""
        yield from self._judge(view)
        verdict = view.clock.newest()
        if self._frames and not verdict.fine:
            known = view.timed and view.clock.off_ns < UNKNOWN
            yield BLIND.of_bus(view.now, view.clock.off_ns / 1e6 if known else np.nan, verdict.bytes_a_read)

    def _judge(self, view: DiagnosisStep) -> Iterator[Findings]:
        waiting, self._waiting = self._waiting, []
        for rows, before in waiting:
            verdicts = [view.clock.verdict(index) for index in rows.index.tolist()]
            fine = np.array([v.fine for v in verdicts])
            if fine.any():
                jitter = np.array([v.jitter_ns for v in verdicts])[fine]
                yield from _silences(view, rows[fine], before[fine], jitter)
            yield from _turnarounds(view, rows, before, np.array([v.wait_ns for v in verdicts]))


def _suspects(view: DiagnosisStep) -> NDArray[np.intp]:
    """Frames whose silences break a limit at first sight, or that follow a broadcast."""
    if not view.timed or not len(view.rows):
        return np.zeros(0, np.intp)
    suspects = _after_broadcasts(view)
    t15, t35 = silences(view.line, view.options)
    if t15 < UNKNOWN and (view.clock.best().fine or not view.clock.known):
        before = view.rows.gap_before_ns
        odd = (view.rows.gap_most_ns > t15) | ((before < t35) & (before != NO_GAP))
        suspects = np.union1d(suspects, where(odd))
    if len(suspects):
        rows = view.rows[suspects]
        suspects = suspects[(rows.kind != Kind.NOISE) & rows.check & (rows.protocol == 0)]
    return suspects


def _after_broadcasts(view: DiagnosisStep) -> NDArray[np.intp]:
    """Rows right behind a broadcast; but a device's answer to it is no request that came too soon."""
    rows, following = view.rows, []
    newest = view.trail.newest
    if newest.unit[0] == 0 and newest.kind[0] == Kind.REQUEST:
        sent = next(view.trail.back(view.batch, 0))
        following += [0] if view.bytes_of(0)[1:-2] != sent.captured[1:-2] else []
    for row in view.to_all.tolist():
        if rows.kind[row] == Kind.REQUEST and row + 1 < len(rows):
            following += [row + 1] if view.bytes_of(row + 1)[1:-2] != view.bytes_of(row)[1:-2] else []
    return np.array(following, np.intp)


def _silences(view: DiagnosisStep, rows: Rows, before: Rows, jitter: NDArray[np.float64]) -> Iterator[Findings]:
    t15, t35 = silences(view.line, view.options)
    character = view.line.nominal_character_ns or UNKNOWN
    off = np.maximum(-rows.gap_least_ns, jitter) + _TOLERANCE * t15
    inside = where((rows.gap_most_ns != NO_GAP) & (rows.gap_most_ns - off > t15))
    if len(inside):
        gaps = rows.gap_most_ns[inside]
        yield GAP_INSIDE.on(rows[inside], gaps / 1e6, gaps / character, rows.gap_at[inside], t35 / 1e6)
    short = before.check & (before.kind != Kind.NOISE) & (before.port == rows.port)
    alike = (rows.kind == before.kind) & (rows.unit == before.unit)
    alike &= (rows.function == before.function) & (rows.length == before.length)
    short &= ~alike  # the tap shows it twice: no master and no unit sends so soon
    short &= (rows.gap_before_ns != NO_GAP) & (rows.gap_before_ns + jitter + _TOLERANCE * t35 < t35)
    early = where(short)
    if len(early):
        gaps = rows.gap_before_ns[early]
        response = rows.kind[early] == Kind.RESPONSE
        yield GAP_SHORT.on(rows[early], gaps / 1e6, gaps / character, t35 / 1e6, response)


def _turnarounds(view: DiagnosisStep, rows: Rows, before: Rows, off: NDArray[np.float64]) -> Iterator[Findings]:
    due = view.options.turnaround_ns
    after = (rows.kind == Kind.REQUEST) & before.check & (before.kind == Kind.REQUEST)
    after &= (before.unit == 0) & (before.port == rows.port) & (off < _TIMER_NS)
    pause = rows.t_start_ns - before.t_end_ns
    early = where(after & (pause + np.where(after, off, 0) < due))
    if len(early):
        yield TURNAROUND.on(rows[early], pause[early] / 1e6, due / 1e6)
