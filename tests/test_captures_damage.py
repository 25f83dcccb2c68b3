"""Damaged MCAP files: what is damaged costs the chunk that it hit, is told, and nothing takes more than its share."""

from __future__ import annotations

import errno
import io
import random
import struct
import time
import tracemalloc
from functools import cache
from pathlib import Path

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

import captures
from captures import Block, Capture, Chunk, LineSettings
from captures.errors import CaptureError
from captures.formats.mcap.channel import ChunkChannel
from captures.formats.mcap.records import TOPIC
from captures.formats.mcap.scanning import FileBytes
from captures.formats.mcap.writer import ArrayWriter
from captures.limits import TIME_LIMIT
from captures.recording.notes import Note, NoteChannel, read

LINE = LineSettings(baud=19200, char_bits=11, tap="irq")
FILES = settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
BEGUN = 1_800_000_000 * 10**9
STEP = 500_000_000


@cache
def recording(count: int = 24, *, whole: bool = True, compression: str = "zstd") -> bytes:
    """A recording as a recorder makes it, a chunk each half second; not whole: without its index."""
    chance, file = random.Random(count), io.BytesIO()
    writer = ArrayWriter(file, compression=compression)
    writer.start(library="test")
    ours, notes = ChunkChannel(writer, LINE), NoteChannel(writer)
    for i in range(count):
        ours.write(Block.from_chunks([Chunk(BEGUN + i * STEP + k, chance.randbytes(60)) for k in range(6)]))
        if i == count // 2:
            notes.write(Note(BEGUN + i * STEP, "lost", "/dev/ttyUSB0: lost"))
        writer.flush()
    end = len(file.getvalue())
    writer.finish()
    return file.getvalue() if whole else file.getvalue()[:end]


@cache
def places(content: bytes) -> list[tuple[int, int]]:
    """Where each chunk that has ours begins and ends in the whole of this recording."""
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    (ours,) = (channel.id for channel in summary.channels.values() if channel.topic == TOPIC)
    return [
        (index.chunk_start_offset, index.chunk_start_offset + index.chunk_length)
        for index in summary.chunk_indexes
        if ours in index.message_index_offsets
    ]


def capture_end(content: bytes) -> int:
    """Where the data of a whole recording end and its summary begins."""
    return int.from_bytes(content[-28:-20], "little")


def opened(folder: Path, content: bytes) -> Capture:
    path = folder / "damaged.mcap"
    path.write_bytes(content)
    return captures.open(path, format="mcap")


def parts(capture: Capture) -> list[tuple[int, bytes]]:
    """The half seconds that were given: number and bytes."""
    given_parts: dict[int, bytes] = {}
    for chunk in capture.chunks():
        number = (chunk.t_ns - BEGUN) // STEP
        given_parts[number] = given_parts.get(number, b"") + chunk.data
    return list(given_parts.items())


def whole_parts(count: int = 24) -> list[tuple[int, bytes]]:
    chance = random.Random(count)
    return [(i, b"".join(chance.randbytes(60) for _ in range(6))) for i in range(count)]


def check(folder: Path, content: bytes, damaged: bytes, first: int, last: int) -> None:
    """All chunks that bytes `first` to `last` do not touch are given, in order, and what is not given is told."""
    expected = dict(whole_parts())
    capture = opened(folder, damaged)
    given_parts = parts(capture)
    assert all(expected[number] == data for number, data in given_parts)
    numbers = [number for number, _ in given_parts]
    assert numbers == sorted(numbers)
    missing = set(expected) - set(numbers)
    hit = {i for i, (begin, end) in enumerate(places(content)) if begin < last and first < end}
    assert missing <= hit, (first, last, [str(damage) for damage in capture.damage])
    if missing:
        texts = " ".join(damage.what for damage in capture.damage)
        assert "lost" in texts, texts


