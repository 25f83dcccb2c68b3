"""Logic analysers: edges to bytes whatever the line's settings, the formats that hold edges, tables of analyzers."""

from __future__ import annotations

import io
import itertools
import random
import re
import shutil
import struct
import subprocess
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from waves import (
    binary_export,
    combined_table,
    edge_table,
    edges_of,
    frames_on_line,
    random_frames,
    sample_table,
    sampled,
    scope_table,
    sr,
    vcd,
    vector_dump,
)

import captures
from captures import Capture, CaptureError
from captures.edges.inference import GivenSettings, settings_of
from captures.edges.uart import Uart, UartSettings
from captures.formats import formats

FILES = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
FORMS = ((8, "N", 1), (8, "E", 1), (8, "O", 1), (8, "N", 2), (7, "E", 1), (7, "O", 1), (8, "S", 1))
SIGROK = shutil.which("sigrok-cli")


def whole(capture: Capture, port: int = 0) -> bytes:
    return b"".join(chunk.data for chunk in capture.chunks() if chunk.port == port)


def line(
    chance: random.Random,
    baud: float,
    form: tuple[int, str, float],
    *,
    gap: float = 0.0,
    off: float = 0.0,
    count: int = 30,
) -> tuple[list[int], bytes]:
    """Edges of random frames, and their bytes."""
    data_bits, parity, stop = form
    frames = random_frames(chance, count, ascii_only=data_bits == 7)
    char_bits = 1 + data_bits + (parity != "N") + stop
    pause = round(4 * char_bits * 1e9 / baud)
    characters = frames_on_line(frames, baud * (1 + off), char_bits, gap, pause)
    return edges_of(characters, baud, data_bits, parity, off), b"".join(frames)


@pytest.mark.parametrize("baud", [300, 1200, 9600, 19200, 38400, 115200, 460800])
@pytest.mark.parametrize("form", FORMS)
def test_settings_are_found_from_the_edges(baud: int, form: tuple[int, str, float]) -> None:
    """With gaps between characters or none, a clock that is off, either polarity, and eight samples a bit."""
    for gap, off, inverted in itertools.product((0, 0.4, 1.7), (0, 0.02, -0.02), (False, True)):
        edges, sent = line(random.Random(f"{baud}{form}{gap}{off}"), baud, form, gap=gap, off=off)
        step = 1e9 / (8 * baud)
        times = (np.ceil(np.array(edges) / step) * step).astype(np.int64)
        level = int(not inverted)
        found = settings_of(times, level, GivenSettings())
        assert found is not None
        expected = UartSettings(baud, form[0], form[1], form[2], inverted)
        if gap:  # a gap may be a second stop bit
            expected = UartSettings(baud, form[0], form[1], found[0].stop_bits, inverted)
        assert found[0] == expected
        assert Uart(found[0], level).feed(times, None).value.tobytes() == sent


@FILES
@given(data=st.data(), form=st.sampled_from(FORMS), baud=st.sampled_from([9600, 115200]))
def test_edges_fed_in_pieces_give_the_same(data: st.DataObject, form: tuple[int, str, float], baud: int) -> None:
    chance = random.Random(data.draw(st.integers(0, 999)))
    edges, _ = line(chance, baud, form, count=6)
    times = np.array(edges)
    known = UartSettings(baud, form[0], form[1], form[2])
    at_once = Uart(known, 1, 0).feed(times, None)
    uart, parts, before = Uart(known, 1, 0), [], 0
    cuts = sorted(data.draw(st.lists(st.integers(0, int(times[-1])), max_size=8)))
    for until in cuts:
        last = int(np.searchsorted(times, until, "right"))
        parts.append(uart.feed(times[before:last], until))
        before = last
    parts.append(uart.feed(times[before:], None))
    for i, column in enumerate(at_once):
        assert np.concatenate([part[i] for part in parts]).tolist() == np.asarray(column).tolist()


