"""Decide a stretch where candidates compete: when is enough known, and how far does the decision reach?

Positions where something could be decided are events: the end of a candidate, a quiet line (idle timeout), a silence
that ends every frame, the window being full. Events are taken in stream order and each looks only at bytes before it,
so a stream fed byte by byte and a whole file come to the same decisions at the same offsets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from dissectors.lengths import Role

from ..frames import Kind, Rows
from .candidates import CRC_BITS, predicted
from .lattice import EMBEDDED, FITS, LEAD, NOISE_BEGINS, NOISE_BYTE, Candidate, Lattice, Step
from .options import Options
from .pieces import NOISE, evidence
from .rules import MAX_ADU
from .silence import Trust
from .tape import Tape

AGAINST: Final = -3.0  # bits: so little silence that hardly a frame ends there
_KINDS: Final = {Role.REQUEST: Kind.REQUEST, Role.RESPONSE: Kind.RESPONSE, NOISE: Kind.NOISE}
WINDOWS: Final = (96, 384, 2048)  # bytes looked at: mostly a few frames do; the last at most waits for a decision
_KNOWN_BITS: Final = 3.0
ALONE: Final = 15.0  # bits that frames end to end with silence behind them need
_AMID: Final = 48.0  # bits that frames need after noise, or with more bytes right behind them


@dataclass(frozen=True, slots=True)
class Event:
    """A position at which to look; `idle` when the line was quiet there, `cut` when so long that no frame spans it."""

    position: int
    idle: bool = False
    cut: bool = False
    silent: bool = False  # some gap there, or the end of what a read gave
    plausible: bool = True  # that gap, or the lack of one, does not speak against a frame's end


class Decision(NamedTuple):
    """Certain steps from the lattice's position 0 on, and the paths that theirs beat where they ended."""

    steps: list[Step]
    rivals: list[tuple[float, Step | None]]  # (bits behind, last step)


def events_in(
    tape: Tape,
    options: Options,
    trust: Trust,
    origin: int,
    size: int,
    candidates: Sequence[Candidate],
    classes: Sequence[int],
    *,
    quiet: bool,
) -> list[Event]:
    """Where something may be decided, in stream order, in the `size` bytes from index `origin` of the tape.

    `classes` are those of the silences there; `quiet`: the line was quiet at the end.
    """
    idle = set((tape.quiet(origin, origin + size + 1, options.idle_ns) - origin).tolist())
    cut = set((tape.quiet(origin, origin + size + 1, options.cut_ns) - origin).tolist())
    if quiet:
        idle.add(size)
    edge = origin + size == tape.ready
    spots = sorted(({c.end for c in candidates} | idle | cut) - {0})
    most = trust.most
    events = []
    for p in spots:
        inner = p < len(classes)
        silent = classes[p] > 0 if inner else edge
        events.append(Event(p, p in idle, p in cut, p in idle or silent, not (inner and most[classes[p]] < AGAINST)))
    return events


UNDECIDED: Final = Decision([], [])


def decide(lattice: Lattice, data: bytes, events: Sequence[Event], idle_bits: float) -> Decision:
    """What is now certain; `UNDECIDED` if more has to be known."""
    for event in events:
        lattice.advance(event.position)
        if event.idle or _enough(lattice, event):
            steps = lattice.steps()
            frames = [s for s in steps if s.candidate is not None and not s.candidate.damaged]
            if frames and not _awaited(data, frames, steps, event, lattice, idle_bits):
                return Decision(steps[: steps.index(frames[-1]) + 1], lattice.rivals())
        if event.cut:  # (it was idle before, so what a clock's tick decided then is decided alike without one)
            return settled(lattice, event.position)
    return UNDECIDED


def go_on(
    lattice: Lattice,
    data: bytes,
    events: Sequence[Event],
    idle_bits: float,
    first: Decision,
    wanted: Callable[[int], bool],
) -> list[Decision]:
    """A decision that left no noise, and those that follow it at once, as long as they are `wanted` (at a position).

    Each is what a lattice begun at its own place would decide: only the work of beginning one is saved.
    """
    found = [first]
    while True:
        steps = found[-1].steps
        at = steps[-1].end
        if at != lattice.position or not wanted(at):
            return found
        lattice.restart(steps[-1].said)
        decision = decide(lattice, data, [event for event in events if event.position > at], idle_bits)
        if not only_frames(decision):
            return found
        found.append(decision)


def only_frames(decision: Decision) -> bool:
    """Whether something was decided and no byte of it is noise."""
    return bool(decision.steps) and all(step.candidate is not None for step in decision.steps)


