"""Network captures: what the capture itself tells of protocols, directions and holes, and what is no Modbus."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packets import Talk, mbap, pcap, read_answer, read_request

import captures
from analyzer.core import analyse
from analyzer.paste import judge
from analyzer.reports.summary import summarize
from analyzer.tables.findings import described
from captures import CaptureError
from dissectors.crc import crc_bytes

Frame = tuple[str, str]


def seen(folder: Path, talks: list[Talk], snap: int = 262144) -> tuple[list[Frame], list[str], captures.Capture]:
    """Direction and bytes of each frame, the codes of findings, and the capture."""
    path = folder / "net.pcap"
    path.write_bytes(pcap(sorted(packet for talk in talks for packet in talk.packets), snap=snap))
    capture = captures.open(path, judge=judge)
    frames, codes = [], []
    for part in analyse(capture):
        frames += [(frame.direction, frame.adu.data.hex()) for frame in part.batch.frames()]
        codes += [finding.code for finding in described(part.findings)]
    return frames, codes, capture


def exchanged(talk: Talk, pairs: list[tuple[bytes, bytes]]) -> list[Frame]:
    for request, answer in pairs:
        talk.ask(request).answer(answer)
    return [each for request, answer in pairs for each in (("request", request.hex()), ("response", answer.hex()))]


def vendor(n: int, random: Random) -> tuple[bytes, bytes]:
    return mbap(n, 0, b"\x5a\x00\x02"), mbap(n, 0, b"\x5a\x00\xfe" + random.randbytes(random.randrange(1, 60)))


@pytest.mark.parametrize("seed", range(4))
def test_functions_that_nobody_has_declared(tmp_path: Path, seed: int) -> None:
    random = Random(seed)
    polls = [(read_request(40 + n), read_answer(40 + n)) for n in range(seed % 2 * 12)]
    due = exchanged(talk := Talk().begin(), [vendor(n, random) for n in range(1 + seed * 4)] + polls)
    frames, _, capture = seen(tmp_path, [talk])
    assert frames == due
    assert capture.line.notes["protocols"] == "tcp"


def test_a_scan_with_one_transaction_number(tmp_path: Path) -> None:
    functions = (0, 9, 10, 13, 14, 1, 2, 3, 4, 18, 19, 25)
    scanned = [(mbap(0, 1, bytes((f, 0, 0, 0, 0))), mbap(0, 1, bytes((f | 0x80, 1)))) for f in functions]
    due = exchanged(talk := Talk().begin(), scanned)
    assert seen(tmp_path, [talk])[0] == due


@pytest.mark.parametrize("cut", [1, 3, 6, 9, 12])
@pytest.mark.parametrize("joint", [False, True])
def test_a_capture_that_begins_amid_an_answer(tmp_path: Path, cut: int, joint: bool) -> None:
    tail = read_answer(899)[cut:]
    talk = Talk()
    if joint:  # its next answer comes in the same segment
        talk.answer(tail + read_answer(900))
    else:
        talk.answer(tail)
    due = exchanged(talk, [(read_request(n, 3, 100), read_answer(n, 3)) for n in range(901, 911)])
    assert seen(tmp_path, [talk])[0][-20:] == due


@pytest.mark.parametrize("alike", [False, True])
def test_requests_that_are_sent_before_the_first_is_answered(tmp_path: Path, alike: bool) -> None:
    """Writes read like their answers: who asks is told by the connection."""
    talk = Talk().begin()
    writes = [mbap(504, 7, struct.pack(">BHH", 6, 4, 9 if alike else 9 + n)) for n in range(3)]
    for write in writes:
        talk.ask(write)
    for write in writes:
        talk.answer(write)
    frames, codes, _ = seen(tmp_path, [talk])
    assert [direction for direction, _ in frames] == ["request"] * 3 + ["response"] * 3
    assert codes == []


@pytest.mark.parametrize("snap", [66, 70, 80, 100])
def test_answers_that_the_snap_length_cut_are_answers(tmp_path: Path, snap: int) -> None:
    """Also those of which not even the header is there: then nobody can tell."""
    exchanged(talk := Talk().begin(), [(read_request(n, 4, 0, 40), read_answer(n, 4, range(40))) for n in range(20)])
    frames, codes, capture = seen(tmp_path, [talk], snap)
    assert [octets for direction, octets in frames if direction == "request"] == [
        read_request(n, 4, 0, 40).hex() for n in range(20)
    ]
    assert not {"no-response", "retry", "unexpected-response", "response-mismatch"} & set(codes)
    assert capture.damage
    report = summarize(capture)
    assert not report.causes and report.transactions.unanswered == 0


def enip(random: Random) -> bytes:
    data = random.randbytes(random.randrange(8, 60))
    return struct.pack("<HHII8sI", 0x6F, len(data), random.randrange(1 << 31), 0, bytes(8), 0) + data


def tpkt(random: Random) -> bytes:
    data = b"\x02\xf0\x80\x32\x01" + random.randbytes(random.randrange(8, 60))
    return b"\x03\x00" + struct.pack(">H", 4 + len(data)) + data


def opc_ua(random: Random) -> bytes:
    data = random.randbytes(random.randrange(16, 80))
    return b"MSGF" + struct.pack("<I", 8 + len(data)) + data


NEIGHBOURS = {"EtherNet/IP": (44818, enip), "ISO on TCP": (102, tpkt), "OPC UA": (4840, opc_ua)}


def test_a_plant_network_has_its_modbus_connections_alone_analysed(tmp_path: Path) -> None:
    random = Random(7)
    talks = []
    for i, (port, made) in enumerate(NEIGHBOURS.values()):
        other = Talk(("10.0.0.1", 50100 + i), ("10.0.0.20", port)).begin()
        for _ in range(40):
            other.ask(made(random)).answer(made(random))
        talks.append(other)
    due = exchanged(talk := Talk().begin(), [(read_request(n), read_answer(n)) for n in range(40)])
    gateway = Talk(server=("10.0.0.7", 4001), t_ns=1_700_000_009_000_000_000).begin()
    body, answer = bytes.fromhex("11030000 0002"), bytes.fromhex("110304 0001 0002")
    for _ in range(10):
        gateway.ask(body + crc_bytes(body)).answer(answer + crc_bytes(answer))
    frames, codes, capture = seen(tmp_path, [*talks, talk, gateway])
    assert sorted(frames) == sorted(
        due + [("request", (body + crc_bytes(body)).hex()), ("response", (answer + crc_bytes(answer)).hex())] * 10
    )
    assert codes == []
    assert not summarize(capture).causes
    assert all(name in capture.notices[0] for name in NEIGHBOURS)


@pytest.mark.parametrize("name", NEIGHBOURS)
def test_another_protocol_alone_is_named(tmp_path: Path, name: str) -> None:
    port, made = NEIGHBOURS[name]
    talk = Talk(server=("10.0.0.20", port)).begin()
    random = Random(1)
    for _ in range(20):
        talk.ask(made(random)).answer(made(random))
    with pytest.raises(CaptureError, match=name):
        seen(tmp_path, [talk])


def test_modbus_behind_tls_is_said_to_be_that(tmp_path: Path) -> None:
    talk = Talk(server=("10.0.0.9", 802)).begin()
    for _ in range(4):
        talk.ask(b"\x17\x03\x03\x00\x40" + bytes(64)).answer(b"\x17\x03\x03\x00\x40" + bytes(64))
    with pytest.raises(CaptureError, match="Modbus/TCP Security: encrypted"):
        seen(tmp_path, [talk])


def test_who_asks_is_seen_where_the_capture_lacks_the_beginning(tmp_path: Path) -> None:
    """Both ports are high, and the server's the higher: its answers tell."""
    talk = Talk(("10.0.0.1", 2000), ("10.0.0.9", 5020))
    due = exchanged(talk, [(read_request(n), read_answer(n)) for n in range(12)])
    assert seen(tmp_path, [talk])[0][-20:] == due[-20:]


