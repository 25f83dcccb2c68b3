"""Line settings found by listening, on a line of bits: a wave sampled at the wrong rate gives the wrong bytes."""

import pytest
from buses import adu
from uart import received, wave

from analyzer.live.tapsource import explained
from captures.chunks import Block, Chunk
from captures.live.baud import Search
from captures.live.settings import PortSettings

FRAMES = [
    adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad"), adu("010400080002"), adu("010404435c0a3d"),
    adu("110500acff00"), adu("110500acff00"), adu("0203000a0004"), adu("02030800010203fffe7a10"),
]  # fmt: skip


def talk(line, rounds=1):
    """Polls and answers with silences between them."""
    at, said = 0.01, []
    for _ in range(rounds):
        for frame in FRAMES:
            said.append((at, frame))
            at += (len(frame) + 6) * line.char_bits / line.baud
    return said


def line_of(baud, parity, stop_bits=1.0):
    return PortSettings("tap", baud, parity, stop_bits)


def test_the_model_hears_what_was_sent_when_it_listens_as_it_was_sent():
    for parity in "NEO":
        line = line_of(19200, parity)
        block = received(wave(talk(line), line), line)
        assert block.data.tobytes() == b"".join(FRAMES)
        assert not len(block.errors)


def test_the_model_hears_other_bytes_at_another_rate_and_errors_at_another_parity():
    line = line_of(9600, "N")
    levels = wave(talk(line), line)
    for baud in (4800, 19200, 38400):
        assert FRAMES[0] not in received(levels, line_of(baud, "N")).data.tobytes()
    assert len(received(levels, line_of(9600, "E")).errors) > 20


@pytest.mark.parametrize(
    ("baud", "parity", "stop_bits"),
    [(9600, "N", 1), (19200, "E", 1), (9600, "E", 1), (19200, "N", 2), (115200, "N", 1), (38400, "O", 1),
     (57600, "E", 1), (2400, "N", 1)],
)  # fmt: skip
def test_settings_are_found_by_listening(baud, parity, stop_bits):
    line = line_of(baud, parity, stop_bits)
    search = Search(PortSettings("tap"), explained)
    levels = wave(talk(line, rounds=4), line)
    tries = 0
    while search.found is None:
        heard = received(levels, search.settings)  # the bus says the same again in each try
        if len(heard):
            search.feed(heard)
        done = search.step(int(heard.t_ns[-1]) + 6 * 10**9 if len(heard) else 0)
        assert done is not None, f"{search.settings}: {len(heard.data)} bytes tell nothing"
        tries += 1
        assert tries < 64
    assert (search.found.baud, search.found.parity) == (baud, parity)


def test_a_known_rate_leaves_only_the_parity_to_find():
    line = line_of(19200, "O")
    search = Search(PortSettings("tap", 19200), explained)
    levels = wave(talk(line, rounds=4), line)
    for _ in range(3):
        search.feed(received(levels, search.settings))
        search.step(10**10)
        if search.found:
            break
    assert search.found == line_of(19200, "O")


def test_a_silent_line_is_waited_for():
    search = Search(PortSettings("tap"), explained)
    first = search.settings
    for second in range(100):
        assert search.step(second * 10**9) is None
    assert search.settings == first


def test_noise_settles_nothing():
    search = Search(PortSettings("tap"), explained)
    for number in range(80):
        search.feed(Block.from_chunks([Chunk(number * 10**9 + n, bytes([n * 37 & 0xFF] * 40)) for n in range(5)]))
        search.step(number * 10**9 + 10**9)
        assert search.found is None


def test_a_noisy_line_is_taken_at_the_best_settings():
    line = line_of(9600, "N")
    search = Search(line_of(None, "N"), explained, free_parity=False)
    levels = wave(talk(line, rounds=4), line)
    for at in range(9_000, len(levels), 120_000):  # spikes
        levels[at : at + 200] ^= 1
    for _ in range(40):
        heard = received(levels, search.settings)
        search.feed(heard)
        done = search.step(10**10)
        if search.found:
            break
    assert search.found == line
    assert done is not None and done.score < 1
