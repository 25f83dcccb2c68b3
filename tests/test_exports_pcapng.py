"""pcapng: blocks that a plain reader and Wireshark take, with direction, time and port of every frame."""

import json
import shutil
import struct
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from buses import LINE, adu, spaced
from running import ran, spawned

import captures
from captures import Chunk, samples
from captures.network.blocks import READS

READ, VALUES = adu("1103006b0003"), adu("110306ae4156524340")
WRITE = adu("110600010003")
REFUSED = adu("118302")
PAIRS = [READ, VALUES, WRITE, WRITE, READ, REFUSED]


@dataclass
class Packet:
    """A packet block: the dissector named for it, its bytes, ports (source, destination) and options."""

    interface: int
    t_ns: int
    dissector: bytes
    ports: tuple[int, int]
    data: bytes
    whole: int
    options: dict[int, list[bytes]] = field(default_factory=dict)

    @property
    def flags(self) -> int:
        return int.from_bytes(self.options[2][0], "little")


def options_of(body: bytes) -> dict[int, list[bytes]]:
    found: dict[int, list[bytes]] = {}
    while body:
        code, size = struct.unpack_from("<HH", body)
        if code == 0:
            assert len(body) == 4
            break
        found.setdefault(code, []).append(body[4 : 4 + size])
        assert not any(body[4 + size : 4 + size + -size % 4])
        body = body[4 + size + -size % 4 :]
    return found


def read(path: Path) -> tuple[list[dict[int, list[bytes]]], list[Packet]]:
    """Options of the interfaces, and the packets; every length is checked."""
    data = path.read_bytes()
    interfaces, packets = [], []
    while data:
        kind, size = struct.unpack_from("<II", data)
        assert size % 4 == 0
        assert data[size - 4 : size] == data[4:8]
        body, data = data[8 : size - 4], data[size:]
        if kind == 0x0A0D0D0A:
            assert body[:8] == b"\x4d\x3c\x2b\x1a\1\0\0\0"
        elif kind == 1:
            assert struct.unpack_from("<HHI", body) == (252, 0, 0)
            interfaces.append(options_of(body[8:]))
        elif kind != READS:
            assert kind == 6
            packets.append(packet(body))
    return interfaces, packets


def packet(body: bytes) -> Packet:
    interface, high, low, size, whole = struct.unpack_from("<5I", body)
    pdu, rest = body[20 : 20 + size], body[20 + size + -size % 4 :]
    tags: dict[int, bytes] = {}
    at = 0
    while True:
        tag, length = struct.unpack_from(">HH", pdu, at)
        at += 4 + length
        if tag == 0:
            break
        tags[tag] = pdu[at - length : at]
    ports = tuple(struct.unpack(">I", tags[tag])[0] for tag in (25, 26))
    name = tags[12].rstrip(b"\0")
    return Packet(interface, high << 32 | low, name, ports, pdu[at:], whole - at, options_of(rest))


def exported(capsys, tmp_path, chunks, *options) -> tuple[list[dict[int, list[bytes]]], list[Packet]]:
    bus, out = tmp_path / "bus.jsonl", tmp_path / "bus.pcapng"
    captures.write(bus, chunks, line=LINE)
    assert ran(capsys, "export", bus, "-o", out, *options).status == 0
    return read(out)


