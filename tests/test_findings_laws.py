"""Laws of the diagnosis: it hangs on bytes and times alone, speaks of rows that are there, and forgets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from buses import LINE, rtu_deframer, streams
from hypothesis import example, given, settings

from analyzer.core import Analysed, Analyzer, analyse
from analyzer.diagnosis.judge import Diagnosis
from analyzer.simulation import Scenario, simulate
from analyzer.tables.findings import About, Findings, codes, described, rules
from analyzer.tables.schema import Kind
from analyzer.tables.transactions import Transactions
from captures.chunks import Block, Capture, Chunk
from captures.line import LineSettings


def streamed(feeds: Sequence[Chunk | Block], line: LineSettings = LINE) -> Findings:
    """The findings of the live form: fed as the bytes come, no rows held back."""
    analyzer = Analyzer(line, settles=False)
    found = [Findings.zeros(0)]
    for feed in feeds:
        analyzer.feed(feed if isinstance(feed, Block) else Block.from_chunks([feed]))
        found.append(analyzer.latest.findings)
    analyzer.close()
    return Findings.joined([*found, analyzer.latest.findings])


def same(one: Findings, other: Findings) -> bool:
    return sorted(map(repr, one.tolist())) == sorted(map(repr, other.tolist()))


def held(chunks: Sequence[Chunk], line: LineSettings = LINE) -> list[Analysed]:
    return list(analyse(Capture.of(line, chunks)))


_LONG_BEHIND_A_STRAY_BYTE = [
    Chunk(0, b"\x01"),
    Chunk(4_000_000_000, b"\x03"),
    Chunk(4_000_000_000, bytes.fromhex("01000001 85f6 018302c0f1 01010000 0001fdca 010101005188 010101005188")),
]


@example(_LONG_BEHIND_A_STRAY_BYTE)
@example([Chunk(0, bytes.fromhex("010500000000cdca"))])  # asked last: no answer is missed
@settings(max_examples=30, deadline=None)
@given(streams())
def test_chunks_and_blocks_and_held_rows_give_the_same_findings(chunks: list[Chunk]) -> None:
    whole = streamed([Block.from_chunks(chunks)])
    assert same(whole, streamed(chunks))
    assert same(whole, Findings.joined([Findings.zeros(0), *(a.findings for a in held(chunks))]))


@pytest.mark.parametrize(("wire", "tap"), [("brutal", "precise"), ("noisy", "irq")])
def test_the_same_on_a_long_bus_however_it_is_fed(wire: str, tap: str) -> None:
    made = simulate(Scenario(wire, tap, transactions=300, seed=5))
    whole = streamed([Block.from_chunks(made.chunks)], made.line)
    pieces = [Block.from_chunks(made.chunks[i : i + 37]) for i in range(0, len(made.chunks), 37)]
    assert len(whole) > 50
    assert same(whole, streamed(pieces, made.line))
    assert same(whole, Findings.joined([a.findings for a in held(made.chunks, made.line)]))


@pytest.mark.parametrize(
    ("defect", "tap", "seed"),
    [
        ("collision", "irq", 0),
        ("collision", "gateway", 2),
        ("byte-missing", "irq", 6),
        ("flow-control-loss", "ftdi16", 8),
    ],
)
def test_the_same_where_a_damaged_frame_and_the_noise_behind_it_are_one(defect: str, tap: str, seed: int) -> None:
    """Chunk by chunk a frame comes before the rest of it does."""
    made = simulate(Scenario("clean", tap, transactions=200, seed=seed, defect=defect))
    whole = streamed([Block.from_chunks(made.chunks)], made.line)
    over_two_rows = 0
    for part in held(made.chunks, made.line):
        rows = part.batch.rows
        for found in described(part.findings[part.findings.start >= 0]):
            row = rows.row(int(rows.start.searchsorted(found.start, side="right")) - 1)
            over_two_rows += found.start + found.length > row.start + row.length
    assert over_two_rows
    assert same(whole, streamed(made.chunks, made.line))
    assert same(whole, Findings.joined([a.findings for a in held(made.chunks, made.line)]))


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
def test_a_finding_stands_on_a_row_of_its_batch_or_on_the_bus(tap: str) -> None:
    made = simulate(Scenario("brutal", tap, transactions=300, seed=3))
    analysed = held(made.chunks, made.line)
    assert sum(len(part.findings) for part in analysed) > 20
    for part in analysed:
        rows = part.batch.rows
        starts = dict(zip(rows.start.tolist(), rows.index.tolist(), strict=True))
        for finding in described(part.findings):
            if finding.start < 0:
                assert part is analysed[-1]
                assert finding.index is None
            elif finding.index is not None:
                assert starts[finding.start] == finding.index
            else:
                at = finding.start - rows.start
                assert ((at >= 0) & (at < rows.length)).any()
        told = [f for i in range(len(part.batch)) for f in part.batch.findings_of(i)]
        assert len(told) == (part.findings.start >= 0).sum()


def test_state_does_not_grow() -> None:
    """Requests that nobody answers, noise and damage without end: what is remembered stays small."""
    import pickle

    made = simulate(Scenario("brutal", "precise", transactions=1000, seed=2))
    deframer, transactions, diagnosis = rtu_deframer(made.line), Transactions(), Diagnosis(made.line)
    sizes = []
    for i in range(0, len(made.chunks), 1000):
        batch = deframer.feed(Block.from_chunks(made.chunks[i : i + 1000]))
        diagnosis.feed(batch, transactions.feed(batch))
        sizes.append(len(pickle.dumps(diagnosis.__dict__)))
    assert max(sizes[len(sizes) // 2 :]) < 2 * max(sizes[: len(sizes) // 2])
    assert max(sizes) < 2_000_000


def test_every_code_of_the_table_has_a_rule_with_words() -> None:
    from buses import shared

    table = [
        line.split("|")[1].strip().strip("`")
        for line in shared("design/findings.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")
    ]
    assert set(table) <= set(codes())


@pytest.mark.parametrize("rule", rules(), ids=codes())
def test_a_rule_says_something_whatever_is_known(rule) -> None:
    """Words need no figure that may be unknown, and are sentences without a full stop."""
    assert len(rule.numbers) == len(set(rule.numbers))
    for about in (rule.text, rule.cause, rule.remedy):
        assert about, rule.code
    assert isinstance(rule.about, About)
    assert rule.wastes in ("", *rule.numbers)
    ones = dict.fromkeys(rule.numbers, 1.0)
    for words in (rule.text, rule.cause, rule.remedy):
        said = rule.words(words, ones)
        assert said.strip() == said and said and not said.endswith(".")
        assert "\n" not in said


def test_rows_of_noise_carry_findings_too() -> None:
    made = simulate(Scenario("glitch", "precise", transactions=100, seed=2))
    noisy = [
        batch.batch.findings_of(i)
        for batch in held(made.chunks, made.line)
        for i in np.flatnonzero(batch.batch.rows.kind == Kind.NOISE).tolist()
    ]
    assert sum(bool(said) for said in noisy) > 0.9 * len(noisy)