@given(st.integers(0, 2**32), st.sets(st.integers(3, 26), min_size=1, max_size=3))
@settings(max_examples=40, deadline=None)
def test_packets_that_the_capture_lacks_are_nobodys_fault(seed: int, lost: set[int]) -> None:
    """Whichever they are, the frames of the others are there, in order, and neither client nor server is blamed."""
    random = Random(seed)
    units = [random.choice((0, 1, 255)) for _ in range(12)]
    due = exchanged(talk := Talk().begin(), [(read_request(n, u), read_answer(n, u)) for n, u in enumerate(units)])
    talk.packets[:] = [packet for i, packet in enumerate(talk.packets) if i not in lost]
    with TemporaryDirectory() as folder:
        frames, codes, capture = seen(Path(folder), [talk])
        assert frames == [frame for i, frame in enumerate(due, 3) if i not in lost]
        assert not codes or lost & {3, 26}  # nobody knows of an answer behind the last packet
        assert not summarize(capture).causes


@given(st.integers(0, 2**32), st.integers(0, 40))
@settings(max_examples=20, deadline=None)
def test_a_connection_cut_into_segments_anywhere(seed: int, size: int) -> None:
    """What is said runs over segments of any size."""
    random = Random(seed)
    talk, due = Talk().begin(), []
    for n in range(12):
        for frame, say, name in ((read_request(n), talk.ask, "request"), (read_answer(n), talk.answer, "response")):
            due.append((name, frame.hex()))
            while frame:
                cut = random.randrange(1, size + 2)
                say(frame[:cut])
                frame = frame[cut:]
    with TemporaryDirectory() as folder:
        assert seen(Path(folder), [talk])[0] == due


@given(st.integers(0, 2**32), st.integers(0, 40), st.integers(1, 11))
@settings(max_examples=40, deadline=None)
def test_a_connection_that_the_capture_joins_inside_a_frame(seed: int, size: int, lost: int) -> None:
    """From the first whole exchange on its frames are there, over segments of any size."""
    random = Random(seed)
    talk, due = Talk(), []
    for n in range(12):
        for frame, say, name in ((read_request(n), talk.ask, "request"), (read_answer(n), talk.answer, "response")):
            due.append((name, frame.hex()))
            frame = frame if due[1:] else frame[lost:]
            while frame:
                cut = random.randrange(1, size + 2)
                say(frame[:cut])
                frame = frame[cut:]
    with TemporaryDirectory() as folder:
        assert seen(Path(folder), [talk])[0][-22:] == due[-22:]
