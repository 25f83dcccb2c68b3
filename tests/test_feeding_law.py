"""What a capture tells does not hang on how it is fed: a few streams of each kind of `benchmarks/feeding`."""

from __future__ import annotations

from random import Random

import pytest
from scripts import package

KINDS = list(package("feeding.streams").KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_at_once_read_by_read_byte_by_byte_and_live_tell_the_same(kind: str) -> None:
    for seed in range(2):
        stream = package("feeding.streams").stream(kind, seed)
        assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("one-port", 10363),
        ("one-port", 320195),
        ("one-port", 320295),
        ("cut-anywhere", 10009),
        ("cut-anywhere", 10238),
        ("cut-anywhere", 310156),
    ],
)
def test_a_run_ends_only_where_the_lattice_would_decide_too(kind: str, seed: int) -> None:
    """Streams of the campaign on which a run of frames was taken and the lattice, live, had not decided so far."""
    stream = package("feeding.streams").stream(kind, seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize(("kind", "seed"), [("gateway", 300100), ("gateway", 300161), ("vendor", 310026)])
def test_what_is_noise_does_not_hang_on_where_a_look_begins(kind: str, seed: int) -> None:
    """Streams of the campaign: a damaged frame behind one decided or on the same path; a function heard just before."""
    stream = package("feeding.streams").stream(kind, seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize("seed", [40039, 40116, 40136])
def test_what_modbus_tcp_leaves_open_is_told_when_it_is_settled(seed: int) -> None:
    """Streams of the campaign: the answer to a request that another overtook, and directions of two ports."""
    stream = package("feeding.streams").stream("tcp", seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


def test_a_breach_is_seen() -> None:
    """The comparison itself: a row that is another is told."""
    ways = package("feeding.ways")
    told = ways.at_once(package("feeding.streams").stream("one-port", 1))
    other = ways.Told(told.rows.copy(), told.transactions, told.findings[:0])
    other.rows.start[:] += 1
    assert len(list(ways._differences(told, other, set()))) >= 1 + bool(len(told.findings))


@pytest.mark.parametrize("seed", [1000021, 1001243])
def test_transactions_over_tcp_pair_by_what_stands_before_them_and_in_them(seed: int) -> None:
    """A connection asks from its first request on; a frame too short to say what it asks is answered by nothing."""
    stream = package("feeding.streams").stream("tcp", seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []
