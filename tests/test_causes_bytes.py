"""Causes on buses written byte by byte: what generators of cases would not draw often enough."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.rawbytes import CharacterFormat, misread
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.causes.sentas import formats_as_fast, sent_as
from analyzer.core import analyse
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

Sent = tuple[float, bytes]
_LINE = LineSettings(baud=9600, char_bits=10)
_CHAR_MS = 10e3 / 9600


def _frame(*octets: int) -> bytes:
    return bytes(octets) + crc_bytes(bytes(octets))


def _read(unit: int, quantity: int = 2) -> bytes:
    return _frame(unit, 3, 0, 0, 0, quantity)


def _answer(unit: int, *registers: int) -> bytes:
    return _frame(unit, 3, 2 * len(registers), *(octet for each in registers for octet in divmod(each, 256)))


def _well(unit: int, i: int, pause_ms: float = 20.0) -> Iterator[Sent]:
    """A read of two registers and its answer, each behind a silence (ms)."""
    yield pause_ms, _read(unit)
    yield 6.0 + i % 3, _answer(unit, 1000 + i % 7, 40_000 + i)


def _causes(sent: Iterable[Sent], line: LineSettings = _LINE, char_ms: float = _CHAR_MS) -> list[Cause]:
    chunks, t = [], 0.0
    for silence_ms, data in sent:
        t += silence_ms
        for octet in data:
            t += char_ms
            chunks.append(Chunk(round(t * 1e6), bytes((octet,))))
    capture = Capture.of(line, chunks)
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def _named(causes: Iterable[Cause]) -> list[tuple[str, tuple[int, ...]]]:
    return [(cause.cause, cause.units) for cause in causes]


def test_a_wrong_byte_behind_right_ones_is_no_damage_at_the_head() -> None:
    """A driver that is late takes the first byte first."""

    def sent() -> Iterator[Sent]:
        for i in range(120):
            yield from _well(1, i)
            yield 20.0, _read(2)
            good = bytearray(_answer(2, 1000, 7 + i // 50))
            if i % 3 == 0:
                good[3 + i % 2] ^= 1 << i % 8
            yield 7.0, bytes(good)

    found = _causes(sent())
    assert found
    assert found[0].units == (2,)
    assert "driver-enabled-late" not in [cause.cause for cause in found]


def test_a_request_that_chance_makes_of_garbage_is_no_request_that_answers_collide_with() -> None:
    ending = bytes.fromhex("0080f878")
    chance = next(
        each
        for high in range(256)
        for low in range(256)
        if crc_bytes(each := bytes((0x80, 3, high, low)) + ending[:2]) == ending[2:]
    )
    random = Random(3)

    def sent() -> Iterator[Sent]:
        for i in range(150):
            yield from _well(1, i)
            yield 20.0, _read(2, 8)
            noise = bytes(random.choice(b"\x00\x80\xf8\x78") for _ in range(16))
            yield 5.0, noise[:6] + (chance + ending[2:] if i == 70 else noise[6:10] + ending) + noise[10:]

    found = _causes(sent())
    assert found[0].units == (2,)
    assert {cause.cause for cause in found}.isdisjoint({"timeout-too-short", "two-masters"})


def test_answers_of_the_only_unit_that_lose_their_heads_are_its_own_fault_though_from_a_time_on() -> None:
    """What comes from outside would hit the requests as well."""

    def sent() -> Iterator[Sent]:
        for i in range(400):
            yield 20.0, _read(7)
            yield 8.0 + i % 3, _answer(7, 1000 + i % 5, i)[1 if i > 200 else 0 :]

    assert _named(_causes(sent())) == [("driver-enabled-late", (7,))]


def test_seven_data_bits_and_parity_are_told_on_a_line_of_eight() -> None:
    def seven(data: bytes) -> bytes:
        return bytes(octet & 127 | (octet & 127).bit_count() % 2 << 7 for octet in data)

    def sent() -> Iterator[Sent]:
        for i in range(120):
            yield from _well(1, i)
            yield 20.0, _read(5, 6)
            yield 6.0, seven(_answer(5, *(i * 37 * k % 65536 for k in range(1, 7))))

    found = _causes(sent())
    assert _named(found)[0] == ("unit-line-settings", (5,))
    assert "seven data bits" in found[0].text


def test_a_unit_of_which_more_answers_come_than_it_was_asked_for_is_two() -> None:
    """Behind the first the master goes on, and what it asks next meets the second."""

    def sent() -> Iterator[Sent]:
        for i in range(150):
            yield from _well(1, i)
            yield 20.0, _read(2)
            yield 8.0, _answer(2, 500, i)
            yield 6.0, _read(3)
            yield 5.0 + i % 4, _answer(2, 900, 3 * i)  # the other map, when unit 3 is due
            if i % 3:
                yield 3.0, _read(3)  # which the master takes for an answer, and asks again
                yield 5.0, _answer(3, 5, i)
            if i % 9 == 0:
                yield 20.0, _read(99)
                yield 500.0, b""

    assert _causes(sent())[0].units in [(), (2,)]


def test_a_write_that_two_devices_echo_is_no_late_answer() -> None:
    """The first echo reads like the request once more, the second like its answer."""

    def sent() -> Iterator[Sent]:
        for i in range(120):
            yield from _well(1, i)
            write = _frame(2, 6, 0, 20, i // 200, i % 200)
            yield from ((70.0, write), (30.0, write), (40.0 + i % 5, write))
            yield 70.0, _read(2)
            yield 30.0, _answer(2, 500, i)
            yield 40.0 + i % 5, _answer(2, 900, 3 * i)

    assert _causes(sent())[0].units in [(), (2,)]


def test_garbage_that_begins_just_when_the_master_gives_up_is_its_own_next_request() -> None:
    """Which meets the slow answer; the silence before it tells the timeout."""
    timeout_ms, random = 120.0, Random(5)

    def sent() -> Iterator[Sent]:
        for i in range(200):
            yield from _well(1, i)
            yield 20.0, _read(2, 8)
            delay = random.uniform(40, 160)
            answer = _answer(2, *(1000 + i + k for k in range(8)))
            if delay < timeout_ms:
                yield delay, answer
            elif delay < timeout_ms + 8:  # both at once
                mixed = bytes(a & b for a, b in zip(answer, _read(2, 8) + answer, strict=False))
                yield timeout_ms, mixed + answer[-3:]
            else:
                yield timeout_ms, _read(2, 8)
                yield delay - timeout_ms, answer

    assert _named(_causes(sent()))[0] == ("timeout-too-short", (2,))


def test_silences_of_just_what_is_due_are_no_haste_where_a_character_s_length_is_not_known() -> None:
    """Of ten bits, as most are, and not of the eleven of the standard."""
    due_ms = 3.51 * _CHAR_MS

    def sent() -> Iterator[Sent]:
        for i in range(200):
            for unit in (1, 2, 3):
                yield due_ms, _read(unit)
                yield due_ms, _answer(unit, 1000 + i % 7, i)

    assert _named(_causes(sent(), LineSettings(baud=9600))) == []


def test_a_tap_of_seven_data_bits_is_its_own_fault_though_some_frames_are_whole() -> None:
    """Those of which no byte has the highest bit."""

    def sent() -> Iterator[Sent]:
        for i in range(150):
            for unit in (1, 2, 3):
                yield 20.0, bytes(octet & 127 for octet in _read(unit, 1 + i % 9))
                yield (
                    6.0,
                    bytes(octet & 127 for octet in _answer(unit, *(i * 37 * k % 65536 for k in range(2 + i % 9)))),
                )

    assert _named(_causes(sent()))[0] == ("tap-line-settings", ())


def test_a_clock_that_is_off_and_spares_the_header_is_told_by_the_check_value() -> None:
    """Two devices that send at once would spare it as well."""
    receiver = CharacterFormat(9600)
    sender = CharacterFormat(9600 * 0.93)

    def sent() -> Iterator[Sent]:
        for i in range(120):
            yield from _well(1, i)
            yield 20.0, _read(7, 1)
            good = _answer(7, 0x80 + i)
            yield 6.0, b"".join(misread(bytes((octet, 0xFF)), sender, receiver)[:1] for octet in good)

    found = _causes(sent())
    assert _named(found)[0] == ("unit-line-settings", (7,))
    assert "a clock that is off" in found[0].text


@pytest.mark.parametrize("junk", [591, 592, 593, 600])
def test_a_second_answer_behind_more_noise_than_a_sample_keeps_is_looked_at(junk: int) -> None:
    def sent() -> Iterator[Sent]:
        for i in range(40):
            yield from _well(1, i)
            yield 20.0, _read(2)
            yield 6.0, _answer(2, 1000, i)
            if i % 2:
                yield 5.0, Random(i).randbytes(junk)
                yield 5.0, _answer(2, 7, i)

    assert _causes(sent())[0].units in [(), (2,)]


def _as_uart_reads(levels: list[int]) -> bytes:
    """What a UART that takes a missing stop bit for the next start bit makes of levels, one a bit of its own."""
    found, at = bytearray(), 0
    levels = [*levels, *[1] * 12]
    while 0 in levels[at:-12]:
        at = levels.index(0, at)
        found.append(sum(level << i for i, level in enumerate(levels[at + 1 : at + 9])))
        at += 9
    return bytes(found)


@pytest.mark.parametrize("sent", ["E", "O"])
def test_a_whole_answer_with_a_parity_that_the_line_has_not_is_known_again(sent: str) -> None:
    """Whatever its values are, by its check value; and by that parity alone."""
    sender, receiver = CharacterFormat(19200, 8, sent, 1), CharacterFormat(19200)
    random = Random(sent)
    told = Counter[str]()
    for _ in range(20):
        body = bytes((5, 3, 8, *random.randbytes(8)))
        frame = body + crc_bytes(body)
        heard = _as_uart_reads([bit for byte in frame for bit in sender.bits(byte)])
        told.update(
            form.words
            for form in formats_as_fast(receiver)
            if sent_as(heard, frame[:3], len(frame), form, receiver) > 4
        )
    assert told[sender.words] >= 18
    assert told.total() - told[sender.words] <= 2