def test_times_errors_and_measured_rates() -> None:
    baud, off = 19200, -0.015
    characters = frames_on_line([bytes(range(64))], baud * (1 + off), 11, 0.3)
    edges = np.array(edges_of(characters, baud, 8, "E", off, wrong=[3, 7], broken=[9]))
    found = Uart(UartSettings(baud, 8, "E", 1), 1).feed(edges, None)
    assert found.value.tolist() == list(range(64))
    assert np.flatnonzero(found.parity).tolist() == [3, 7]
    assert np.flatnonzero(found.framing).tolist() == [9]
    assert np.abs(found.start_ns - [start for start, _ in characters]).max() <= 1
    assert (found.end_ns - found.start_ns == round(11e9 / baud + 0.5)).all()
    measured = 1e9 * found.span_bits.sum() / found.span_ns.sum()
    assert abs(measured / baud - 1 - off) < 1e-4


def test_a_capture_that_begins_amid_a_character() -> None:
    edges, sent = line(random.Random(3), 9600, (8, "E", 1))
    for skip in range(1, 40):
        times = np.array(edges[skip:])
        level = int(skip % 2 == 0)
        found = settings_of(times, level, GivenSettings())
        assert found is not None
        got = Uart(found[0], level).feed(times, None).value.tobytes()
        assert got[-len(sent) + 40 :] == sent[-len(got) :][-len(sent) + 40 :]


def test_what_is_given_is_taken_as_it_is() -> None:
    edges, _ = line(random.Random(5), 9600, (8, "E", 1))
    found = settings_of(np.array(edges), 1, GivenSettings(baud=19200, parity="N", bits=8, stop=1))
    assert found is not None
    assert str(found[0]) == "19200 bit/s 8N1"
    found = settings_of(np.array(edges), 1, GivenSettings(parity="E"))
    assert found is not None
    assert str(found[0]) == "9600 bit/s 8E1"


@pytest.mark.parametrize(
    "edges",
    [
        [],
        [5],
        list(range(0, 10**6, 1000)),  # a clock
        [round(random.Random(1).uniform(0, 1e9) + i * 1e9) for i in range(50)],  # a driver's enable
        [0] * 400,
    ],
)
def test_other_signals_are_no_characters(edges: list[int]) -> None:
    assert settings_of(np.array(edges, np.int64), 1, GivenSettings()) is None


def opened(folder: Path, content: bytes, name: str, **given: object) -> Capture:
    path = folder / name
    path.write_bytes(content)
    return captures.open(path, **given)  # type: ignore[arg-type]


EDGES, SENT = line(random.Random(11), 19200, (8, "E", 1))
OTHER, ANSWERED = line(random.Random(12), 19200, (8, "E", 1))
SHORT, BRIEF = line(random.Random(13), 19200, (8, "E", 1), count=5)
ENABLE = [EDGES[0] - 50_000, EDGES[-1] + 50_000]


# Names alone: the files are made where a test needs them, not wherever this one is collected.
CONTENTS = ["logic1.csv", "logic2.csv", "ns.vcd", "one.sr", "parts.sr", "ps.vcd", "us.vcd", "vectors.vcd", "wide.sr"]
TABLES = [
    "DSView",
    "Logic 1, all channels in one number",
    "PulseView",
    "bare time",
    "decimal comma",
    "milliseconds",
    "quoted",
    "sigrok of old",
    "sigrok, CR LF",
    "sigrok-cli",
    "sigrok-cli, with times",
    "sigrok-cli, with times and names",
    "tabs",
]
COUNTED = ["Logic 1", "a scope's", "without a head"]


