"""What is worked out one by one where there is little of it, as on a live line, is what arrays give: value by value."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scripts import package

from analyzer.deframing import buffer, candidates, forced, foreign, pairing
from analyzer.deframing.candidates import search_candidates
from analyzer.deframing.conversation import response_fits, responses_fit
from analyzer.deframing.engine import Engine
from analyzer.deframing.forced import forced_runs
from analyzer.deframing.protocols import Deframer
from analyzer.deframing.rules import crc_windows
from analyzer.diagnosis import judge
from analyzer.diagnosis.judge import Judge
from analyzer.options import Options
from analyzer.tables.batch import Batch
from analyzer.tables.schema import Rows
from captures.chunks import Block
from captures.line import LineSettings
from dissectors.crc import crc_bytes
from dissectors.lengths import RULES

KINDS = list(package("feeding.streams").KINDS)
FUNCTIONS = sorted({function for function, _ in RULES})
FRAMES = st.builds(
    lambda function, head, rest: bytes((1, function, *head, *rest)),
    st.sampled_from(FUNCTIONS) | st.integers(0, 255),
    st.lists(st.integers(0, 6) | st.integers(0, 255), max_size=8),
    st.binary(max_size=12),
).map(lambda body: body + crc_bytes(body))
POLLS = st.builds(
    lambda kind, seed: package("edges.frames").request(Random(seed), kind % 3) if kind else b"\0" * (seed % 5),
    st.integers(0, 6),
    st.integers(0, 1 << 20),
)
ECHOES = POLLS.map(lambda poll: poll + package("edges.frames").answer(Random(poll), poll) if len(poll) > 6 else poll)
BYTES = st.lists(FRAMES | POLLS | ECHOES | st.binary(max_size=6), max_size=10).map(b"".join)


def _values(made: Any) -> list[Any]:
    return [column.tolist() if isinstance(column, np.ndarray) else column for column in made]


def _of_candidates(found: candidates.Candidates) -> list[Any]:
    columns = (found.start, found.end, found.role, found.structure)
    return [*(str(column.dtype) for column in columns), *_values(columns)]


@settings(max_examples=75, deadline=None)
@given(BYTES)
def test_candidates(octets: bytes) -> None:
    data = np.frombuffer(octets, np.uint8)
    crc = crc_windows(data) if len(data) else None
    if crc is None:
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "_FEW", 1 << 30)
        few = search_candidates(data, crc)
        patch.setattr(candidates, "_LITTLE", -1)
        many = search_candidates(data, crc)
    assert _of_candidates(few) == _of_candidates(many)


@settings(max_examples=75, deadline=None)
@given(BYTES, st.data())
def test_forced_runs(octets: bytes, draw: st.DataObject) -> None:
    data = np.frombuffer(octets, np.uint8)
    if not len(data):
        return
    found = search_candidates(data, crc_windows(data))
    size = draw.draw(st.integers(0, 1)) + len(data)
    silences = np.array(draw.draw(st.lists(st.sampled_from((0, 1, 5)), min_size=size, max_size=size)), np.uint8)
    known = len(data) - draw.draw(st.sampled_from((0, 20, 256)))
    with pytest.MonkeyPatch.context() as patch:
        few = forced_runs(found, data, known, silences)
        patch.setattr(forced, "_FEW", -1)
        many = forced_runs(found, data, known, silences)
    assert _values((*few.asks, *_but_asks(few))) == _values((*many.asks, *_but_asks(many)))


def _but_asks(runs: forced.ForcedRuns) -> list[Any]:
    return [column for name, column in runs._asdict().items() if name != "asks"]


@settings(max_examples=120, deadline=None)
@given(st.lists(FRAMES | POLLS | ECHOES, min_size=1, max_size=6))
def test_answers(frames: list[bytes]) -> None:
    octets = b"".join(frames) + b"\0\0"
    data = np.frombuffer(octets, np.uint8)
    places = range(len(octets) - 1)
    pairs = [(a, b) for a in places for b in places[a : a + 40]]
    requests, responses = (np.array(column, np.intp) for column in zip(*pairs, strict=True))
    assert [response_fits(octets, a, b) for a, b in pairs] == responses_fit(data, requests, responses).tolist()


def _told(blocks: list[tuple[Block, int | None]], line: Any) -> list[Any]:
    """All that a deframer gives, feed by feed."""
    deframer = Deframer(line)
    batches = [deframer.feed(block, now) for block, now in blocks]
    batches += [deframer.tick(int(blocks[-1][0].t_ns[-1]) + pause) for pause in (8_000_000, 50_000_000)]
    return [(batch.rows.tolist(), batch.data.tobytes(), dict(batch.earlier)) for batch in (*batches, deframer.close())]


def _gathered(chunks: list[Any], random: Random) -> Iterator[tuple[Block, int | None]]:
    at, most = 0, random.choice((1, 6, 40))
    while at < len(chunks):
        block = Block.from_chunks(chunks[at : at + random.randint(1, most)])
        at += len(block)
        yield block, int(block.t_ns[-1]) if random.random() < 0.7 else None


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_streams(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With every shortcut and without any, each feed gives the same rows, the same certainty and requests too."""
    streams = [package("feeding.streams").stream(kind, seed) for seed in range(500, 506)]
    fed = [(list(_gathered(s.chunks, Random(i))), s.line) for i, s in enumerate(streams) if s.chunks]
    short = [_told(*each) for each in fed]
    never: Callable[..., bool] = lambda *_: False  # noqa: E731
    monkeypatch.setattr(Engine, "_tells_nothing", never)
    monkeypatch.setattr(candidates, "_LITTLE", -1)
    for module in (buffer, forced, pairing, foreign):
        monkeypatch.setattr(module, "_FEW", -1)
    assert short == [_told(*each) for each in fed]


@settings(max_examples=90, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2), *[st.sampled_from((0, 0, 1))] * 5), min_size=1, max_size=12))
def test_odd_rows(drawn: list[tuple[int, ...]]) -> None:
    rows = Rows.zeros(len(drawn))
    names = ("kind", "unit", "exception", "errors", "check", "request")
    for column, values in zip(names, zip(*drawn, strict=True), strict=True):
        rows.column(column)[:] = [not value for value in values] if column in ("unit", "check") else values
    rows.request[:] -= 1 - (rows.kind == 2)
    few, many = Judge(LineSettings(), Options()), Judge(LineSettings(), Options())
    for part in (rows[:5], rows[5:]):
        if len(part):
            told = few._odd(Batch(part, part.kind))
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(judge, "_FEW", -1)
                assert (told, few._asking) == (many._odd(Batch(part, part.kind)), many._asking)
