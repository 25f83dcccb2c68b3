"""Dumps of network packets in a text: what they carry is read, their headers are not."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest

from analyzer.cli import main
from analyzer.paste import read
from captures.text.dumps import payload_of
from dissectors.crc import crc_bytes

ASK = bytes.fromhex("000900000006 1103 0064 0002")
REPLY = bytes.fromhex("000900000007 1103 04 00FA012C")
CLIENT, SERVER = bytes((10, 1, 0, 7)), bytes((10, 1, 0, 9))
ETHERNET = bytes.fromhex("02000000000a 02000000000b 0800")
TAGGED = ETHERNET[:12] + bytes.fromhex("8100 0005 0800")


def ip(body: bytes, protocol: int, *, back: bool = False) -> bytes:
    ends = SERVER + CLIENT if back else CLIENT + SERVER
    return (
        bytes.fromhex("4500")
        + (20 + len(body)).to_bytes(2, "big")
        + bytes((0, 1, 64, 0, 64, protocol, 0, 0))
        + ends
        + body
    )


def tcp(data: bytes, *, back: bool = False, port: int = 502) -> bytes:
    ports = (50312).to_bytes(2, "big"), port.to_bytes(2, "big")
    head = b"".join(ports[::-1] if back else ports) + bytes(8) + bytes.fromhex("5018 01F6 0000 0000")
    return ip(head + data, 6, back=back)


def udp(data: bytes) -> bytes:
    head = (50312).to_bytes(2, "big") + (502).to_bytes(2, "big") + (8 + len(data)).to_bytes(2, "big") + bytes(2)
    return ip(head + data, 17)


def words(packet: bytes) -> str:
    """As `tcpdump -X` writes it."""
    rows = (packet[at : at + 16] for at in range(0, len(packet), 16))
    return "".join(f"\t0x{16 * i:04x}:  {row.hex(' ', -2):<39}  {'.' * len(row)}\n" for i, row in enumerate(rows))


def pairs(packet: bytes) -> str:
    """As `tshark -x` writes it."""
    rows = (packet[at : at + 16] for at in range(0, len(packet), 16))
    return "".join(f"{16 * i:04x}  {row.hex(' '):<47}   {'.' * len(row)}\n" for i, row in enumerate(rows)) + "\n"


def test_what_tcpdump_shows_is_read_with_its_times(tmp_path: Path) -> None:
    log, out = tmp_path / "dump.txt", tmp_path / "frames.jsonl"
    text = ""
    for millis, packet in ((100, tcp(ASK)), (120, tcp(b"", back=True)), (180, tcp(REPLY, back=True))):
        text += (
            f"10:15:31.{millis}000 IP 10.1.0.7.50312 > 10.1.0.9.502: Flags [P.], length {len(packet) - 40}\n"
            + words(packet)
        )
    log.write_text(text, encoding="utf-8")
    assert main(["export", str(log), "--format", "jsonl", "-o", str(out)]) == 0
    rows = [json.loads(line) for line in out.open(encoding="utf-8")]
    assert [(row["direction"], row["hex"]) for row in rows] == [("request", ASK.hex()), ("response", REPLY.hex())]
    assert rows[1]["t_start_ns"] - rows[0]["t_start_ns"] == 80_000_000


@pytest.mark.parametrize("packet", [tcp(ASK), udp(ASK), ETHERNET + tcp(ASK), TAGGED + tcp(ASK)])
def test_headers_of_a_packet_are_no_bytes_of_the_line(packet: bytes) -> None:
    assert [frame.adu.data for frame in read(pairs(packet)).frames()] == [ASK]


def test_what_fills_a_short_frame_is_no_byte_of_the_line() -> None:
    packet = (ETHERNET + udp(ASK)).ljust(60, b"\0")
    assert payload_of(packet) == (ASK, 1)


def test_a_row_of_one_byte_is_the_end_of_a_packet() -> None:
    refusal = bytes.fromhex("000900000003 1183 02")  # behind headers of 40 bytes its last stands alone
    bare = "".join(
        line[:49].rstrip() + "\n" for line in (words(tcp(ASK)) + words(tcp(refusal, back=True))).splitlines()
    )
    times = iter(("10:15:31.100000 IP client > server: length 12", "10:15:31.120000 IP server > client: length 9"))
    text = "".join(f"{next(times)}\n{row}" if "0x0000" in row else row for row in bare.splitlines(keepends=True))
    assert [frame.adu.data for frame in read(text).frames()] == [ASK, refusal]


def test_rtu_over_tcp_is_read_from_a_dump() -> None:
    frames = [data + crc_bytes(data) for data in (ASK[6:], REPLY[6:])]
    text = pairs(ETHERNET + tcp(frames[0], port=4001)) + pairs(ETHERNET + tcp(frames[1], back=True, port=4001))
    assert [frame.adu.data for frame in read(text).frames()] == frames


def test_bytes_whose_length_no_header_tells_are_no_packet() -> None:
    rng = random.Random(20)
    assert all(payload_of(rng.randbytes(rng.randrange(90))) is None for _ in range(20_000))
    whole = tcp(ASK)
    assert all(payload_of(whole[:length]) is None for length in range(len(whole)))
    assert payload_of(whole + b"\0") is None