@cache
def contents(most: int | None = None) -> dict[str, bytes]:
    """Files of the same edges, or of so many of each signal."""
    signals = [EDGES[:most], ENABLE, OTHER[:most]]
    end = max(signal[-1] for signal in signals) + 10**7
    samples = sampled(signals, 1e6, end).tobytes()
    wide = b"".join(bytes([sample, 7]) for sample in samples)
    channels = dict(zip(("RO", "DE", "TX"), signals, strict=True))
    return {
        "one.sr": sr(samples, names=("RO", "DE", "TX")),
        "parts.sr": sr(samples, "1000000", ("RO", "DE", "TX"), parts=3),
        "wide.sr": sr(wide, "1 MHz", ("RO", "DE", "TX"), unit=2),
        "ns.vcd": vcd(channels),
        "us.vcd": vcd(channels, "1 us", 1000),
        "ps.vcd": vcd({name: [t * 1000 for t in edges] for name, edges in channels.items()}, "1 ps"),
        "vectors.vcd": vcd(channels, vector=True),
        "logic2.csv": edge_table(channels),
        "logic1.csv": edge_table({f" {name}": edges for name, edges in channels.items()}, "Time[s]", "\r\n"),
    }


@pytest.mark.parametrize("name", CONTENTS)
def test_every_format_of_edges_gives_the_bytes(tmp_path: Path, name: str) -> None:
    capture = opened(tmp_path, contents()[name], name)
    assert (whole(capture, 0), whole(capture, 1)) == (SENT, ANSWERED)
    assert (capture.line.baud, capture.line.parity, capture.line.char_bits, capture.line.tap) == (
        19200,
        "E",
        11,
        "logic",
    )
    assert capture.line.notes["port 1"].startswith("TX")
    assert "inferred" in capture.notices[0]
    times = [chunk.t_ns for chunk in capture.chunks()]
    assert times == sorted(times)
    assert abs(times[0] - min(EDGES[0], OTHER[0]) - 11e9 / 19200) < 2000
    assert not capture.damage


@cache
def tables() -> dict[str, bytes]:
    """The same edges as other tools and other countries write them."""
    channels = {"RO": EDGES, "DE": ENABLE, "TX": OTHER}
    head, rows = edge_table(channels).decode().split("\n", 1)
    millis = "".join(f"{float(row.split(',')[0]) * 1e3:.6f},{row.split(',', 1)[1]}\n" for row in rows.splitlines())
    micros = "".join(f"{float(row.split(',')[0]) * 1e6:.0f},{row.split(',', 1)[1]}\n" for row in rows.splitlines())
    samples = [EDGES, ENABLE, OTHER]
    old = "; Samplerate: 1 MHz\n; Channels (3/8): RO, DE, TX"
    made = {
        "DSView": "; CSV, generated by libsigrok4DSL 0.2.0\n; Channels (3/16)\n; Sample rate: 1 MHz\n"
        f"Time(s), RO, DE, TX\n{rows}",
        "decimal comma": f"{head};{rows}".replace(",", ";").replace(".", ",").replace("TX;", "TX\n", 1),
        "tabs": f"{head}\n{rows}".replace(",", "\t"),
        "milliseconds": f"Time (ms),RO,DE,TX\n{millis}",
        "bare time": f"Time,RO,DE,TX\n{rows}",
        "quoted": '"Time [s]","RO","DE, of RO","TX"\r\n' + rows.replace("\n", "\r\n"),
        "sigrok-cli, with times": f"{old}\nmicroseconds,logic,logic,logic\n{micros}",
        "sigrok-cli, with times and names": f"{old}\nTime,RO,DE,TX\n{micros}",
    }
    return {name: text.encode() for name, text in made.items()} | {
        "PulseView": sample_table(samples, "RO,DE,TX"),
        "sigrok-cli": sample_table(samples, "logic,logic,logic"),
        "sigrok of old": sample_table(samples, head=old),
        "Logic 1, all channels in one number": combined_table(samples),
        "sigrok, CR LF": sample_table(samples, "RO,DE,TX").replace(b"\n", b"\r\n"),
    }


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_channels_as_tools_and_countries_write_them(tmp_path: Path, name: str) -> None:
    capture = opened(tmp_path, tables()[name], "table.csv")
    assert (whole(capture, 0), whole(capture, 1)) == (SENT, ANSWERED)
    times = [chunk.t_ns for chunk in capture.chunks()]
    assert abs(times[0] - min(EDGES[0], OTHER[0]) - 11e9 / 19200) < 2000
    assert not capture.damage