@pytest.mark.parametrize("whole", [True, False])
@FILES
@given(data=st.data())
def test_a_bad_stretch_costs_what_it_hit(tmp_path: Path, whole: bool, data: st.DataObject) -> None:
    content = recording(whole=whole)
    size = data.draw(st.sampled_from([1, 16, 512, 4096]))
    at = data.draw(st.integers(0, len(content) - 1))
    stretch = data.draw(st.sampled_from([b"\0", b"\xff", None]))
    bad = stretch * size if stretch else random.Random(at).randbytes(size)
    damaged = content[:at] + bad[: len(content) - at] + content[at + size :]
    check(tmp_path, recording(), damaged, at, at + size)


@pytest.mark.parametrize("fill", [0x00, 0x81, 0xFF])
def test_a_bad_end_is_no_cut(tmp_path: Path, fill: int) -> None:
    content = recording(whole=False)
    for at in range(places(recording())[-2][0] - 40, len(content), 9):
        check(tmp_path, recording(), content[:at] + bytes([fill]) * (len(content) - at), at, len(content))


@pytest.mark.parametrize("whole", [True, False])
def test_no_flipped_byte_loses_more_than_a_chunk_or_anything_without_a_word(tmp_path: Path, whole: bool) -> None:
    content = recording(whole=whole)
    begins = {begin for begin, _ in places(recording())}
    chance = random.Random(1)
    heads = [begin + i for begin in sorted(begins)[3:6] for i in range(60)]
    for at in chance.sample([*range(700), *heads, *heads, *range(len(content))], 100):
        for flip in (0x01, 0x80):
            damaged = bytearray(content)
            damaged[at] ^= flip
            check(tmp_path, recording(), bytes(damaged), at, at + 1)


@pytest.mark.parametrize("whole", [True, False])
def test_a_chunk_is_read_whatever_its_opcode_has_become(tmp_path: Path, whole: bool) -> None:
    for opcode in {*range(0, 256, 9), 6, 15, 0x80}:
        damaged = bytearray(recording(whole=whole))
        damaged[places(recording())[5][0]] = opcode
        assert parts(opened(tmp_path, bytes(damaged))) == whole_parts(), opcode


def test_a_chunk_is_found_where_the_beginning_is_gone(tmp_path: Path) -> None:
    begin, _ = places(recording())[0]
    for left in (0, 1, 7, 8, 9):
        assert parts(opened(tmp_path, recording()[begin - left :])) == whole_parts()


@FILES
@given(data=st.data())
def test_bytes_that_are_missing_in_the_middle_cost_what_they_held(tmp_path: Path, data: st.DataObject) -> None:
    """A transfer that lost a stretch: every offset of the index is wrong.

    Not the first chunk, which names the channel; nor the end: that is a cut.
    """
    content = recording()
    (_, first), *_, (last, _) = places(content)
    at = data.draw(st.integers(first, last - 1))
    size = data.draw(st.integers(1, min(5000, last - at)))
    check(tmp_path, content, content[:at] + content[at + size :], at, at + size)


def test_whole_records_that_are_missing_are_told(tmp_path: Path) -> None:
    """A stretch from the end of one chunk to the beginning of another leaves nothing that looks damaged."""
    content = recording()
    (_, end), _, (begin, _), *_ = places(content)
    check(tmp_path, content, content[:end] + content[begin:], end, begin)
    capture = opened(tmp_path, content[:end] + content[begin:])
    assert [number for number, _ in parts(capture)] == [i for i in range(24) if i != 1]
    assert [str(damage) for damage in capture.damage if "lost" in damage.what] == [
        f"byte {capture_end(content) - (begin - end)}: {begin - end} bytes are missing before the index: "
        "what they held is lost"
    ]


@pytest.mark.parametrize("whole", [True, False])
def test_what_is_missing_is_told_from_when_to_when(tmp_path: Path, whole: bool) -> None:
    damaged = bytearray(recording(whole=whole))
    for number in (5, 6, 20):
        begin, end = places(recording())[number]
        damaged[begin + 70 : end] = bytes(end - begin - 70)
    capture = opened(tmp_path, bytes(damaged))
    assert [number for number, _ in parts(capture)] == [i for i in range(24) if i not in (5, 6, 20)]
    lost = [str(damage) for damage in capture.damage if "lost" in damage.what]
    assert len(lost) == 2
    assert "and 1 more: data received between 2027-01-15T08:00:02.000Z and 2027-01-15T08:00:03.500Z is lost" in lost[0]
    assert "data received between 2027-01-15T08:00:09.500Z and 2027-01-15T08:00:10.500Z is lost" in lost[1]
    assert lost[0].startswith(f"byte {places(recording())[5][0]}: a damaged chunk (")