def dissected(path: Path, *arguments: str) -> list[list[str]]:
    if shutil.which("tshark") is None:
        pytest.skip("tshark is not installed: nothing reads the file but this test's own reader")
    done = subprocess.run(
        ["tshark", "-r", path, "-T", "fields", *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


def test_every_frame_with_its_bytes_time_and_direction(capsys, tmp_path):
    (interface,), packets = exported(capsys, tmp_path, spaced(PAIRS))
    assert interface[9] == [b"\x09"]
    assert interface[8] == [struct.pack("<Q", LINE.baud)]
    assert [p.data for p in packets] == PAIRS
    assert {p.dissector for p in packets} == {b"mbrtu"}
    assert [p.flags for p in packets] == [2, 1] * 3
    assert [p.ports for p in packets] == [(1502, 502), (502, 1502)] * 3
    assert [p.t_ns for p in packets] == [chunk.t_ns for chunk in spaced(PAIRS)]
    assert not any(b"evidence in bits" in comment for p in packets for comment in p.options.get(1, []))


def test_the_same_rows_as_jsonl(capsys, tmp_path):
    bus, out = samples.path("troubled.jsonl"), tmp_path / "bus.pcapng"
    assert ran(capsys, "export", bus, "--noise", "-o", out).status == 0
    lines = [json.loads(line) for line in ran(capsys, "export", bus, "--noise").out.splitlines()]
    _, packets = read(out)
    assert [(p.data.hex(), p.t_ns) for p in packets] == [(line["hex"], line["t_end_ns"]) for line in lines]
    for found, line in zip(packets, lines, strict=True):
        noise = line.get("kind") == "noise"
        assert found.dissector == (b"data" if noise else b"mbrtu")
        assert found.flags & 3 == (0 if noise else {"request": 2, "response": 1}[line["direction"]])
        assert bool(found.flags & 1 << 24) == (line.get("crc_ok") is False)


def test_frames_of_ascii_mode_are_bytes_with_a_direction(capsys, tmp_path):
    frames = [b":1103006B00037E\r\n", b":110306AE4156524340CC\r\n"]
    bus, out = tmp_path / "bus.jsonl", tmp_path / "bus.pcapng"
    captures.write(bus, spaced(frames, 100_000_000), line=LINE)
    assert ran(capsys, "export", bus, "-o", out).status == 0
    _, packets = read(out)
    assert [(p.dissector, p.data, p.flags & 3) for p in packets] == [(b"data", frames[0], 2), (b"data", frames[1], 1)]


def test_an_interface_a_port(capsys, tmp_path):
    requests = spaced([READ, WRITE] * 3, 50_000_000)
    answers = [Chunk(c.t_ns + 20_000_000, c.data, port=1) for c in spaced([VALUES, WRITE] * 3, 50_000_000)]
    chunks = sorted([*requests, *answers], key=lambda chunk: chunk.t_ns)
    interfaces, packets = exported(capsys, tmp_path, chunks)
    assert [options[2] for options in interfaces] == [[b"port 0"], [b"port 1"]]
    assert sorted((p.interface, p.data) for p in packets) == sorted((c.port, c.data) for c in chunks)


def test_noise_beyond_what_wireshark_takes_is_cut_and_says_so(capsys, tmp_path):
    flood = Chunk(10**9, b"\xff" * 300_000)
    _, packets = exported(capsys, tmp_path, [flood, *spaced(PAIRS)], "--noise")
    assert sum(p.whole for p in packets) == 300_000 + sum(map(len, PAIRS))
    assert max(len(p.data) for p in packets) <= 1 << 17


def test_why_a_boundary_is_there_is_a_comment(capsys, tmp_path):
    _, packets = exported(capsys, tmp_path, spaced(PAIRS), "--explain")
    assert all(p.options[1][-1].startswith(b"evidence in bits: length ") for p in packets)


def test_a_pipe_gets_the_same_bytes(capsys, tmp_path):
    bus, out = samples.path("troubled.jsonl"), tmp_path / "bus.pcapng"
    assert ran(capsys, "export", bus, "-o", out).status == 0
    assert spawned("export", bus, "--format", "pcapng", "-o", "-").raw == out.read_bytes()


def test_wireshark_dissects_without_any_setting(capsys, tmp_path):
    exported(capsys, tmp_path, spaced(PAIRS))
    fields = ("frame.p2p_dir", "mbrtu.unit_id", "modbus.func_code", "modbus.regnum16", "modbus.exception_code")
    rows = dissected(tmp_path / "bus.pcapng", *(part for name in fields for part in ("-e", name)))
    assert rows == [
        ["0", "17", "3", "", ""],
        ["1", "17", "3", "107,108,109", ""],
        ["0", "17", "6", "", ""],
        ["1", "17", "6", "", ""],
        ["0", "17", "3", "", ""],
        ["1", "17", "3", "", "2"],
    ]


def test_wireshark_tells_an_echo_from_its_request_by_port(capsys, tmp_path):
    exported(capsys, tmp_path, spaced(PAIRS))
    rows = dissected(tmp_path / "bus.pcapng", "-o", "mbrtu.tcp.port:502", "-e", "_ws.col.Info")
    assert [row[0].split(":")[0].strip() for row in rows] == ["Query", "Response"] * 3


def test_wireshark_reads_every_row_of_a_bad_line(capsys, tmp_path):
    out = tmp_path / "bus.pcapng"
    assert ran(capsys, "export", samples.path("troubled.jsonl"), "--noise", "--explain", "-o", out).status == 0
    _, packets = read(out)
    rows = dissected(out, "-e", "frame.time_epoch", "-e", "frame.comment", "-e", "data.data", "-e", "frame.len")
    assert len(rows) == len(packets)
    for (time, comment, data, _), found in zip(rows, packets, strict=True):
        assert int(time.replace(".", "")) == found.t_ns
        assert comment == b",".join(found.options.get(1, [])).decode()
        assert found.dissector == b"mbrtu" or data == found.data.hex()