def settled(lattice: Lattice, position: int) -> Decision:
    """The best path to a position as it stands: nothing can change it any more."""
    lattice.advance(position)
    return Decision(lattice.steps(), lattice.rivals())


def _enough(lattice: Lattice, event: Event) -> bool:
    """Whether the best path ends in a frame here, and has gathered what a decision needs while the line goes on."""
    path = lattice.best
    tip = path.tip
    if not event.plausible or path.noise_from >= 0 or tip is None or tip.candidate is None or tip.candidate.damaged:
        return False
    alone = event.silent and not path.noisy
    return path.since_noise >= (ALONE if alone else _AMID) and lattice.lead >= LEAD


def _awaited(
    data: bytes, frames: Sequence[Step], steps: Sequence[Step], event: Event, lattice: Lattice, idle_bits: float
) -> bool:
    """Whether a longer frame may still come that would explain the end better: an answer that a request asked for."""
    best = frames[-1].score
    position = event.position
    for pending in lattice.open_after(frames):
        header = pending.expects.header
        if len(header) < 2:
            continue
        low = max(0, pending.start + len(pending.adu) - lattice.offset, position - MAX_ADU)
        found = data.find(header, low, position)
        while found >= 0:
            length = predicted(data[:position], found, Role.RESPONSE)
            if length is not None and found + length > position:
                before = next(s for s in steps if s.end > found)
                start = before.before
                score = start.score if start is not None else 0.0
                if found > before.start:
                    score -= NOISE_BEGINS + NOISE_BYTE * (found - before.start)
                score += CRC_BITS + _KNOWN_BITS + FITS + lattice.silence(found) - (idle_bits if event.idle else 0.0)
                score += sum(
                    max(0.0, CRC_BITS + f.candidate.structure - EMBEDDED)
                    for f in frames
                    if f.start > found and f.candidate
                )
                if score > best:
                    return True
            found = data.find(header, found + 1, position)
    return False


def forced(lattice: Lattice, position: int) -> Decision:
    """The best path's steps well before `position`: what waited too long is decided as it stands."""
    lattice.advance(position)
    limit = position - 2 * MAX_ADU
    steps = []
    for step in lattice.steps():
        if step.end > limit:
            if step.candidate is None and step.start < limit:
                steps.append(Step(step.start, limit, None, step.before, step.score, step.said))
            break
        steps.append(step)
    return Decision(steps, lattice.rivals())


def margins(decision: Decision) -> list[tuple[float, Step | None]]:
    """For each step, by how much its path beat the best path without it, and what that path had there.

    Where two paths met, the winner's steps since they parted are as sure as the difference (soft-output Viterbi).
    """
    steps = decision.steps
    margin: list[tuple[float, Step | None]] = [(float("inf"), None)] * len(steps)
    index = {_key(step): i for i, step in enumerate(steps)}
    beaten = [(at, *rival) for at, step in enumerate(steps) for rival in step.losers]
    beaten += [(len(steps), *rival) for rival in decision.rivals]
    for at, difference, loser in beaten:
        shared: set[int] = set()
        parted = 0  # steps before it are those of both
        pieces: list[Step] = []
        while loser is not None:
            i = index.get(_key(loser))
            if i is None:
                pieces.append(loser)
            elif steps[i] is loser:
                parted = i + 1
                break
            else:
                shared.add(i)
            loser = loser.before
        for i in range(parted, at):
            if i not in shared and difference < margin[i][0]:
                mine = steps[i]
                margin[i] = (difference, next((p for p in pieces if p.start < mine.end and p.end > mine.start), None))
    return margin


def explained(steps: Sequence[Step], found: Sequence[tuple[float, Step | None]], offset: int) -> Rows:
    """The evidence of steps (their margins apart) that begin at a stream offset, with what `margins` found."""
    why = evidence(len(steps))
    for row, step, (_, other) in zip(why, steps, found, strict=True):
        row["silence"], row["conversation"] = step.silence, step.conversation
        if step.candidate is not None:
            row["length"] = step.candidate.structure
            row["crc"] = 0.0 if step.candidate.damaged else CRC_BITS
        if other is not None:
            row["rival_start"], row["rival_length"] = offset + other.start, other.end - other.start
            row["rival_kind"] = _KINDS[other.candidate.role if other.candidate else NOISE]
    return why


def _key(step: Step) -> tuple[int, int, int]:
    return step.start, step.end, step.candidate.role if step.candidate else -1
