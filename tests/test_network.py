"""Network captures: link types, TCP put together, connections chosen by content, our own files back bit for bit."""

from __future__ import annotations

import io
import json
import random
import shutil
import struct
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from packets import (
    ACK,
    FIN,
    SERVER,
    SYN,
    Packet,
    Talk,
    framed,
    ip_packet,
    mbap,
    names,
    pcap,
    pcapng,
    pcapng_block,
    pcapng_option,
    read_answer,
    read_request,
)

import captures
from captures import Capture, CaptureError, Chunk, LineSettings, Mark
from captures.formats import formats
from captures.network.choosing import kind_of
from captures.network.tcp import ConnectionGroup, Half, Reassembly
from captures.recording.notes import Note
from dissectors.crc import crc_bytes

FILES = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
TSHARK = shutil.which("tshark")


def opened(folder: Path, content: bytes, name: str = "net.pcap") -> Capture:
    path = folder / name
    path.write_bytes(content)
    return captures.open(path)


def said(capture: Capture, port: int = 0) -> list[tuple[Mark, bytes]]:
    return [(chunk.mark, chunk.data) for chunk in capture.chunks() if chunk.port == port]


def polled(talk: Talk, count: int = 4) -> Talk:
    for number in range(count):
        talk.ask(read_request(number)).answer(read_answer(number))
    return talk


EXPECTED = [part for n in range(4) for part in ((Mark.TX, read_request(n)), (Mark.RX, read_answer(n)))]


@pytest.mark.parametrize("link", [1, 113, 276, 101, 0, 228])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("nanoseconds", [False, True])
def test_every_link_type_and_byte_order(tmp_path: Path, link: int, order: str, nanoseconds: bool) -> None:
    talk = polled(Talk(link=link).begin())
    capture = opened(tmp_path, pcap(talk.packets, link, order, nanoseconds))
    assert said(capture) == EXPECTED
    assert capture.line.tap == "network"
    assert names(capture) == {"port 0": "10.0.0.1 > 10.0.0.9:502"}
    times = [t_ns for t_ns, _ in talk.packets[3:]]
    assert [chunk.t_ns for chunk in capture.chunks()] == times
    assert not capture.damage
    assert not capture.notices


@pytest.mark.parametrize("vlans", [1, 2])
@pytest.mark.parametrize("link", [1, 276, 229])
def test_ipv6_and_vlan(tmp_path: Path, vlans: int, link: int) -> None:
    talk = polled(Talk(("fd00::1", 40000), ("fd00::9", 4001), link=link, vlans=vlans if link == 1 else 0).begin())
    capture = opened(tmp_path, pcap(talk.packets, link))
    assert said(capture) == EXPECTED
    assert names(capture) == {"port 0": "fd00::1 > [fd00::9]:4001"}


