"""JSON lines: the contract's keys, all bytes there, and why."""

import gc
import json
import os
import subprocess
import sys
import tracemalloc

import pytest
from buses import LINE, adu, spaced, streams
from hypothesis import HealthCheck, given, settings
from running import START, environment, ran, refused

import captures
from analyzer.exports import ExportOptions, export
from captures import Capture, Chunk

REQUEST = adu("1103006b0003")
ANSWER = bytes.fromhex("110306ae415652434049ad")
KEYS = [
    "index", "start", "length", "t_start_ns", "t_end_ns", "protocol", "direction", "unit", "function", "name",
    "exception", "crc_ok", "request_start", "taken_for_start", "unsure", "response_time_ns", "hex", "fields",
        "address", "quantity", "values", "summary", "time", "confidence", "findings",
]  # fmt: skip


@pytest.fixture
def bus(tmp_path):
    path = tmp_path / "bus.jsonl"
    captures.write(path, spaced([REQUEST, ANSWER, b"\xff\x00\xff", REQUEST, adu("118302")] * 3), line=LINE)
    return path


def lines(text):
    return [json.loads(line) for line in text.splitlines()]


def test_an_object_a_frame_with_the_keys_of_the_contract(capsys, bus):
    done = ran(capsys, "export", bus)
    assert (done.status, done.err) == (0, "")
    frames = lines(done.out)
    assert [list(frame) for frame in frames] == [KEYS] * 12
    assert [frame["index"] for frame in frames] == list(range(12))
    request, answer = frames[:2]
    assert (request["direction"], answer["direction"]) == ("request", "response")
    assert (answer["request_start"], answer["start"], answer["length"]) == (0, 8, 11)
    assert answer["response_time_ns"] == pytest.approx(6_000_000, rel=0.01)
    assert answer["t_start_ns"] < answer["t_end_ns"]
    assert answer["hex"] == ANSWER.hex()
    assert [field["name"] for field in answer["fields"]] == ["unit", "function", "byte_count", "registers", "crc"]
    assert frames[3]["exception"] == 2
    assert all(frame["crc_ok"] for frame in frames)


def test_noise_lines_make_them_tile(capsys, bus):
    found = lines(ran(capsys, "export", bus, "--noise").out)
    at = 0
    for line in found:
        assert line["start"] == at
        assert line["length"] * 2 == len(line["hex"])
        at += line["length"]
    noise = [line for line in found if line.get("kind") == "noise"]
    assert [line["hex"] for line in noise] == ["ff00ff"] * 3
    assert all(isinstance(line["t_start_ns"], int) for line in noise)


def test_explain_tells_evidence_and_the_runner_up(capsys, bus):
    explained = lines(ran(capsys, "export", bus, "--explain").out)
    assert explained
    for frame in explained:
        why = frame["explain"]
        assert list(why) == ["length", "crc", "silence", "conversation", "margin", "runner_up"]
        assert set(why["runner_up"]) == {"start", "length", "kind"}
        assert why["crc"] == pytest.approx(16, abs=0.5)
        assert why["margin"] > 0


def test_to_a_file_it_is_the_same(capsys, bus, tmp_path):
    out = tmp_path / "frames.jsonl"
    done = ran(capsys, "export", bus, "-o", out)
    assert (done.status, done.out) == (0, "")
    assert out.read_text(encoding="utf-8") == ran(capsys, "export", bus).out


def test_no_frame_is_said_with_status_1(capsys, tmp_path):
    path = tmp_path / "gps.jsonl"
    captures.write(path, [Chunk(10**9, b"$GPGGA,123519,4807.038,N*47\r\n")], line=LINE)
    done = ran(capsys, "export", path, "-o", tmp_path / "out.jsonl")
    assert done.status == 1
    assert done.err == f"rtuscope: {path}: no Modbus frame found in 29 bytes\n"


def test_damage_is_said_and_the_rest_is_there(capsys, bus):
    text = bus.read_text(encoding="utf-8").splitlines(keepends=True)
    bus.write_text("".join([*text[:4], "{broken\n", *text[4:]]))
    done = ran(capsys, "export", bus)
    assert done.status == 0
    assert done.err.startswith(f"rtuscope: {bus}: line 5: ")
    assert len(lines(done.out)) == 12


def test_unusable_places_to_write_to_are_one_line(capsys, bus, tmp_path):
    before = bus.read_bytes()
    for out, words in (
        (bus, "is the capture being read"),
        (tmp_path / "x.weird", "no format 'weird'"),
        (tmp_path / "x", "no suffix"),
        (tmp_path / "no" / "folder" / "x.csv", "no folder"),
        (tmp_path, "no suffix"),
    ):
        assert words in refused(capsys, "export", bus, "-o", out)
    assert bus.read_bytes() == before
    assert sorted(tmp_path.iterdir()) == [bus]


@pytest.mark.skipif(os.name == "nt", reason="needs a limit on file sizes")
@pytest.mark.parametrize("suffix", ["jsonl", "csv", "mcap", "parquet"])
def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path, suffix):
    import resource

    bus, out = tmp_path / "bus.jsonl", tmp_path / f"out.{suffix}"
    captures.write(bus, spaced([REQUEST, adu("1103fa" + os.urandom(250).hex())] * 300), line=LINE)
    done = subprocess.run(
        [sys.executable, "-c", START, "export", str(bus), "-o", str(out)],
        capture_output=True,
        env=environment(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
        timeout=60,
    )
    assert done.returncode == 2
    assert done.stderr.decode().startswith(f"rtuscope: {out}: cannot be written: ")
    assert done.stderr.count(b"\n") == 1
    assert list(tmp_path.iterdir()) == [bus]


def test_stopping_completes_the_file_with_what_came(bus, tmp_path):
    asked = []
    out = tmp_path / "out.jsonl"
    done = export(
        captures.open(bus), out, progress=lambda frames, _octets: asked.append(frames), stop=lambda: bool(asked)
    )
    assert done.partial
    assert done.frames == len(out.read_text(encoding="utf-8").splitlines()) == asked[-1]


@pytest.mark.parametrize("suffix", ["jsonl", "csv", "mcap"])
def test_export_after_export_keeps_nothing(suffix, tmp_path):
    """Each of another capture, so that what a cache kept of one would stay."""

    def exported(number):
        talk = [frame for word in range(400) for frame in (REQUEST, adu(f"110306{word:04x}{number:04x}4340"))]
        export(Capture.of(LINE, spaced(talk)), tmp_path / f"out.{suffix}")

    for number in range(3):  # imports, grammars, tables of the program itself
        exported(number)
    gc.collect()
    tracemalloc.start()
    try:
        exported(3)
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for number in range(4, 9):
            exported(number)
        gc.collect()
        kept = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert kept < 50_000


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chunks=streams())
@pytest.mark.parametrize("suffix", ["jsonl", "csv", "mcap", "parquet"])
def test_any_bytes_are_exported(tmp_path, suffix, chunks):
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    out = tmp_path / f"out.{suffix}"
    export(Capture.of(LINE, chunks), out, options=ExportOptions(explain=True, noise=True))
    if suffix == "jsonl":
        found = lines(out.read_text(encoding="utf-8"))
        assert sum(line["length"] for line in found) == sum(len(chunk.data) for chunk in chunks)
