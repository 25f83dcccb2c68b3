"""Every format: what is written is read back, what is cut gives its beginning, and no bytes crash a reader."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from running import environment

import captures
from captures import Capture, CaptureError, Chunk, LineSettings, Mark, samples
from captures.formats import formats, recognise
from captures.formats.mcap.records import MAGIC

CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"
LOSSLESS = ["serial-chunks", "mcap"]
SUFFIXES = sorted({suffix for found in formats().values() for suffix in found.suffixes} | {"", ".xyz"})
settings.register_profile("files", deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
FILES = settings(settings.get_profile("files"), max_examples=40)
FUZZ = settings(FILES, max_examples=30)  # of each suffix and format

texts = st.text(max_size=12)
lines = st.builds(
    LineSettings,
    baud=st.none() | st.integers(1, 10**8),
    char_bits=st.none() | st.integers(7, 13),
    parity=st.none() | st.sampled_from("NEOMS"),
    stop_bits=st.none() | st.sampled_from([1, 1.5, 2]),
    tap=st.none() | st.sampled_from(["irq", "ftdi16"]),
    notes=st.dictionaries(st.sampled_from(["source", "note", "x y", "é"]), texts, max_size=3),
)


@st.composite
def reads(draw: st.DrawFn) -> list[Chunk]:
    now, chunks = draw(st.integers(-(10**18), 2 * 10**18)), []
    for data in draw(st.lists(st.binary(min_size=1, max_size=20), max_size=12)):
        now += draw(st.integers(0, 3 * 10**9))
        errors = draw(st.lists(st.integers(0, len(data) - 1), unique=True, max_size=3))
        port, mark = draw(st.integers(0, 255)), draw(st.sampled_from(Mark))
        chunks.append(Chunk(now, data, port, mark, tuple(sorted(errors))))
    return chunks


def written(capture: Capture, format: str) -> bytes:
    file = io.BytesIO()
    captures.write(file, capture, format=format)
    return file.getvalue()


def reopened(folder: Path, content: bytes, suffix: str) -> Capture:
    path = folder / f"capture{suffix}"
    path.write_bytes(content)
    return captures.open(path)


@pytest.mark.parametrize("format", LOSSLESS)
@FILES
@given(line=lines, chunks=reads(), timed=st.booleans())
def test_what_is_written_is_read_back(
    tmp_path: Path, format: str, line: LineSettings, chunks: list[Chunk], timed: bool
) -> None:
    capture = Capture.of(line, chunks, timed=timed)
    again = reopened(tmp_path, written(capture, format), ".anything")
    assert again.format == format
    assert again.line == line
    assert again.timed is timed
    assert list(again.chunks()) == list(capture.chunks())
    assert not again.damage


@FILES
@example(chunks=[Chunk(0, b"PK\x03\x04")])
@given(chunks=reads())
def test_raw_bytes_keep_the_bytes(tmp_path: Path, chunks: list[Chunk]) -> None:
    content = b"".join(chunk.data for chunk in chunks)
    assert written(Capture.of(LineSettings(), chunks), "bin") == content
    if content:
        path = tmp_path / "raw.bin"
        path.write_bytes(content)
        capture = captures.open(path, format="bin")
        assert not capture.timed
        assert b"".join(chunk.data for chunk in capture.chunks()) == content


@pytest.mark.parametrize("format", LOSSLESS)
@FILES
@given(chunks=reads(), data=st.data())
def test_a_file_cut_anywhere_gives_its_beginning_and_says_so(
    tmp_path: Path, format: str, chunks: list[Chunk], data: st.DataObject
) -> None:
    capture = Capture.of(LineSettings(baud=9600), chunks)
    content = written(capture, format)
    length = data.draw(st.integers(0, len(content) - 1))
    whole = list(capture.chunks())
    try:
        cut = reopened(tmp_path, content[:length], formats()[format].suffixes[0])
    except CaptureError as error:
        assert "\n" not in str(error)
        assert length < len(content) - sum(len(chunk.data) for chunk in whole), "the settings were there"
        return
    given_chunks = list(cut.chunks())
    assert given_chunks == whole[: len(given_chunks)]
    at_line_end = format == "serial-chunks" and (content[length - 1 : length + 1].find(b"\n") >= 0)
    assert cut.damage or at_line_end


@pytest.mark.parametrize("format", LOSSLESS)
@FILES
@given(chunks=reads(), data=st.data())
def test_a_damaged_byte_never_crashes_a_reader(
    tmp_path: Path, format: str, chunks: list[Chunk], data: st.DataObject
) -> None:
    content = bytearray(written(Capture.of(LineSettings(baud=9600), chunks), format))
    content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / f"damaged{formats()[format].suffixes[0]}"
    path.write_bytes(content)
    one_line_or_capture(path, format)


def one_line_or_capture(path: Path, format: str | None = None) -> int:
    try:
        return sum(len(block.data) for block in captures.open(path, format=format).blocks())
    except CaptureError as error:
        assert str(error)
        assert "\n" not in str(error)
        return 0


SEEDS = [
    b'{"format": "serial-chunks", "version": 1, "baud": 9600}\n{"t_ns": 1, "hex": "11"}\n',
    b'{"t_ns": 1, "hex": "1103"}\n{"t_ns": 2, "hex": "00", "port": 1, "errors": [0], "mark": "tx"}\n',
    b"12:00:01.123 TX 11 03 00 6B\n2026-11-21 01:02:03,123 RX 0x11 0x03\n",
    b"> 2026/11/21 04:58:09.000394797  length=8 from=0 to=7\n 11 03 00 6b 00 03 76 87\n--\n",
    b'04:59:10.118521 read(3, "\\x11\\x03", 64) = 2\n[11][03]\n<11><03>\n{"type":"Buffer","data":[17,3]}\n',
    b"0000  11 03 00 6b 00 03 76 87  01 02 |..|\n0008\n:1103006B00037E\n",
    b'name,type,start_time,duration,data,error\n"Async","data",0.0006025,2.375e-05,0xC8,\n',
    MAGIC,
]


@st.composite
def mangled(draw: st.DrawFn) -> bytes:
    """Bytes near to what readers expect: a seed with pieces of itself, other seeds and anything spliced in."""
    content = draw(st.sampled_from(SEEDS))
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(content)))
        piece = draw(st.binary(max_size=8) | st.sampled_from(SEEDS) | texts.map(str.encode))
        content = content[:at] + piece + content[at + draw(st.integers(0, 5)) :]
    return content


@pytest.mark.parametrize("suffix", SUFFIXES)
@FUZZ
@given(content=st.binary(max_size=300) | mangled())
def test_any_bytes_under_any_suffix(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"any{suffix}"
    path.write_bytes(content)
    one_line_or_capture(path)


@pytest.mark.parametrize("format", sorted(formats()))
@FUZZ
@given(content=st.binary(max_size=300) | mangled())
def test_any_bytes_as_any_format(tmp_path: Path, format: str, content: bytes) -> None:
    path = tmp_path / "any"
    path.write_bytes(content)
    one_line_or_capture(path, format)


@pytest.mark.parametrize(
    "filling", [b"\x00", b"0", b"[", b'{"', b"a", b"11 ", b"\\x", b"'\"", b"12:00:", b"\n", b"0x1,", b"1 ", b"aa<"]
)
@pytest.mark.parametrize("suffix", [".jsonl", ".txt", ".csv", ".mcap", ""])
def test_monotonous_files_take_little_time(tmp_path: Path, suffix: str, filling: bytes) -> None:
    path = tmp_path / f"same{suffix}"
    path.write_bytes(filling * (300_000 // len(filling)))
    start = time.process_time()
    one_line_or_capture(path)
    assert time.process_time() - start < 4


def test_zeros_stream_in_flat_memory(tmp_path: Path) -> None:
    path = tmp_path / "zeros.bin"
    with path.open("wb") as file:
        file.truncate(30 << 20)
    capture = captures.open(path)
    tracemalloc.start()
    try:
        total = sum(len(block.data) for block in capture.blocks())
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert total == 30 << 20
    assert peak < 8 << 20


def test_reading_follows_the_file_as_it_is_asked_for(tmp_path: Path) -> None:
    """Blocks come one at a time: the first is there before the last is read."""
    chunks = [Chunk(i, os.urandom(16)) for i in range(40_000)]
    path = tmp_path / "long.jsonl"
    captures.write(path, chunks)
    blocks: Iterator[captures.Block] = captures.open(path).blocks(1 << 15)
    assert len(next(blocks)) < len(chunks) / 4


def corpus_files() -> list[Path]:
    return sorted(path for path in CORPUS.glob("*/*.jsonl") if "truth" not in path.name)


@pytest.mark.skipif(not CORPUS.exists(), reason="the corpus of captures is not beside the project")
def test_the_corpus_opens_whole() -> None:
    assert corpus_files()
    for path in corpus_files():
        capture = captures.open(path)
        digits = len(re.findall(rb'"hex": ?"', path.read_bytes()))
        assert sum(len(block) for block in capture.blocks()) == digits, path.name
        assert capture.line.baud, path.name
        assert capture.timed is ("untimed" not in path.name), path.name
        assert not capture.damage, path.name


def test_the_samples_are_whole_and_say_how_they_were_made() -> None:
    from captures import samples

    assert {"healthy.jsonl", "troubled.jsonl"} <= set(samples.names())
    for name in samples.names():
        path = samples.path(name)
        assert path.stat().st_size < 60_000
        capture = captures.open(path)
        assert sum(len(block.data) for block in capture.blocks()) > 100
        assert not capture.damage
        assert "over ptys" in capture.line.notes["source"]
        assert capture.line.baud == 19200
    with pytest.raises(KeyError):
        samples.path("absent.jsonl")


def test_a_file_that_is_wholly_of_its_suffixs_format_is_taken_for_it_before_others_are_loaded(tmp_path: Path) -> None:
    path = tmp_path / "some.mcap"
    captures.write(path, Capture.of(LineSettings(baud=9600), [Chunk(0, b"123")]))
    program = (
        "import sys, captures; captures.open(sys.argv[1]);"
        "print(*(name for name in sys.modules if name.startswith(('captures.formats.', 'captures.text.'))))"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", program, path], capture_output=True, text=True, env=environment(), check=True
    ).stdout.split()
    assert {name.split(".")[2] for name in loaded} <= {"mcap", "judging"}


def test_that_haste_changes_no_answer() -> None:
    for path in [*sorted((CORPUS / "real").glob("*.jsonl"))[:5], *map(samples.path, samples.names())]:
        head = path.read_bytes()[:65536]
        for suffix in SUFFIXES:
            scores = {each: each.sniff(head) for each in formats().values()}
            best = max(scores.values())
            try:
                taken = recognise(head, suffix, "it").format
            except CaptureError:
                continue
            if best >= 1.0:
                assert scores[taken] == best, (path, suffix)
