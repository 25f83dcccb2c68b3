"""Modbus over UDP in network captures: each datagram as it came, chosen by what it carries."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from packets import End, Packet, Talk, framed, names, pcap, read_answer, read_request, udp_packet

import analyzer.paste
import captures
from captures import Capture, CaptureError, Mark
from captures.text.judging import ByteJudge, no_judge
from dissectors.crc import crc_bytes

CLIENT, SERVER = ("10.0.0.1", 50001), ("10.0.0.9", 502)
EXPECTED = [part for n in range(4) for part in ((Mark.TX, read_request(n)), (Mark.RX, read_answer(n)))]
TSHARK = shutil.which("tshark")


@dataclass
class Datagrams:
    client: End = CLIENT
    server: End = SERVER
    link: int = 1
    vlans: int = 0
    t_ns: int = 1_700_000_000_000_000_000
    packets: list[Packet] = field(default_factory=list)

    def put(self, from_client: bool, data: bytes) -> Datagrams:
        self.t_ns += 2_000_000
        ends = (self.client, self.server) if from_client else (self.server, self.client)
        self.packets.append((self.t_ns, framed(udp_packet(*ends, data), self.link, self.vlans)))
        return self

    def polled(self, count: int = 4) -> Datagrams:
        for number in range(count):
            self.put(True, read_request(number)).put(False, read_answer(number))
        return self


def opened(folder: Path, packets: list[Packet], link: int = 1, judge: ByteJudge = no_judge) -> Capture:
    path = folder / "net.pcap"
    path.write_bytes(pcap(packets, link))
    return captures.open(path, judge=judge)


def said(capture: Capture, port: int = 0) -> list[tuple[Mark, bytes]]:
    return [(chunk.mark, chunk.data) for chunk in capture.chunks() if chunk.port == port]


@pytest.mark.parametrize(("link", "vlans"), [(1, 0), (1, 2), (113, 0), (276, 0), (101, 0)])
@pytest.mark.parametrize("hosts", [("10.0.0.1", "10.0.0.9"), ("fd00::1", "fd00::9")])
def test_datagrams_are_read_as_they_came(tmp_path: Path, link: int, vlans: int, hosts: tuple[str, str]) -> None:
    talk = Datagrams((hosts[0], 40001), (hosts[1], 502), link, vlans).polled()
    capture = opened(tmp_path, talk.packets, link)
    assert said(capture) == EXPECTED
    assert [chunk.t_ns for chunk in capture.chunks()] == [t_ns for t_ns, _ in talk.packets]
    server = f"[{hosts[1]}]" if ":" in hosts[1] else hosts[1]
    assert names(capture) == {"port 0": f"{hosts[0]} > {server}:502 (UDP)"}
    assert not capture.damage
    assert not capture.notices


def test_many_datagrams_at_once(tmp_path: Path) -> None:
    capture = opened(tmp_path, Datagrams().polled(2000).packets)
    assert sorted(len(chunk.data) for chunk in capture.chunks()) == [12] * 2000 + [13] * 2000
    assert [chunk.t_ns for chunk in capture.chunks()] == sorted(chunk.t_ns for chunk in capture.chunks())


def test_a_port_of_the_clients_for_each_request_is_still_one_line(tmp_path: Path) -> None:
    packets: list[Packet] = []
    for number in range(4):
        talk = Datagrams((CLIENT[0], 50000 + number), t_ns=1_700_000_000_000_000_000 + number * 10**8)
        packets += talk.put(True, read_request(number)).put(False, read_answer(number)).packets
    assert said(opened(tmp_path, packets)) == EXPECTED


def test_the_same_ends_over_tcp_are_another_line(tmp_path: Path) -> None:
    tcp, udp = Talk().begin(), Datagrams()
    for number in range(4):
        tcp.ask(read_request(number)).answer(read_answer(number))
        udp.put(True, read_request(number)).put(False, read_answer(number))
    capture = opened(tmp_path, sorted(tcp.packets + udp.packets, key=lambda packet: packet[0]))
    assert sorted(names(capture).values()) == ["10.0.0.1 > 10.0.0.9:502", "10.0.0.1 > 10.0.0.9:502 (UDP)"]
    assert said(capture, 0) == said(capture, 1) == EXPECTED


def test_a_datagram_that_was_cut_takes_nothing_of_the_next(tmp_path: Path) -> None:
    talk = Datagrams().polled(3)
    talk.put(True, read_request(3)[:7]).put(True, read_request(3)).put(False, read_answer(3))
    assert said(opened(tmp_path, talk.packets)) == [*EXPECTED[:6], (Mark.TX, read_request(3)[:7]), *EXPECTED[6:]]


def question(number: int) -> bytes:
    """A question of DNS, whose answer begins as it does."""
    return struct.pack(">HHHHHH", 0x0103 + number, 0x0100, 1, 0, 0, 0) + b"\x03plc\x05local\x00\x00\x01\x00\x01"


def test_other_datagrams_are_left_out(tmp_path: Path) -> None:
    dns = Datagrams(server=("10.0.0.53", 53))
    for number in range(5):
        dns.put(True, question(number)).put(False, question(number) + bytes(16))
    talk = Talk().begin()
    for number in range(4):
        talk.ask(read_request(number)).answer(read_answer(number))
    capture = opened(tmp_path, sorted(dns.packets + talk.packets, key=lambda packet: packet[0]))
    assert said(capture) == EXPECTED
    assert names(capture) == {"port 0": "10.0.0.1 > 10.0.0.9:502"}
    with pytest.raises(CaptureError, match=r"no Modbus over UDP: 10 packets of UDP without Modbus"):
        opened(tmp_path, dns.packets)


def test_rtu_in_datagrams_is_told_by_its_check_values(tmp_path: Path) -> None:
    gateway = Datagrams(server=("10.0.0.7", 8899))
    frames = [body + crc_bytes(body) for body in map(bytes.fromhex, ("110300000002", "11030400070009", "118302"))]
    for _ in range(4):
        gateway.put(True, frames[0]).put(False, frames[1]).put(True, frames[0]).put(False, frames[2])
    dns = Datagrams(server=("10.0.0.53", 53)).put(True, question(1)).put(False, question(1) + bytes(16))
    capture = opened(tmp_path, gateway.packets + dns.packets, judge=analyzer.paste.judge)
    assert [data for _, data in said(capture)] == [frames[i] for i in (0, 1, 0, 2)] * 4
    assert names(capture) == {"port 0": "10.0.0.1 > 10.0.0.7:8899 (UDP)"}
    with pytest.raises(CaptureError, match="UDP without Modbus"):
        opened(tmp_path, dns.packets, judge=analyzer.paste.judge)


@pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
def test_wireshark_sees_the_same_datagrams(tmp_path: Path) -> None:
    path = tmp_path / "net.pcap"
    path.write_bytes(pcap(Datagrams().polled(20).packets))
    command = [TSHARK, "-r", str(path), "-Y", "mbudp", "-T", "json", "-e", "udp.payload"]
    seen = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)  # type: ignore[arg-type]
    theirs = [bytes.fromhex(packet["_source"]["layers"]["udp.payload"][0].replace(":", "")) for packet in seen]
    assert theirs == [chunk.data for chunk in captures.open(path).chunks()]
    assert len(theirs) == 40