@cache
def counted() -> dict[str, bytes]:
    """Tables that count samples, and say no rate."""
    rows = edge_table({"RO": EDGES}).decode().splitlines()[1:]
    numbers = [f"{float(time) * 1e6:.0f}, {level}" for time, level in (row.split(",") for row in rows)]
    return {
        "Logic 1": "\n".join(["Sample, Channel 0", *numbers, ""]).encode(),
        "without a head": b"\n".join(sample_table([EDGES]).split(b"\n")[2:]),
        "a scope's": scope_table(SHORT, 5000, "n,CH1,CH2", "{i},{high:.2f},{low:.2f}"),
    }


@pytest.mark.parametrize("name", COUNTED)
def test_a_rate_that_nobody_says_is_asked_for(tmp_path: Path, name: str) -> None:
    with pytest.raises(CaptureError, match="without a sample rate: give it with --sample-rate"):
        opened(tmp_path, counted()[name], "table.csv")
    capture = opened(tmp_path, counted()[name], "table.csv", sample_rate=200_000 if "scope" in name else 1_000_000)
    assert whole(capture) == (BRIEF if "scope" in name else SENT)
    assert capture.line.baud == 19200


def test_no_file_of_edges_is_left_out() -> None:
    assert [sorted(made()) for made in (contents, tables, counted)] == [CONTENTS, TABLES, COUNTED]


SCOPES = {
    "by time": ("Time(s),CH1(V),CH2(V)", "{t:.6e},{high:.3f},{low:.3f}"),
    "by number": ("X,CH1,CH2,Start,Increment\nSequence,VOLT,VOLT,-1e-3,5.0e-06", "{i},{high:.2e},{low:.2e},,"),
    "in ms": ("Time,Channel A,Channel B\n(ms),(V),(V)\n", "{ms:.5f},{high:.4f},{low:.4f}"),
    "numbered": ("n,time [s],CH1,CH2", "{i},{t:.6e},{high:.3f},{low:.3f}"),
    "below settings": (
        "Record Length,Analog:9\nSample Interval,Analog:5e-06\nSource,CH1,CH2\nSecond,Volt,Volt",
        "{t:+.9f},{high:.3f},{low:.3f}",
    ),
    "decimal comma": ("Zeit [s];A [V];B [V]", "{t:.6e};{high:.3f};{low:.3f}"),
}


@pytest.mark.parametrize("name", sorted(SCOPES))
def test_voltages_of_oscilloscopes(tmp_path: Path, name: str) -> None:
    head, row = SCOPES[name]
    content = scope_table(SHORT, 5000, head, row)
    capture = opened(tmp_path, content.replace(b".", b",") if "comma" in name else content, "scope.csv")
    assert capture.format == "scope-table"
    assert whole(capture) == BRIEF
    assert (capture.line.baud, capture.line.parity) == (19200, "E")
    assert "carries the same as" in capture.notices[0]
    assert abs(next(capture.chunks()).t_ns - SHORT[0] - 11e9 / 19200) < 10_000


def test_a_row_of_an_oscilloscope_that_is_broken_costs_no_other(tmp_path: Path) -> None:
    lines = scope_table(SHORT, 5000).split(b"\n")
    lines[500:501] = [b"\xff,?", lines[500] + b",a\rb"]  # a CR within a line: not a line's end
    capture = opened(tmp_path, b"\n".join(lines), "scope.csv")
    assert capture.format == "scope-table" and whole(capture) == BRIEF
    assert any("1 invalid rows" in damage.what for damage in capture.damage)


def test_values_polled_now_and_then_are_no_oscilloscope() -> None:
    rows = "".join(f"{i * 1.0:.1f},{20 + i % 7 / 10:.1f},{5 + i % 3 / 10:.1f}\n" for i in range(200))
    assert formats()["scope-table"].sniff(f"time,temperature,pressure\n{rows}".encode()) == 0


