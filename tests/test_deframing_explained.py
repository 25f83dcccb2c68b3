"""Every boundary says why it is there: evidence in bits, the runner-up, a confidence."""

from __future__ import annotations

import numpy as np
from buses import LINE, adu, spaced

from analyzer.core import deframe
from analyzer.options import Options
from analyzer.tables.batch import Batch
from analyzer.tables.schema import BoundaryEvidence, Kind, Rows
from captures.chunks import Capture, Chunk

READ, ANSWER = adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")


def batch(chunks: list[Chunk], *, explain: bool = True) -> Batch:
    """All that the deframer gives, as one batch."""
    parts = list(deframe(Capture.of(LINE, chunks), Options(explain=explain)))
    evidence = [part.evidence for part in parts if part.evidence is not None]
    return Batch(
        Rows.joined([part.rows for part in parts]),
        np.concatenate([part.data for part in parts]),
        evidence=BoundaryEvidence.joined(evidence) if evidence else None,
    )


def test_evidence_is_kept_only_when_asked_for() -> None:
    chunks = spaced([READ, ANSWER] * 5)
    assert batch(chunks, explain=False).evidence is None
    explained = batch(chunks)
    assert explained.evidence is not None
    assert len(explained.evidence) == len(explained.rows)


def test_predicted_length_crc_silence_and_conversation_all_speak() -> None:
    chunks = spaced([READ, ANSWER] * 60)
    found = batch(chunks)
    assert found.evidence is not None
    answers = found.evidence[found.rows.kind == Kind.RESPONSE][20:]
    assert (answers.crc == 16).all()
    assert (answers.length > 0).all()
    assert (answers.silence > 3).all()
    assert (answers.conversation > 10).all()
    assert (found.rows.confidence > 0.999).all()


def test_a_doubtful_reading_names_its_runner_up_and_is_less_sure() -> None:
    write = adu("11060001beef")
    found = batch([Chunk(10**9, READ + ANSWER + write + write + b"\x55" + READ + ANSWER)])
    doubtful = found.rows.confidence.argmin()
    assert found.evidence is not None
    assert found.rows.start[doubtful] == 27  # answer, or the same request once more
    assert found.evidence.rival_start[doubtful] == 27
    assert found.evidence.rival_kind[doubtful] == Kind.REQUEST
    assert 0.5 < found.rows.confidence[doubtful] < np.delete(found.rows.confidence, doubtful).min() + 1e-6


def test_frames_are_the_same_with_and_without_explaining() -> None:
    chunks = spaced([READ, ANSWER, ANSWER[:5], READ, b"\0", ANSWER] * 8)
    assert batch(chunks).rows.tolist() == batch(chunks, explain=False).rows.tolist()
