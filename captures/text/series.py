"""Reads in pieces: what stands behind the same words, line after line, is a frame together.

A series is what all lines show behind one label in one writing. Neighbours of it whose bytes have a right check value
together are taken, whatever each of them looks like.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import accumulate, product
from typing import Final, NamedTuple

from ..checked import Checked
from .candidates import HexWindow
from .choosing import ByteRun, Experience
from .judging import ByteJudge
from .loglines import LogLine
from .seams import frames_over
from .weighing import is_computed

_PATIENCE: Final = 600  # pieces in vain
_LONGEST: Final = 260  # bytes of one
_PIECE: Final = 2  # bytes that pieces have at least, on average: a byte a line is a column
_LEAST: Final = 4  # bytes that can hold a check value


class _SeriesPiece(NamedTuple):
    run: ByteRun
    reading: ByteRun | HexWindow

    @property
    def data(self) -> bytes:
        """Its bytes; none where it has check values of its own."""
        return b"" if self.run.checked else self.reading.data


def settle_series(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Take the runs of these lines that are frames together with their neighbours behind the same words."""
    if experience.pieces_in_vain > _PATIENCE:
        return
    series = [pieces for pieces in _series(lines).values() if _may_be_frames(pieces)]
    found = [edge for pieces in series for edge in _edges(pieces, judge)]
    found.sort(key=lambda edge: edge[0].end - edge[0].start, reverse=True)
    for span, edge in found:
        if any(piece.run.joined for piece in edge):
            continue
        experience.frames += 1
        for run, reading in edge:
            run.take(reading)
            run.taken = True
            experience.support(run, span)
            experience.confirm(run)
    experience.pieces_in_vain = 0 if found else experience.pieces_in_vain + sum(map(len, series))


def _may_be_frames(pieces: Sequence[_SeriesPiece]) -> bool:
    sizes = [len(piece.data) for piece in pieces if piece.data]
    return sum(sizes) >= max(_LEAST, _PIECE * len(sizes)) > _PIECE


def _series(lines: Sequence[LogLine]) -> dict[tuple[str, str], list[_SeriesPiece]]:
    series: dict[tuple[str, str], list[_SeriesPiece]] = defaultdict(list)
    for line in lines:
        seen: set[tuple[str, str]] = set()
        for run in line.runs:
            if not run.label or run.why is not None or len(run.data) > _LONGEST:
                continue
            readings: tuple[ByteRun | HexWindow, ...] = (run, *run.others)
            for reading in readings:
                key = run.label, reading.shape
                if key not in seen:
                    seen.add(key)
                    series[key].append(_SeriesPiece(run, reading))
    return series


def _edges(pieces: Sequence[_SeriesPiece], judge: ByteJudge) -> Iterator[tuple[Checked, Sequence[_SeriesPiece]]]:
    """Neighbours whose bytes are a frame together."""
    for span, first, end in frames_over([piece.data for piece in pieces], judge):
        if 1 < end - first <= (span.end - span.start) // _PIECE:
            yield span, pieces[first:end]


_TAIL: Final = 260  # bytes without a right check value that a later run may complete
_TAIL_RUNS: Final = 4
_TAIL_LINES: Final = 16


def settle_tails(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Take what completes a frame that other output interrupted."""
    open_runs: list[ByteRun] = []  # taken, but with no right check value yet
    since, shape = 0, ""
    for line in lines:
        if line.number - since > _TAIL_LINES:
            open_runs = []
        alike = line.runs if len(line.runs) == 1 else sorted(line.runs, key=lambda run: run.shape != shape)
        for run in alike:
            if run.taken:
                whole = bool(run.checked) or _ends_together(open_runs, run, judge, experience)
                open_runs = [] if whole else [*open_runs[1 - _TAIL_RUNS :], run]
                since, shape = line.number, run.shape
            elif open_runs and not is_computed(run, line) and _completes(run, open_runs, judge, experience):
                experience.tails.add((run.label, run.shape))
                experience.confirm(run)
                open_runs = []


def _ends_together(open_runs: Sequence[ByteRun], run: ByteRun, judge: ByteJudge, experience: Experience) -> bool:
    """Whether a frame ends with a run that begins in one before it; all that it is of are noted as its parts."""
    if not open_runs:
        return False
    starts = [0, *accumulate(len(one.data[-_TAIL:]) for one in open_runs)]
    joint = b"".join(one.data[-_TAIL:] for one in open_runs) + run.data
    span = next((span for span in judge(joint) if span.end == len(joint)), None)
    if span is None:
        return False
    experience.frames += 1
    for one, end in zip((*open_runs, run), (*starts[1:], len(joint)), strict=True):
        if span.start < end:
            experience.support(one, span)
    return True


def _completes(run: ByteRun, open_runs: Sequence[ByteRun], judge: ByteJudge, experience: Experience) -> bool:
    """Whether a frame begins in one of the open runs and ends with this one, which then is taken."""
    candidates: tuple[ByteRun | HexWindow, ...] = (run, *run.others)
    for turned, reading in product((False, True), candidates):  # a number has its high byte first
        for i in range(len(open_runs)):
            joint = b"".join(one.data[-_TAIL:] for one in open_runs[i:]) + reading.data
            begins = len(joint) - len(reading.data)
            if any(span.start < begins and span.end == len(joint) and span.turned == turned for span in judge(joint)):
                if isinstance(reading, HexWindow):
                    run.take(reading)
                run.taken = True
                experience.frames += 1
                for one in (*open_runs[i:], run):
                    one.joined, one.echoed = experience.frames, True
                return True
    return False