@pytest.mark.parametrize("rate", [4.3, 5, 8])
@pytest.mark.parametrize("parity", ["N", "E"])
def test_few_samples_a_bit(rate: float, parity: str) -> None:
    for off in (-0.01, 0.01):
        edges, sent = line(random.Random(f"{rate}{parity}"), 115200, (8, parity, 1), off=off)
        step = 1e9 / (rate * 115200)
        times = np.rint(np.ceil(np.array(edges) / step) * step).astype(np.int64)
        found = settings_of(times, 1, GivenSettings())
        assert found is not None
        assert (found[0].baud, found[0].parity) == (115200, parity)
        assert Uart(found[0], 1).feed(times, None).value.tobytes() == sent


@pytest.mark.parametrize("kind", ["glitches", "ringing"])
def test_what_is_too_short_for_a_bit_is_none(kind: str) -> None:
    chance = random.Random(4)
    if kind == "ringing":
        edges = [t + off for t in EDGES for off in (0, 300, 600)]
    else:
        struck = [chance.randrange(EDGES[-1]) for _ in range(len(EDGES) // 10)]
        edges = sorted(EDGES + [t + off for t in struck for off in (0, 1500)])
    found = settings_of(np.array(edges), 1, GivenSettings())
    assert found is not None
    assert str(found[0]) == "19200 bit/s 8E1"
    got = Uart(found[0], 1).feed(np.array(edges), None)
    assert len(got.value) == len(SENT)
    assert sum(a != b for a, b in zip(got.value.tobytes(), SENT, strict=True)) <= len(SENT) // 50


def test_a_transmitter_heard_by_its_own_receiver_is_left_out(tmp_path: Path) -> None:
    """And its driver's enable, one pulse a frame, is no slow line: with either of them frames were told twice."""
    chance = random.Random(9)
    frames = [chance.randbytes(8) for _ in range(40)]
    times = frames_on_line(frames, 19200, 11)
    sent = [one for i, one in enumerate(times) if i // 8 % 2 == 0]
    enable = [t for i in range(0, 320, 16) for t in (times[i][0] - 20_000, times[i + 7][0] + 600_000)]
    channels = {"TX": edges_of(sent, 19200, 8, "E"), "DE": enable, "RO": edges_of(times, 19200, 8, "E")}
    capture = opened(tmp_path, edge_table(channels), "table.csv")
    assert whole(capture) == b"".join(frames)
    assert {chunk.port for chunk in capture.chunks()} == {0}
    assert "what TX carries also appears on RO: skipped" in capture.notices[0]


def test_rows_that_are_none_are_said(tmp_path: Path) -> None:
    lines = sample_table([EDGES], "RO").splitlines(keepends=True)
    lines.insert(50, b"-\n")
    capture = opened(tmp_path, b"".join(lines), "table.csv")
    assert whole(capture) == SENT
    assert [damage.what for damage in capture.damage] == ["1 invalid rows: skipped"]


def test_bytes_of_an_analyser_are_no_levels(tmp_path: Path) -> None:
    frames = bytes.fromhex("1103006B00037687 010300000001840A") * 20
    rows = "".join(f"{i / 1000:.6f},0x{byte:02X}\n" for i, byte in enumerate(frames))
    capture = opened(tmp_path, f"Time [s],Value\n{rows}".encode(), "table.csv")
    assert capture.format == "saleae"
    assert whole(capture) == frames


@pytest.mark.parametrize("width", [2, 3, 8])
def test_lines_that_are_bits_of_a_vector(tmp_path: Path, width: int) -> None:
    """As simulators dump a `reg [1:0]`: values without their leading zeros, or with unknown bits before them."""
    capture = opened(tmp_path, vector_dump({"RO": EDGES, "TX": OTHER}, width), "bus.vcd")
    assert (whole(capture, 0), whole(capture, 1)) == (SENT, ANSWERED)
    assert [note.split(",")[0] for name, note in capture.line.notes.items() if name.startswith("port")] == [
        "lines[0]",
        "lines[1]",
    ]


def test_a_dump_without_a_time_scale(tmp_path: Path) -> None:
    said = b"$timescale 1 ns $end\n"
    capture = opened(tmp_path, vcd({"RO": EDGES}).replace(said, b""), "bus.vcd")
    assert whole(capture) == SENT
    assert "no $timescale: the times of this dump are read as nanoseconds" in capture.notices[0]
    micros = vcd({"RO": EDGES}, "1 ns", 1000).replace(said, b"")
    with pytest.raises(CaptureError):
        opened(tmp_path, micros, "bus.vcd")
    capture = opened(tmp_path, micros, "bus.vcd", sample_rate=1_000_000)
    assert (whole(capture), capture.line.baud) == (SENT, 19200)


@pytest.mark.parametrize(("off", "said"), [(0, 56000), (0.004, 56000), (0.0286, 57600), (0.02, 57600)])
def test_a_seldom_rate_beside_a_usual_one(off: float, said: int) -> None:
    edges, sent = line(random.Random(7), round(56000 * (1 + off)), (8, "E", 1), count=12)
    found = settings_of(np.array(edges), 1, GivenSettings())
    assert found is not None
    assert found[0].baud == said
    assert Uart(found[0], 1).feed(np.array(edges), None).value.tobytes() == sent


@pytest.mark.parametrize("version", [0, 1])
@pytest.mark.parametrize("inverted", [False, True])
def test_saleae_binary(tmp_path: Path, version: int, inverted: bool) -> None:
    capture = opened(tmp_path, binary_export(EDGES, version, int(not inverted)), "digital_0.bin")
    assert capture.format == "saleae-binary"
    assert whole(capture) == SENT
    assert ("inverted" in capture.notices[0]) is inverted


def test_both_wires_of_a_pair_are_one_line(tmp_path: Path) -> None:
    samples = sampled([EDGES, [t + 300 for t in EDGES]], 1e6, EDGES[-1] + 10**7, [1, 0]).tobytes()
    capture = opened(tmp_path, sr(samples, names=("A", "B")), "pair.sr")
    assert whole(capture) == SENT
    assert {chunk.port for chunk in capture.chunks()} == {0}
    assert "B carries the same as A" in capture.notices[0]


def test_settings_that_are_given_are_not_inferred(tmp_path: Path) -> None:
    given_ones = {"baud": 19200, "parity": "E", "bits": 8, "stop": 1, "polarity": "normal"}
    capture = opened(tmp_path, binary_export(EDGES), "digital_0.bin", **given_ones)
    assert whole(capture) == SENT
    assert not capture.notices
    wrong = opened(tmp_path, binary_export(EDGES), "digital_0.bin", baud=9600)
    assert wrong.line.baud == 9600
    assert sum(len(block.errors) for block in wrong.blocks()) > 10, "framing errors are marked"


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("still.sr", sr(bytes(10_000)), "none of them ever changes"),
        ("clock.sr", sr(bytes([0, 1]) * 10_000), "RO change, but not like a UART's line"),
        ("analog.sr", sr(b"", names=()), "without samples"),
        ("rate.sr", sr(bytes(9), "fast"), "sample rate"),
        ("endless.sr", sr(bytes(9), "9" * 400), "out of range"),
        ("lines.sr", sr(bytes([0, 1]) * 10_000, names=("RO\n named",)), "RO named change"),
        ("no.vcd", b"$timescale 1 ns $end\n$var real 64 ! volts $end\n$enddefinitions $end\n", "no bit signals"),
        ("cut.bin", b"<SALEAE>\0\0\0\0", "Saleae Logic 2"),
        ("new.bin", b"<SALEAE>" + struct.pack("<ii", 7, 0) + bytes(40), "version 7"),
        ("analog.bin", b"<SALEAE>" + struct.pack("<ii", 0, 1) + bytes(40), "analog"),
        ("a.logicdata", b"\0\1\2\3" * 50, "Options > Export data"),
        ("a.kvdat", b"\0\1\2\3" * 50, "as CSV"),
        ("bits.txt", b"libsigrok 0.5.2\nAcquisition with 1/8 channels at 1 MHz\nRO:ff 0f\n", "-O vcd"),
    ],
)
def test_what_holds_no_line_is_refused_in_a_line(tmp_path: Path, name: str, content: bytes, expected: str) -> None:
    with pytest.raises(CaptureError) as caught:
        opened(tmp_path, content, name)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_member_without_a_name_is_no_capture(tmp_path: Path) -> None:
    """The archive's directory is damaged so that a name is empty; the fuzz found it."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("q", b"\x11\x03")
    data = bytearray(file.getvalue())
    entry = data.index(b"PK\x01\x02")
    data[entry + 28 : entry + 32] = b"\0\0\1\0"  # it becomes an extra field
    with pytest.raises(CaptureError):
        opened(tmp_path, bytes(data), "bus.zip")


def test_a_logic_2_session_says_what_to_export(tmp_path: Path) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("meta.json", "{}")
        archive.writestr("digital-0.bin", bytes(100))
    with pytest.raises(CaptureError, match=re.escape("File > Export Data")):
        opened(tmp_path, file.getvalue(), "session.sal")


@pytest.mark.skipif(SIGROK is None, reason="sigrok-cli is not installed")
@pytest.mark.parametrize(("form", "options"), [((8, "N", 1), "parity=none"), ((8, "E", 1), "parity=even")])
def test_sigrok_decodes_the_same(tmp_path: Path, form: tuple[int, str, float], options: str) -> None:
    edges, sent = line(random.Random(21), 38400, form, count=12)
    path = tmp_path / "bus.sr"
    path.write_bytes(sr(sampled([edges], 2e6, edges[-1] + 10**7).tobytes(), "2 MHz"))
    decoder = f"uart:rx=RO:baudrate=38400:{options}"
    command = [str(SIGROK), "-i", str(path), "-P", decoder, "-A", "uart=rx-data"]
    theirs = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert bytes(int(row.split()[-1], 16) for row in theirs.splitlines()) == sent
    assert whole(captures.open(path)) == sent
    dump = tmp_path / "bus.vcd"
    subprocess.run([str(SIGROK), "-i", str(path), "-O", "vcd", "-o", str(dump)], capture_output=True, check=True)
    assert whole(captures.open(dump)) == sent


# Tables of analyzers


def table(rows: list[str], head: str = "name,type,start_time,duration,data,error") -> bytes:
    return "\n".join([head, *rows, ""]).encode()


def logic2(octets: bytes, shown: str, *, baud: int = 9600, bits: int = 10, iso: bool = False) -> bytes:
    """A data table whose values are shown in this form."""
    character = bits / baud
    rows = []
    for i, octet in enumerate(octets):
        start = 0.5 + i * character * 1.001 + (i // 8) * 0.01
        when = f"2026-11-21T10:15:{start:012.9f}Z" if iso else f"{start:.9f}"
        rows.append(f'"Async Serial","data",{when},{(bits - 0.5) / baud:.9f},{shown.format(octet)},')
    return table(rows)


OCTETS = bytes(random.Random(2).randrange(256) for _ in range(80))


@pytest.mark.parametrize("shown", ["0x{:02X}", "{:d}", "0b{:08b}", "'{:d}'"])
@pytest.mark.parametrize("iso", [False, True])
def test_logic_2_tables_in_every_radix(tmp_path: Path, shown: str, iso: bool) -> None:
    capture = opened(tmp_path, logic2(OCTETS, shown, iso=iso), "table.csv")
    assert whole(capture) == OCTETS
    assert (capture.line.baud, capture.line.char_bits) == (9600, 10)
    assert "inferred from the durations" in capture.notices[0]
    first = next(capture.chunks())
    start = 1_795_256_100_500_000_000 if iso else 500_000_000
    assert first.t_ns == start + round(10e9 / 9600)


@pytest.mark.parametrize(("baud", "bits"), [(19200, 11), (115200, 10), (38400, 10), (9600, 11)])
def test_durations_tell_rate_and_length(tmp_path: Path, baud: int, bits: int) -> None:
    capture = opened(tmp_path, logic2(OCTETS, "0x{:02X}", baud=baud, bits=bits), "table.csv")
    assert (capture.line.baud, capture.line.char_bits) == (baud, bits)
    given_one = opened(tmp_path, logic2(OCTETS, "0x{:02X}", baud=baud, bits=bits), "table.csv", baud=1200)
    assert given_one.line.baud == 1200
    assert not given_one.notices


def test_logic_1_tables(tmp_path: Path) -> None:
    head = "Time [s],Value,Parity Error,Framing Error"
    rows = [f"{0.1 + i * 10 / 19200:.15f},0x{octet:02X},{'Error' if i == 3 else ''}," for i, octet in enumerate(OCTETS)]
    capture = opened(tmp_path, table(rows, head), "table.txt")
    assert whole(capture) == OCTETS
    assert [chunk.errors for chunk in capture.chunks()][:5] == [(), (), (), (0,), ()]
    assert (capture.line.baud, capture.line.char_bits) == (19200, 10)
    assert "inferred from the spacing" in capture.notices[-1]


def test_tables_of_characters(tmp_path: Path) -> None:
    cells = [":", "1", "1", "0", "3", "' '", "COMMA", "\\t", "\\r", "\\n", "\\x80", '"\\\\"', "'13'", "255"]
    rows = [f"{0.1 + i / 100},{cell},," for i, cell in enumerate(cells)]
    capture = opened(tmp_path, table(rows, "Time [s],Value,Parity Error,Framing Error"), "table.txt", format="saleae")
    assert whole(capture) == b":1103 ,\t\r\n\x80\\\x0d\xff"


def test_analyzers_are_ports_and_other_rows_are_passed_over(tmp_path: Path) -> None:
    rows = [
        '"RX","data",1.0,0.001,0x01,',
        '"I2C","start",1.0,0.001,,',
        '"TX","data",1.1,0.001,0x02,"framing"',
        "x,data,9,9,zz,",
    ]
    capture = opened(tmp_path, table(rows), "table.csv")
    assert [(chunk.port, chunk.data, chunk.errors) for chunk in capture.chunks()] == [(0, b"\1", ()), (1, b"\2", (0,))]
    assert capture.damage[0].where == "line 5"


SEEDS = [
    *(content for name, content in contents(120).items() if name in ("one.sr", "ns.vcd", "logic2.csv")),
    binary_export(EDGES[:200]),
    binary_export(EDGES[:200], 1),
    logic2(OCTETS, "0x{:02X}"),
    sample_table([EDGES[:100]], "RO"),
    scope_table(EDGES[:60], 10_000),
    contents(120)["logic2.csv"].replace(b",", b";").replace(b".", b","),
]


@pytest.mark.parametrize("which", range(len(SEEDS)))
@settings(FILES, max_examples=25)  # of each format
@given(data=st.data())
def test_damaged_bytes_never_crash_a_reader(tmp_path: Path, which: int, data: st.DataObject) -> None:
    content = bytearray(SEEDS[which])
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(content) - 1) | st.integers(0, min(300, len(content) - 1)))
        piece = data.draw(
            st.binary(max_size=9) | st.sampled_from([b"\xff" * 8, b"#9" * 30, b",", b"\n", b"nan", b"1e400"])
        )
        content[at : at + data.draw(st.integers(0, 9))] = piece
    try:
        capture = opened(tmp_path, bytes(content), "any.csv")
        for block in capture.blocks():
            assert len(block.t_ns) == len(block.offsets) - 1 == len(block.port)
    except CaptureError as error:
        assert "\n" not in str(error)
