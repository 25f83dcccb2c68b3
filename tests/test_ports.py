"""What a port speaks, decided over the whole: whatever its first bytes are, and however they are read."""

from __future__ import annotations

from random import Random

import pytest
from buses import LINE as UNSET
from buses import collect
from hypothesis import given, settings
from hypothesis import strategies as st
from packets import mbap, read_answer, read_request

from analyzer.deframing.protocols import Deframer
from analyzer.deframing.weighing import PortWeights, rtu_bits, tcp_bits
from captures.chunks import Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes, lrc

SECOND = 10**9
SERIAL = LineSettings(baud=9600, char_bits=10)
Frame = tuple[int, bytes]
MOST = settings(max_examples=30, deadline=None)


def adu(unit: int, pdu: bytes) -> bytes:
    body = bytes((unit,)) + pdu
    return body + crc_bytes(body)


def rtu_polls(random: Random, count: int) -> list[bytes]:
    """Requests of a client, most of them to register 0, and the answers."""
    said = []
    for _ in range(count):
        unit, quantity = random.choice((1, 2, 17)), random.choice((1, 2, 2, 6))
        start = random.choice((0, 0, 0, 100))
        said.append(adu(unit, bytes((3,)) + start.to_bytes(2, "big") + quantity.to_bytes(2, "big")))
        said.append(adu(unit, bytes((3, 2 * quantity)) + random.randbytes(2 * quantity)))
    return said


def tcp_polls(random: Random, count: int) -> list[bytes]:
    return [
        each
        for n in range(count)
        for each in (
            read_request(n, random.choice((1, 255)), random.choice((0, 100)), 2),
            read_answer(n, 1, (random.randrange(1 << 16), random.randrange(9))),
        )
    ]


def spelt(text: str) -> bytes:
    data = bytes.fromhex(text)
    return b":" + (data + bytes([lrc(data)])).hex().upper().encode() + b"\r\n"


def chunked(reads: list[bytes]) -> list[Chunk]:
    return [Chunk(SECOND + i * 20_000_000, data) for i, data in enumerate(reads)]


def frames(chunks: list[Chunk], line: LineSettings = SERIAL, *, at_once: bool = True) -> list[Frame]:
    """Protocol and bytes of each right frame; read by read with ticks between, as on a live line, or at once."""
    deframer = Deframer(line)
    batches = [deframer.feed(chunks)] if at_once else []
    for chunk in () if at_once else chunks:
        batches += [deframer.feed(chunk), deframer.tick(chunk.t_ns + 10_000_000)]
    found = collect([*batches, deframer.close()])
    rows = found.rows
    right = ((rows.kind != 0) & rows.check).nonzero()[0].tolist()
    return [(int(rows.protocol[i]), found.data[rows.start[i] : rows.start[i] + rows.length[i]]) for i in right]


@given(st.integers(0, 2**32), st.integers(1, 3), st.binary(min_size=1, max_size=24))
@MOST
def test_a_bus_whose_first_bytes_are_damaged_gives_the_same_frames_behind_them(
    seed: int, lost: int, junk: bytes
) -> None:
    """Of the first exchange, or before it, any bytes are others; everything from the second on is the same."""
    random = Random(seed)
    said = rtu_polls(random, 8)
    damaged = list(said)
    for i in range(min(lost, 2)):
        octets = bytearray(damaged[i])
        octets[random.randrange(len(octets))] ^= 1 << random.randrange(8)
        damaged[i] = bytes(octets)
    if lost == 3:
        damaged[0] = junk
    for at_once in (True, False):
        whole = frames(chunked(said), at_once=at_once)
        assert whole == [(0, octets) for octets in said]
        assert frames(chunked(damaged), at_once=at_once)[-12:] == whole[-12:]


@pytest.mark.parametrize("line", [SERIAL, UNSET])
@pytest.mark.parametrize("at_once", [True, False])
def test_a_damaged_request_for_two_registers_from_0_does_not_make_a_bus_tcp(line: LineSettings, at_once: bool) -> None:
    said = [bytes.fromhex("010300000002c40c"), *rtu_polls(Random(5), 30)]
    assert frames(chunked(said), line, at_once=at_once) == [(0, octets) for octets in said[1:]]