def test_pcapng_with_sections_interfaces_and_old_packets(tmp_path: Path) -> None:
    one, two = polled(Talk().begin(), 2), polled(Talk(server=("10.0.0.8", 502), link=101).begin(), 2)
    first = pcapng([(0, t, packet, b"") for t, packet in one.packets], [1], ">", 9)
    old = b""
    for t_ns, packet in two.packets:
        stamp = t_ns // 1000
        head = struct.pack("<HHIIII", 0, 0, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
        old += pcapng_block(2, head + packet + bytes(-len(packet) % 4))
    capture = opened(tmp_path, first + pcapng([], [101]) + old)
    assert said(capture, 0) == EXPECTED[:4]
    assert said(capture, 1) == EXPECTED[:4]
    assert capture.line.notes["port 1"] == "10.0.0.1 > 10.0.0.8:502"


def test_midstream_the_client_is_who_has_the_ports_of_one(tmp_path: Path) -> None:
    talk = polled(Talk())
    assert said(opened(tmp_path, pcap(talk.packets))) == EXPECTED
    flipped = Talk().answer(read_answer(9))
    flipped.seqs = talk.seqs
    assert said(opened(tmp_path, pcap(polled(flipped).packets)))[0][0] == Mark.RX


@FILES
@given(data=st.data())
def test_whatever_the_network_does_each_byte_comes_once_and_in_order(tmp_path: Path, data: st.DataObject) -> None:
    """Segments cut anywhere, sent again whole or in part, captured twice, in another order."""
    chance = random.Random(data.draw(st.integers(0, 2**32)))
    asked, answered = b"".join(read_request(n) for n in range(30)), b"".join(read_answer(n) for n in range(30))
    talk = Talk().begin()
    sent: list[tuple[int, bool, bytes]] = []
    for from_client, stream in ((True, asked), (False, answered)):
        at = 0
        while at < len(stream):
            size = chance.randrange(1, 40)
            sent.append((at, from_client, stream[at : at + size]))
            if chance.random() < 0.3:
                back = chance.randrange(at + 1)
                sent.append((back, from_client, stream[back : back + chance.randrange(1, 60)]))
            at += size
    sent.sort(key=lambda part: part[0] + chance.randrange(60))
    packets = list(talk.packets)
    seqs = tuple(talk.seqs)
    for i, (at, from_client, octets) in enumerate(sent):
        ends = (talk.client, talk.server) if from_client else (talk.server, talk.client)
        seq = seqs[0 if from_client else 1] + at
        packets.append((talk.t_ns + i * 1000, framed(ip_packet(*ends, seq, 0, 0x18 & ~ACK, octets))))
    capture = opened(tmp_path, pcap(packets))
    parts = said(capture)
    assert b"".join(octets for mark, octets in parts if mark == Mark.TX) == asked
    assert b"".join(octets for mark, octets in parts if mark == Mark.RX) == answered
    assert not capture.damage
    for _, octets in parts:
        assert octets[2:4] == b"\0\0", "a read begins with a frame, whatever came between its parts"


def test_what_the_capture_lost_is_said_and_not_waited_for(tmp_path: Path) -> None:
    talk = polled(Talk().begin(), 2)
    talk.ask(read_request(2)).answer(read_answer(2))
    del talk.packets[-1]  # the answer was sent, and acknowledged by what follows
    polled(talk, 2)
    capture = opened(tmp_path, pcap(talk.packets))
    parts = said(capture)
    assert len(parts) == 4 + 1 + 4
    assert [loss.where for loss in capture.damage] == ["10.0.0.1 > 10.0.0.9:502"]
    assert f"{len(read_answer(2))} bytes" in capture.damage[0].what
    times = [chunk.t_ns for chunk in capture.chunks()]
    assert times == sorted(times)


def test_a_snap_length_cuts_payloads_and_says_so(tmp_path: Path) -> None:
    talk = Talk().begin()
    for number in range(4):
        talk.ask(read_request(number)).answer(read_answer(number, values=range(40)))
    capture = opened(tmp_path, pcap(talk.packets, snap=100))
    assert [octets for mark, octets in said(capture) if mark == Mark.TX] == [read_request(n) for n in range(4)]
    list(capture.blocks())
    assert "bytes of this connection are not in the capture" in capture.damage[0].what


def test_connections_have_a_port_each_and_share_one_when_they_follow_each_other(tmp_path: Path) -> None:
    packets: list[Packet] = []
    for poll in range(5):  # a client that connects anew for each poll
        talk = Talk(("10.0.0.1", 51000 + poll), t_ns=poll * 10**9).begin()
        packets += polled(talk, 1).end().packets
    one = polled(Talk(("10.0.0.2", 40001), t_ns=10**8).begin(), 3)
    two = polled(Talk(("10.0.0.2", 40002), t_ns=10**8 + 1000).begin(), 3)
    packets = sorted(packets + one.packets + two.packets)
    capture = opened(tmp_path, pcap(packets))
    assert list(names(capture).items()) == [
        ("port 0", "10.0.0.1 > 10.0.0.9:502"),
        ("port 1", "10.0.0.2 > 10.0.0.9:502"),
        ("port 2", "10.0.0.2 > 10.0.0.9:502"),
    ]
    assert said(capture, 0) == EXPECTED[:2] * 5
    assert said(capture, 1) == said(capture, 2) == EXPECTED[:6]


def test_more_connections_than_ports_share_them(tmp_path: Path) -> None:
    packets: list[Packet] = []
    for number in range(300):
        packets += polled(Talk(("10.0.0.1", 40000 + number), t_ns=number * 10**8).begin(), 1).packets
    capture = opened(tmp_path, pcap(packets))
    assert sum(len(block) for block in capture.blocks()) == 600


def rtu(body: bytes) -> bytes:
    return body + crc_bytes(body)


@pytest.mark.parametrize("cut", [0, 1, 3])
def test_gateways_carry_rtu_and_ascii_on_any_port_among_other_traffic(tmp_path: Path, cut: int) -> None:
    request, answer = rtu(b"\x11\x03\x00\x6b\x00\x02"), rtu(b"\x11\x03\x04\x00\x01\x00\x02")
    gateway = Talk(server=("10.0.0.7", 4001)).begin()
    ascii_line = Talk(server=("10.0.0.6", 4002), t_ns=10**9).begin()
    web = Talk(server=("10.0.0.5", 443), t_ns=2 * 10**9).begin()
    for number in range(6):
        gateway.ask(request)
        for part in (answer[:cut], answer[cut:]):
            if part:
                gateway.answer(part)
        ascii_line.ask(b":1103006B00027F\r\n").answer(b":1103040001000213D2\r\n")
        web.ask(b"\x16\x03\x01\x02\x00" + bytes(100)).answer(b"\x16\x03\x03" + bytes([number]) * 800)
    capture = opened(tmp_path, pcap(sorted(gateway.packets + ascii_line.packets + web.packets)))
    by_name = {name: int(key.split()[1]) for key, name in names(capture).items()}
    assert sorted(by_name) == ["10.0.0.1 > 10.0.0.6:4002", "10.0.0.1 > 10.0.0.7:4001"]
    octets = b"".join(data for _, data in said(capture, by_name["10.0.0.1 > 10.0.0.7:4001"]))
    assert octets == (request + answer) * 6
    assert "10.0.0.5:443" in capture.notices[0]


def test_without_modbus_the_file_is_refused_with_what_is_in_it(tmp_path: Path) -> None:
    one, two = Talk(server=("10.0.0.5", 80)).begin(), Talk(server=("10.0.0.5", 443)).begin()
    one.ask(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n").answer(b"HTTP/1.1 200 OK\r\n\r\n" + b"x" * 900)
    two.ask(b"\x16\x03\x01" + bytes(300)).answer(b"\x16\x03\x03" + bytes(900))
    for content, expected in (
        (pcap(one.packets + two.packets), "no Modbus in its 2 TCP connections: 10.0.0.1 > 10.0.0.5:443"),
        (pcap(one.packets), "no Modbus in its 1 TCP connection"),
        (pcap([(0, bytes(60))], 105), "link type 105 (IEEE 802.11)"),
        (pcap([]), "no packets"),
    ):
        with pytest.raises(CaptureError) as caught:
            opened(tmp_path, content)
        assert expected in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("link", [147, 155, 162])
def test_user_link_types_are_bytes_of_a_line(tmp_path: Path, link: int) -> None:
    frame = rtu(b"\x11\x03\x00\x6b\x00\x02")
    capture = opened(tmp_path, pcap([(5000, frame), (9000, frame)], link))
    assert [(chunk.t_ns, chunk.data) for chunk in capture.chunks()] == [(5000, frame), (9000, frame)]


def test_rtac_serial(tmp_path: Path) -> None:
    frame = rtu(b"\x11\x03\x00\x6b\x00\x02")
    packets = [
        (t * 1000, struct.pack(">IIBBH", 0, t, event, 0, 0) + octets)
        for t, event, octets in ((1, 1, frame), (2, 2, b"\x11\x03"), (3, 8, b"\x04"), (4, 0, b""), (5, 5, b""))
    ]
    capture = opened(tmp_path, pcap(packets, 250))
    assert list(capture.chunks()) == [
        Chunk(1000, frame, mark=Mark.TX),
        Chunk(2000, b"\x11\x03", mark=Mark.RX),
        Chunk(3000, b"\x04", errors=(0,)),
    ]
    assert "lost" in capture.damage[0].what


def test_upper_pdus_by_their_dissector(tmp_path: Path) -> None:
    def tagged(name: bytes, octets: bytes) -> bytes:
        return struct.pack(f">HH{len(name)}sI", 12, len(name), name, 0) + octets

    frame = rtu(b"\x11\x03\x00\x6b\x00\x02")
    flags = [pcapng_option(2, struct.pack("<I", way)) + bytes(4) for way in (2, 1, 0)]
    packets = [
        (0, 1000, tagged(b"mbrtu\0\0\0", frame), flags[0]),
        (0, 2000, tagged(b"mbrtu\0\0\0", frame), flags[1]),
        (1, 3000, tagged(b"mbtcp\0\0\0", read_request(1)), flags[2]),
        (0, 4000, tagged(b"http", b"GET /"), flags[2]),
    ]
    capture = opened(tmp_path, pcapng(packets, [252, 252]), "net.pcapng")
    assert list(capture.chunks()) == [
        Chunk(1000, frame, mark=Mark.TX),
        Chunk(2000, frame, mark=Mark.RX),
        Chunk(3000, read_request(1), 1),
    ]
    assert "1 packet" in capture.notices[0]


@pytest.mark.parametrize("suffix", [".pcapng", ".anything"])
def test_notes_errors_and_settings_come_back(tmp_path: Path, suffix: str) -> None:
    line = LineSettings(19200, 11, "E", 1.0, "irq", {"source": "a bus", "é": "ü"})
    chunks = [Chunk(-5, b"\x01", 3), Chunk(7, bytes(4), 0, Mark.RX, (0, 1, 3)), Chunk(8, b"\x02", 3, Mark.TX)]

    notes = [Note(-9, "lost", "port: gone"), Note(100, "comment", "as a person says: done")]
    file = io.BytesIO()
    write = formats()["pcapng"].write
    assert write is not None
    write(file, line, Capture.of(line, chunks).blocks(), True, notes=notes)
    again = opened(tmp_path, file.getvalue(), f"again{suffix}")
    assert again.line == line
    assert list(again.chunks()) == chunks
    assert again.notes() == notes


def test_a_damaged_file_gives_its_beginning(tmp_path: Path) -> None:
    talk = polled(Talk().begin())
    whole = pcap(talk.packets)
    capture = opened(tmp_path, whole[:-7])
    assert said(capture) == EXPECTED[:-1]
    assert "byte" in capture.damage[0].where
    ng = pcapng([(0, t, packet, b"") for t, packet in talk.packets], [1])
    capture = opened(tmp_path, ng[:-30])
    assert said(capture) == EXPECTED[:-1]
    assert "cut" in capture.damage[0].what


seeds = [
    pcap(polled(Talk().begin(), 2).end().packets),
    pcap(polled(Talk(("fd00::1", 1), ("fd00::2", 2), link=276).begin(), 2).packets, 276, ">", True),
    pcap([(1, rtu(b"\x11\x03\x00\x6b\x00\x02"))], 147),
    pcap([(1, struct.pack(">IIBBH", 0, 1, 1, 0, 0) + b"\x11\x03\x00\x6b")], 250),
    pcapng([(0, t, packet, b"") for t, packet in polled(Talk().begin(), 1).packets], [1], "<", 9),
]


@pytest.mark.parametrize("which", range(len(seeds)))
@settings(FILES, max_examples=75)
@given(data=st.data())
def test_damaged_bytes_never_crash_a_reader(tmp_path: Path, which: int, data: st.DataObject) -> None:
    content = bytearray(seeds[which])
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(content) - 1))
        if data.draw(st.booleans()):
            content[at : at + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=9))
        elif at < len(content):
            content[at] = data.draw(st.sampled_from([0, 1, 0x7F, 0x80, 0xFF]))
        if not content:
            return
    try:
        capture = opened(tmp_path, bytes(content), "any.pcapng")
        list(capture.blocks())
        capture.notes()
    except CaptureError as error:
        assert "\n" not in str(error)


