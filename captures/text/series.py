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
from .judging import ByteJudge, frames_over
from .loglines import LogLine
from .runs import ByteRun, Experience
from .weighing import is_computed

_PIECES: Final = "pieces"  # a search that has its patience
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
    if experience.patience.ends(_PIECES):
        return
    series = [pieces for pieces in _series(lines).values() if _may_be_frames(pieces)]
    found = [edge for pieces in series for edge in _edges(pieces, judge)]
    found.sort(key=lambda edge: edge[0].end - edge[0].start, reverse=True)
    for span, edge in found:
        if any(piece.run.joined for piece in edge):
            continue
        _take(edge, span, experience)
    experience.patience.spend(_PIECES, sum(map(len, series)), found=bool(found))


def _take(edge: Sequence[_SeriesPiece], span: Checked, experience: Experience) -> None:
    """Note a frame of which runs are parts, each read in its way."""
    experience.frames += 1
    for run, reading in edge:
        if not run.taken or reading is not run:
            run.accept(reading)
            experience.confirm(run)
        experience.support(run, span)


def _may_be_frames(pieces: Sequence[_SeriesPiece]) -> bool:
    sizes = [len(piece.data) for piece in pieces if piece.data]
    return sum(sizes) >= max(_LEAST, _PIECE * len(sizes)) > _PIECE


def _series(lines: Sequence[LogLine]) -> dict[tuple[str, str], list[_SeriesPiece]]:
    series: dict[tuple[str, str], list[_SeriesPiece]] = defaultdict(list)
    for line in lines:
        firsts: dict[tuple[str, str], _SeriesPiece] = {}
        for run in line.runs:
            if not run.label or run.why is not None or len(run.data) > _LONGEST:
                continue
            readings: tuple[ByteRun | HexWindow, ...] = (run, *run.others)
            for reading in readings:
                firsts.setdefault((run.label, reading.shape), _SeriesPiece(run, reading))
        for key, piece in firsts.items():
            series[key].append(piece)
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
        for run in sorted(line.runs, key=lambda run: run.shape != shape):
            begun = open_runs if run.taken or not is_computed(run, line) else []
            if run.checked or _completes(run, begun, judge, experience):
                open_runs = [] if run.taken else open_runs
            elif run.taken:
                open_runs = [*open_runs[1 - _TAIL_RUNS :], run]
            if run.taken:
                since, shape = line.number, run.shape


def _completes(run: ByteRun, open_runs: Sequence[ByteRun], judge: ByteJudge, experience: Experience) -> bool:
    """Whether a frame begins in one of the open runs and ends with this one, which then is taken."""
    readings: list[ByteRun | HexWindow] = [*run.readings().values()] if run.taken else [run, *run.others]
    begins_in = range(len(open_runs))[: 1 if run.taken else None]
    for turned, reading, i in product((False, True), readings, begins_in):  # a number has its high byte first
        parts = [one.data[-_TAIL:] for one in open_runs[i:]] + [reading.data]
        joint, begins = b"".join(parts), sum(map(len, parts[:-1]))
        for span in judge(joint):
            if span.start < begins and span.end == len(joint) and span.turned == turned:
                if not run.taken or reading is not run:
                    experience.tails = experience.of(run.label, reading.shape).tail = True
                pieces = [*(_SeriesPiece(one, one) for one in open_runs[i:]), _SeriesPiece(run, reading)]
                ends = accumulate(map(len, parts))
                _take([one for one, end in zip(pieces, ends, strict=True) if span.start < end], span, experience)
                return True
    return False
