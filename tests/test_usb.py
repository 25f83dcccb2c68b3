"""USB traffic of serial adapters, as usbmon and USBPcap record it: what the adapters' lines carried."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import refused

import captures
from analyzer.paste import judge
from captures.chunks import Mark
from dissectors.crc import crc_bytes


def with_crc(body: bytes) -> bytes:
    return body + crc_bytes(body)


ASK, ANSWER = with_crc(bytes.fromhex("010300100002")), with_crc(bytes.fromhex("01030400070009"))
LONG = with_crc(bytes((17, 3, 120)) + bytes(range(120)))
TALK = [(Mark.TX, ASK), (Mark.RX, ANSWER)] * 4 + [(Mark.TX, ASK), (Mark.RX, LONG)]
OUT, IN, INTERRUPT_IN = 0x02, 0x81, 0x83
BULK, CONTROL, INTERRUPT = 3, 2, 1
Packet = tuple[float, int, int, int, bytes, bytes]  # s, device, endpoint, transfer, setup, data


def usbmon(packet: Packet, head: int) -> bytes:
    """A submitted packet that goes out, or a completed one that came in (Documentation/usb/usbmon.rst)."""
    t_s, device, endpoint, transfer, setup, data = packet
    event = b"C" if endpoint & 0x80 else b"S"
    fixed = struct.pack(
        "<QcBBBHBBqiiII8s", 7, event, transfer, endpoint, device, 3, 0 if setup else 0x2D, 0, int(t_s),
        int(t_s % 1 * 1e6), 0, len(data), len(data), setup,
    )  # fmt: skip
    return fixed.ljust(head, b"\x00") + data


def usbpcap(packet: Packet) -> bytes:
    _, device, endpoint, transfer, setup, data = packet
    inward, rest = bool(endpoint & 0x80), setup + data
    stage = b"\x00" if transfer == CONTROL else b""
    return (
        struct.pack("<HQIHBHHBBI", 27 + len(stage), 9, 0, 9, inward, 3, device, endpoint, transfer, len(rest))
        + stage
        + rest
    )


WRITTEN: dict[int, Callable[[Packet], bytes]] = {
    189: lambda packet: usbmon(packet, 48),
    220: lambda packet: usbmon(packet, 64),
    249: usbpcap,
}


def pcap(packets: Iterable[Packet], link: int) -> bytes:
    out = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 1 << 16, link)
    for packet in packets:
        octets = WRITTEN[link](packet)
        out += struct.pack("<IIII", int(packet[0]), round(packet[0] % 1 * 1e6), len(octets), len(octets)) + octets
    return out


def talk(device: int, wrap: Callable[[bytes], bytes] = bytes) -> list[Packet]:
    """The same talk over a device; `wrap` makes of bytes the packets that come in."""
    return [
        (100 + i / 10, device, *((OUT, BULK, b"", data) if mark == Mark.TX else (IN, BULK, b"", wrap(data))))
        for i, (mark, data) in enumerate(TALK)
    ]


def with_status(data: bytes, size: int = 64) -> bytes:
    """As FTDI sends it: two bytes of status before each packet (AN232B-04)."""
    step = size - 2
    return b"".join(b"\x01\x60" + data[at : at + step] for at in range(0, max(len(data), 1), step))


def carried(path: Path) -> list[tuple[Mark, bytes]]:
    said: list[tuple[Mark, bytes]] = []
    for chunk in captures.open(path, judge=judge).chunks():
        whole = said and said[-1][0] == chunk.mark
        said[-1:] = [(chunk.mark, said[-1][1] + chunk.data)] if whole else [*said[-1:], (chunk.mark, chunk.data)]
    return said


@pytest.mark.parametrize("link", WRITTEN)
def test_an_adapter_is_a_line_with_marks_and_the_speed_it_was_set_to(tmp_path: Path, link: int) -> None:
    coding = struct.pack("<IBBB", 19200, 0, 2, 8)
    setup: Packet = (99.0, 5, 0x00, CONTROL, bytes.fromhex("2120000000000700"), coding)
    status: Packet = (99.5, 5, INTERRUPT_IN, INTERRUPT, b"", bytes.fromhex("a120000000000200"))
    path = tmp_path / "usb.pcap"
    path.write_bytes(pcap([setup, status, *talk(5)], link))
    capture = captures.open(path, judge=judge)
    assert capture.line.baud == 19200
    assert [(chunk.mark, chunk.data) for chunk in capture.chunks()] == TALK
    assert [chunk.t_ns for chunk in capture.chunks()][1] == 100_100_000_000


@pytest.mark.parametrize("link", WRITTEN)
@pytest.mark.parametrize("size", [64, 512])
def test_status_of_ftdi_is_no_byte_of_the_line(tmp_path: Path, link: int, size: int) -> None:
    idle: list[Packet] = [(100.016 + i / 10, 5, IN, BULK, b"", b"\x01\x60") for i in range(8)]
    talked = talk(5, lambda data: with_status(data, size))
    path = tmp_path / "usb.pcap"
    path.write_bytes(pcap(sorted([*talked, *idle], key=lambda packet: packet[0]), link))
    assert carried(path) == TALK


@pytest.mark.parametrize("size", [64, 512])
def test_a_line_that_was_long_idle_is_read(tmp_path: Path, size: int) -> None:
    """Status comes every 16 ms: it is all that the beginning of such a capture has."""
    idle: list[Packet] = [(90 + i / 60, 5, IN, BULK, b"", b"\x01\x60") for i in range(1000)]
    talked = talk(5, lambda data: with_status(data, size))
    path = tmp_path / "usb.pcap"
    path.write_bytes(pcap(sorted([*talked, *idle], key=lambda packet: packet[0]), 249))
    assert carried(path) == TALK


def test_other_devices_are_no_lines(tmp_path: Path) -> None:
    disk: list[Packet] = [(100.05 + i / 10, 9, (OUT, IN)[i % 2], BULK, b"", b"USBC" + bytes(27)) for i in range(8)]
    path = tmp_path / "usb.pcap"
    path.write_bytes(pcap(sorted([*talk(5), *disk], key=lambda packet: packet[0]), 220))
    assert {(chunk.mark, chunk.data) for chunk in captures.open(path, judge=judge).chunks()} == set(TALK)


def test_two_adapters_are_two_ports(tmp_path: Path) -> None:
    path = tmp_path / "usb.pcap"
    path.write_bytes(pcap([*talk(5), *talk(6)], 249))
    assert [chunk.port for chunk in captures.open(path, judge=judge).chunks()] == [0] * len(TALK) + [1] * len(TALK)


def test_a_mouse_alone_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "usb.pcap"
    path.write_bytes(pcap([(1.0, 2, INTERRUPT_IN, INTERRUPT, b"", bytes(4))] * 5, 189))
    assert "USB (usbmon)" in refused(capsys, "report", path)


def text_line(packet: Packet) -> str:
    t_s, device, endpoint, transfer, setup, data = packet
    way = "i" if endpoint & 0x80 else "o"
    words = " ".join(data[at : at + 4].hex() for at in range(0, min(len(data), 32), 4))
    request = f"s {setup[0]:02x} {setup[1]:02x} 0000 0000 {len(data):04x}" if setup else "-115" if way == "o" else "0"
    address = f"{'CB'[transfer == BULK]}{way}:3:{device:03}:{endpoint & 15}"
    return f"ffff8d0f4a1c3cc0 {round(t_s * 1e6)} {'SC'[way == 'i']} {address} {request} {len(data)} = {words}\n"


def test_usbmon_s_text_is_read_and_says_what_the_kernel_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    coding: Packet = (99.0, 5, 0x00, CONTROL, bytes.fromhex("2120000000000700"), struct.pack("<IBBB", 9600, 0, 0, 8))
    path = tmp_path / "usbmon.txt"
    path.write_text("".join(map(text_line, [coding, *talk(5)])))
    capture = captures.open(path, judge=judge)
    assert capture.line.baud == 9600
    assert [(chunk.mark, chunk.data) for chunk in capture.chunks()] == [(mark, data[:32]) for mark, data in TALK]
    assert any("1 packets say that bytes of the line were lost" in damage.what for damage in capture.damage)
    path.write_text("ffff8d0f4a1c3cc0 27 S Bo:1:007:2 -115 8 = 0103006\n")
    assert refused(capsys, "report", path)


@given(octets=st.binary(max_size=200), link=st.sampled_from([*WRITTEN]), cut=st.integers(0, 400))
def test_any_usb_packet_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, octets, link, cut) -> None:
    path = tmp_path_factory.mktemp("usb") / "usb.pcap"
    head = pcap([], link)
    some = head + struct.pack("<IIII", 1, 0, len(octets), len(octets)) + octets + pcap(talk(5), link)[len(head) :]
    path.write_bytes(some[: max(cut, 24)])
    try:
        assert sum(len(chunk.data) for chunk in captures.open(path, judge=judge).chunks()) < 1000
    except captures.CaptureError as error:
        assert "\n" not in str(error)