@FILES
@given(st.lists(st.tuples(st.sampled_from([Mark.TX, Mark.RX]), st.binary(min_size=1, max_size=300)), max_size=8))
def test_random_bytes_are_no_modbus_tcp(reads: list[tuple[Mark, bytes]]) -> None:
    if all(len(octets) > 12 for _, octets in reads):
        assert kind_of(reads) != "tcp" or any(octets[2:4] == b"\0\0" for _, octets in reads)


def test_a_storm_of_connections_is_forgotten_in_time() -> None:
    """Memory is bounded whatever comes: half-open connections are given up, oldest first."""
    from captures.network.packets import Packets, segments_of

    class Counting:
        def run(self, half: Half, which: object) -> None: ...
        def piece(self, half: Half, i: int, begin: int, size: int) -> None: ...
        def late(self, half: Half, i: int, octets: bytes) -> None: ...
        def hole(self, half: Half, i: int, missing: int) -> None: ...
        def ended(self, half: Half) -> None: ...

    reassembly = Reassembly(Counting())
    base = framed(ip_packet(("10.0.0.1", 1), SERVER, 1, 0, SYN, b""))
    count = 15_000
    for round_ in range(5):
        rows = np.tile(np.frombuffer(base, np.uint8), (count, 1))
        rows[:, 26:30] = (np.arange(count) + round_ * count).astype(">u4").view(np.uint8).reshape(-1, 4)
        at = np.arange(count) * len(base)
        size = np.full(count, len(base))
        zeros = np.zeros(count, np.int64)
        packets = Packets(rows.ravel(), at, size, zeros, zeros, zeros, zeros)
        reassembly.feed(segments_of(packets, np.arange(count), 1), rows.tobytes())
    assert len(reassembly._halves) <= 1 << 16
    assert len(reassembly.groups) <= (1 << 14) + 1
    assert isinstance(reassembly.groups[-1], ConnectionGroup)


@pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
def test_wireshark_sees_the_same_bytes(tmp_path: Path) -> None:
    """Retransmissions, segments out of order and connections that end: the same ADUs as tshark puts together."""
    chance = random.Random(5)
    talk = Talk().begin()
    for number in range(60):
        talk.ask(read_request(number, count=20)).answer(read_answer(number, values=range(20)))
        if chance.random() < 0.2:
            talk.packets.append((talk.t_ns + 10, talk.packets[-1][1]))  # sent again
        if chance.random() < 0.2:
            (one, first), (two, second) = talk.packets[-2:]
            talk.packets[-2:] = [(one, second), (two, first)]
    path = tmp_path / "net.pcap"
    path.write_bytes(pcap(talk.packets))
    command = [TSHARK, "-r", str(path), "-Y", "mbtcp", "-T", "json", "-e", "mbtcp.trans_id"]
    seen = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)  # type: ignore[arg-type]
    ids = [int(one) for packet in seen for one in packet["_source"]["layers"]["mbtcp.trans_id"]]
    ours = [int.from_bytes(chunk.data[:2], "big") for chunk in captures.open(path).chunks()]
    assert sorted(ours) == sorted(number for number in range(60) for _ in (0, 1))
    assert set(ids) == set(ours)
    times = [chunk.t_ns for chunk in captures.open(path).chunks()]
    assert all(one <= two for one, two in pairwise(times))


def test_flags_of_the_end_close_a_connection(tmp_path: Path) -> None:
    talk = polled(Talk().begin(), 1)
    talk.put(True, b"", FIN | ACK)
    again = polled(Talk(t_ns=talk.t_ns + 10**9, seqs=[77, 88]).begin(), 1)  # the same ends, other numbers
    capture = opened(tmp_path, pcap(talk.packets + again.packets))
    assert said(capture) == EXPECTED[:2] * 2
    assert mbap(1, 1, b"\x03")[:6] == b"\0\1\0\0\0\2"