def test_settings_of_the_line_are_found_after_damage_at_the_beginning(tmp_path: Path) -> None:
    begin, _ = places(recording())[1]
    hit = random.Random(1).randbytes(begin)
    capture = opened(tmp_path, hit + recording()[begin:])
    assert capture.line == LINE
    assert parts(capture) == whole_parts()[1:]
    cut = opened(tmp_path, hit + recording(whole=False)[begin:])
    assert parts(cut) == whole_parts()[1:]
    assert cut.line == LineSettings()
    assert "the line settings are damaged and unknown" in cut.damage[0].what


def test_notes_survive_damage_elsewhere(tmp_path: Path) -> None:
    for whole in (True, False):
        for number in (0, 3, 20):
            damaged = bytearray(recording(whole=whole))
            begin, _ = places(recording())[number]
            damaged[begin : begin + 512] = random.Random(1).randbytes(512)
            (tmp_path / "notes.mcap").write_bytes(damaged)
            assert [note.text for note in read(tmp_path / "notes.mcap")] == ["/dev/ttyUSB0: lost"]


def test_messages_that_the_summary_counts_and_nobody_finds_are_told(tmp_path: Path) -> None:
    """As in a file whose messages a tool took out that made a right index, but left the statistics."""
    content, out = recording(), io.BytesIO()
    writer = Writer(out, chunk_size=1, compression=CompressionType.NONE)
    writer.start(library="other")
    source = make_reader(io.BytesIO(content))
    ids = {}
    for schema, channel, message in source.iter_messages(log_time_order=False):
        if channel.topic not in ids:
            number = writer.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
            ids[channel.topic] = writer.register_channel(
                channel.topic, channel.message_encoding, number, dict(channel.metadata)
            )
        writer.add_message(ids[channel.topic], message.log_time, message.data, message.publish_time)
    writer._Writer__statistics.channel_message_counts[ids[TOPIC]] += 2  # type: ignore[attr-defined]
    writer.finish()
    capture = opened(tmp_path, out.getvalue())
    assert parts(capture) == whole_parts()
    assert [damage.what for damage in capture.damage] == [f"2 of 26 messages on {TOPIC} are missing"]


class BadSector(io.BytesIO):
    """A file on a disk that cannot give one stretch."""

    def __init__(self, content: bytes, first: int, last: int) -> None:
        super().__init__(content)
        self.bad = range(first, last)

    def read(self, size: int | None = -1, /) -> bytes:
        at = self.tell()
        end = len(self.getvalue()) if size is None or size < 0 else min(at + size, len(self.getvalue()))
        if at < self.bad.stop and self.bad.start < end:
            raise OSError(errno.EIO, "input/output error")
        return super().read(size)


def test_what_a_disk_cannot_give_reads_as_zeros() -> None:
    content = random.Random(1).randbytes(3_000_000)
    data = FileBytes(BadSector(content, 1_500_000, 1_500_512))
    again = b"".join(data.read(at, 100_000) for at in range(0, 3_000_000, 100_000))
    wrong = [i for i in range(0, 3_000_000, 512) if again[i : i + 512] != content[i : i + 512]]
    assert len(again) == 3_000_000
    assert 0 < len(wrong) <= 20
    assert all(1_490_000 < i < 1_510_000 for i in wrong)


def one_chunk(packed: bytes, unpacked: int, *, crc: int = 0, compression: bytes = b"zstd") -> bytes:
    """A file with our settings and a chunk that claims what it likes."""
    file = io.BytesIO()
    writer = ArrayWriter(file)
    writer.start()
    ChunkChannel(writer, LINE)
    head = struct.pack("<QQQII", 0, 0, unpacked, crc, len(compression)) + compression + struct.pack("<Q", len(packed))
    return file.getvalue() + struct.pack("<BQ", 6, len(head) + len(packed)) + head + packed