@given(st.integers(0, 2**32), st.integers(0, 24))
@MOST
def test_a_tcp_stream_that_is_begun_anywhere_gives_the_frames_behind_that(seed: int, cut: int) -> None:
    said = tcp_polls(Random(seed), 10)
    begun = [octets for octets in [b"".join(said[:2])[cut:], *said[2:]] if octets]
    for at_once in (True, False):
        assert frames(chunked(begun), UNSET, at_once=at_once)[-18:] == [(2, octets) for octets in said[2:]]


@given(st.integers(0, 2**32), st.lists(st.integers(1, 30), min_size=1, max_size=20))
@MOST
def test_however_a_port_is_read_its_protocol_and_its_frames_are_the_same(seed: int, sizes: list[int]) -> None:
    """Junk, then a protocol, then another: at once, and in reads of any size."""
    random = Random(seed)
    ascii_polls = [spelt(f"11030{n:03}0002") for n in range(random.randrange(12))]
    parts = [random.randbytes(random.randrange(40)), *rtu_polls(random, random.randrange(14)), *ascii_polls]
    parts += tcp_polls(random, random.randrange(10))
    data = b"".join(parts)
    cuts, at = list[bytes](), 0
    while at < len(data):
        size = sizes[len(cuts) % len(sizes)]
        cuts.append(data[at : at + size])
        at += size
    chunks = chunked(cuts)
    one, many = Deframer(UNSET), Deframer(UNSET)
    at_once = collect([one.feed(chunks), one.close()])
    by_reads = collect([*(many.feed(chunk) for chunk in chunks), many.close()])
    assert at_once.data == by_reads.data == data
    for name in ("start", "length", "kind", "protocol", "check", "request"):
        assert at_once.rows.column(name).tolist() == by_reads.rows.column(name).tolist(), name


def test_a_choice_that_no_longer_fits_is_made_again() -> None:
    """A tool searches for a device in ASCII mode first; the bus that follows is RTU."""
    said = rtu_polls(Random(3), 60)
    search = [spelt("110300000001"), spelt("120300000001"), spelt("130300000001")]
    found = frames(chunked(search + said))
    assert found[:3] == [(1, octets) for octets in search]
    assert found[3:] == [(0, octets) for octets in said]


def test_a_serial_line_may_carry_mbap_all_the_same() -> None:
    """A client speaks Modbus TCP to a gateway that passes bytes on as they are."""
    said = [read_request(n, 17, 0, 2) for n in range(12)]
    answered = [octets for n in range(8) for octets in (read_request(n, 17), read_answer(n, 17))]
    assert frames(chunked(answered)) == [(2, octets) for octets in answered]
    assert len(frames(chunked(said))) == 12


CRCS = {
    "turned": lambda right: right[::-1],
    "flipped": lambda right: bytes((right[0], right[1] ^ 0x10)),
    "zero": lambda right: bytes(len(right)),
    "missing": lambda right: right[:0],
}


def written(function: int, register: int, quantity: int) -> bytes:
    body = bytes((function,)) + register.to_bytes(2, "big") + quantity.to_bytes(2, "big")
    size = {15: (quantity + 7) // 8, 16: 2 * quantity}.get(function)
    return body if size is None else body + bytes((size,)) + bytes((7 * i + quantity) & 0xFF for i in range(size))


QUANTITIES = {
    1: range(1, 2001), 2: range(1, 2001), 3: range(1, 126), 4: range(1, 126), 5: (0, 0xFF00), 6: range(0, 65536, 251),
    15: range(1, 1969, 5), 16: range(1, 124),
}  # fmt: skip


@pytest.mark.parametrize("way", CRCS)
@pytest.mark.parametrize("function", QUANTITIES)
def test_a_request_without_a_right_check_value_is_rtu_all_the_same(function: int, way: str) -> None:
    for register in (0, 1, 2):
        for quantity in QUANTITIES[function]:
            body = bytes((17,)) + written(function, register, quantity)
            sent = body + CRCS[way](crc_bytes(body))
            assert rtu_bits(sent) > tcp_bits(sent), sent.hex()


@pytest.mark.parametrize("request_of_tcp", [read_request(1, 1, 0, 2), read_request(259, 11, 0, 2), mbap(1, 1, b"\x07")])
def test_a_request_over_tcp_is_none_of_rtu(request_of_tcp: bytes) -> None:
    assert tcp_bits(request_of_tcp) > max(rtu_bits(request_of_tcp), 0)


def test_noise_alone_proves_nothing() -> None:
    proven = []
    for seed in range(40):
        weights = PortWeights()
        weights.feed(Random(seed).randbytes(2048))
        proven.append(weights.proven)
    assert proven == [None] * 40