EMPTY_CHUNK = 9 + 32 + 4 + 8  # bytes, zstd by name


def zeros(size: int) -> bytes:
    """Packed, in pieces, so that nothing this large is ever in memory here."""
    packer = zstandard.ZstdCompressor(level=1).compressobj()
    return b"".join([*(packer.compress(bytes(1 << 20)) for _ in range(size >> 20)), packer.flush()])


@pytest.mark.parametrize(
    ("claimed", "held"), [(1 << 30, 1 << 30), (1000, 1 << 30), (65 << 20, 1000), (1 << 62, 1 << 20)]
)
def test_what_a_few_bytes_unpack_to_is_bounded(tmp_path: Path, claimed: int, held: int) -> None:
    content = one_chunk(zeros(held) if held > 1 << 20 else zstandard.compress(bytes(held)), claimed)
    assert len(content) < 100_000
    (tmp_path / "bomb.mcap").write_bytes(content)
    tracemalloc.start()
    begun = time.process_time()
    capture = captures.open(tmp_path / "bomb.mcap")
    assert list(capture.chunks()) == []
    assert read(tmp_path / "bomb.mcap") == []
    spent, peak = time.process_time() - begun, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "a damaged chunk" in capture.damage[-1].what
    assert peak < 80 << 20
    assert spent < 3


def test_a_file_of_many_bombs_is_bounded_too(tmp_path: Path) -> None:
    bomb, empty = one_chunk(zeros(48 << 20), 48 << 20), one_chunk(b"", 0)
    content = bomb + bomb[len(empty) - EMPTY_CHUNK :] * 40
    assert len(content) < 100_000
    begun = time.process_time()
    assert list(opened(tmp_path, content).chunks()) == []
    assert time.process_time() - begun < 3


def test_the_limit_of_a_chunk_is_a_setting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.BytesIO()
    chunk = Chunk(5, random.Random(1).randbytes(3 << 20))
    captures.write(file, [chunk], line=LINE, format="mcap")
    monkeypatch.setenv("RTUSCOPE_CHUNK_MIB", "2")
    capture = opened(tmp_path, file.getvalue())
    assert list(capture.chunks()) == []
    assert "it unpacks to 4 MiB, over 2: RTUSCOPE_CHUNK_MIB=4 allows it" in capture.damage[0].what
    with pytest.raises(CaptureError, match="too large for an MCAP file"):
        captures.write(io.BytesIO(), [chunk], line=LINE, format="mcap")
    monkeypatch.setenv("RTUSCOPE_CHUNK_MIB", "4")
    assert list(capture.chunks()) == [chunk]


@pytest.mark.parametrize("name", ["mcap", "serial-chunks"])
@FILES
@given(
    times=st.lists(
        st.one_of(st.integers(1 - TIME_LIMIT, TIME_LIMIT - 1), st.sampled_from([1 - TIME_LIMIT, 0, 5, TIME_LIMIT - 1])),
        max_size=8,
    ),
    ports=st.integers(1, 2),
)
def test_a_capture_that_was_written_is_one_that_is_read(
    tmp_path: Path, name: str, times: list[int], ports: int
) -> None:
    chunks = [Chunk(t_ns, bytes([i]), port=i % ports) for i, t_ns in enumerate(times)]
    capture = Capture.of(LINE, chunks)
    path = tmp_path / "near.capture"
    with path.open("wb") as file:
        captures.write(file, capture, format=name)
    again = captures.open(path)
    assert list(again.chunks()) == list(capture.chunks())
    assert not again.damage


def test_the_files_are_what_the_library_reads(tmp_path: Path) -> None:
    records = list(StreamReader(io.BytesIO(recording()), validate_crcs=True).records)
    assert len(records) > 24
    assert parts(opened(tmp_path, recording())) == whole_parts()
    assert not opened(tmp_path, recording()).damage
