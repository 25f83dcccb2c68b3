"""MCAP: what other programs find in our files, damage that costs only what it hit, and files that are not ours."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory

import captures
from captures import Block, Capture, CaptureError, Chunk, LineSettings, Mark
from captures.formats.mcap.channel import CHUNK_MESSAGE, ChunkChannel
from captures.formats.mcap.records import METADATA, TOPIC
from captures.formats.mcap.writer import COMPRESSIONS, ArrayWriter

LINE = LineSettings(baud=19200, char_bits=11, tap="irq", notes={"source": "test"})
SECOND = 1_000_000_000


def shared_file(blocks: list[Block], *, chunk_size: int = 1 << 20, metadata: bool = True) -> bytes:
    """A file as an exporter makes it: our channel beside another one."""
    file = io.BytesIO()
    writer = Writer(file, chunk_size=chunk_size)
    writer.start(library="test")
    ours = ChunkChannel(writer, LINE, about={"tool": "rtuscope 9"}) if metadata else None
    other = writer.register_channel("/other", "json", 0)
    for i, block in enumerate(blocks):
        writer.add_message(other, i, b'{"n": %d}' % i, i)
        if ours is not None:
            ours.write(block)
    writer.finish()
    return file.getvalue()


def decoded(schema: Any, message: Any) -> Any:
    """A message as protobuf's own library reads it by the schema in the file."""
    decode = DecoderFactory().decoder_for("protobuf", schema)
    assert decode is not None
    return decode(message.data)


def old_file(messages: list[object]) -> bytes:
    """A file as releases of before wrote it: messages in JSON."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(library="test")
    writer.add_metadata(METADATA, {"line": '{"baud": 9600}', "timed": "true"})
    channel = writer.register_channel(TOPIC, "json", 0)
    for message in messages:
        writer.add_message(channel, 0, json.dumps(message).encode(), 0)
    writer.finish()
    return file.getvalue()


def some_blocks(count: int = 6) -> list[Block]:
    return [
        Block.from_chunks([Chunk(i * SECOND + k, bytes((i, k)) * 200, port=1) for k in range(50)]) for i in range(count)
    ]


def opened(path: Path, content: bytes) -> Capture:
    path.write_bytes(content)
    return captures.open(path)


def test_any_reader_finds_schema_messages_times_and_metadata() -> None:
    reader = make_reader(io.BytesIO(shared_file(some_blocks(1))))
    metadata = {record.name: record.metadata for record in reader.iter_metadata()}[METADATA]
    assert metadata["baud"] == "19200"
    assert metadata["tool"] == "rtuscope 9"
    found = list(reader.iter_messages(topics=[TOPIC]))
    schema, channel, message = found[0]
    assert schema is not None
    assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
    content = decoded(schema, message)
    assert message.log_time == content.t_ns
    assert list(content.after_ns[:3]) == [0, 1, 2]
    assert len(content.data) == sum(content.sizes)
    assert set(content.port) == {1}


def test_messages_hold_at_most_ten_seconds_and_some_16_kib() -> None:
    chunks = [Chunk(i * 10 * SECOND // 3, bytes(9000)) for i in range(30)]
    messages = make_reader(io.BytesIO(shared_file([Block.from_chunks(chunks)]))).iter_messages(topics=[TOPIC])
    contents = [decoded(schema, message) for schema, _, message in messages]
    assert len(contents) > 5
    assert all(sum(content.sizes) <= 9000 + (1 << 14) and content.after_ns[-1] < 10 * SECOND for content in contents)
    assert sum(len(content.sizes) for content in contents) == 30


def test_a_file_shared_with_other_channels_gives_the_same_capture(tmp_path: Path) -> None:
    blocks = some_blocks()
    capture = opened(tmp_path / "shared.mcap", shared_file(blocks))
    assert capture.line == LINE
    assert list(capture.chunks()) == [block.chunk(i) for block in blocks for i in range(len(block))]
    assert not capture.damage


def test_a_damaged_chunk_costs_only_itself(tmp_path: Path) -> None:
    content = bytearray(shared_file(some_blocks(), chunk_size=4000))
    whole = list(opened(tmp_path / "whole.mcap", bytes(content)).chunks())
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    second = summary.chunk_indexes[1]
    content[second.chunk_start_offset + second.chunk_length // 2] ^= 0xFF
    capture = opened(tmp_path / "damaged.mcap", bytes(content))
    given = list(capture.chunks())
    assert 0 < len(given) < len(whole)
    assert [chunk for chunk in whole if chunk in given] == given
    assert [damage.where for damage in capture.damage] == [f"byte {second.chunk_start_offset}"]


def test_a_file_cut_between_chunks_says_that_it_has_no_end(tmp_path: Path) -> None:
    content = shared_file(some_blocks(), chunk_size=4000)
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    start = summary.chunk_indexes[2].chunk_start_offset
    capture = opened(tmp_path / "cut.mcap", content[:start])
    assert 0 < len(list(capture.chunks())) < 300
    assert f"file ends at byte {start} without a footer" in capture.damage[0].what


def test_settings_survive_the_loss_of_the_metadata_record(tmp_path: Path) -> None:
    """Other tools copy channels without metadata records; the channel has the settings too."""
    source = make_reader(io.BytesIO(shared_file(some_blocks(1))))
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(library="copy")
    ids: dict[int, int] = {}
    for schema, channel, message in source.iter_messages():
        if channel.id not in ids:
            schema_id = writer.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
            encoding = channel.message_encoding
            ids[channel.id] = writer.register_channel(channel.topic, encoding, schema_id, dict(channel.metadata))
        writer.add_message(ids[channel.id], message.log_time, message.data, message.publish_time)
    writer.finish()
    capture = opened(tmp_path / "copy.mcap", file.getvalue())
    assert capture.line == LINE
    assert len(list(capture.chunks())) == 50


def test_what_is_no_mcap_is_not_called_one(tmp_path: Path) -> None:
    path = tmp_path / "bus.mcap"
    path.write_bytes(bytes(range(1, 256)) * 12)
    with pytest.raises(CaptureError, match="not an MCAP file"):
        captures.open(path)


@pytest.mark.parametrize("cut", [0, 40])
def test_an_mcap_of_another_origin_is_refused_in_a_line(tmp_path: Path, cut: int) -> None:
    content = shared_file(some_blocks(1), metadata=False)
    with pytest.raises(CaptureError, match="without raw bytes"):
        opened(tmp_path / "foreign.mcap", content[: len(content) - cut])


@pytest.mark.parametrize(
    "message",
    [
        {"t_ns": 0, "after_ns": [0], "sizes": [2], "data": "EQ=="},
        {"t_ns": 0, "after_ns": [0, 1], "sizes": [1], "data": "EQ=="},
        {"t_ns": 0, "after_ns": [0], "sizes": [1], "data": "!!"},
        {"t_ns": 1 << 62, "after_ns": [0], "sizes": [1], "data": "EQ=="},
        {"t_ns": 0, "after_ns": [0], "sizes": [1], "data": "EQ==", "errors": [1]},
        {"t_ns": 0, "after_ns": [0], "sizes": [1], "data": "EQ==", "mark": [3]},
        {"t_ns": 0, "after_ns": [[0]], "sizes": [1], "data": "EQ=="},
        {"t_ns": "soon"},
        [],
        None,
    ],
)
def test_a_message_in_json_that_is_not_as_its_schema_says_is_left_out(tmp_path: Path, message: object) -> None:
    good = {"t_ns": 5, "after_ns": [0], "sizes": [1], "data": "YQ=="}
    capture = opened(tmp_path / "odd.mcap", old_file([message, good]))
    assert list(capture.chunks()) == [Chunk(5, b"a")]
    assert capture.damage_count == 1


@pytest.mark.parametrize(
    "message",
    [
        {"sizes": [2], "after_ns": [0], "data": b"a"},
        {"sizes": [1], "after_ns": [0, 1], "data": b"a"},
        {"sizes": [1, 0], "after_ns": [0, 1], "data": b"a"},
        {"sizes": [1], "after_ns": [0], "data": b"a", "t_ns": 1 << 62},
        {"sizes": [1], "after_ns": [0], "data": b"a", "errors": [1]},
        {"sizes": [1], "after_ns": [0], "data": b"a", "mark": b"\3"},
        {"sizes": [1], "after_ns": [0], "data": b"a", "port": b"\0\0"},
        b"\x09\0\0",
        b"\x0b",
        b"\x0a\x01\0",
        b"\x22\xff",
        b"\x20\x01",
        b"\x80" * 12,
    ],
)
def test_a_message_that_is_not_as_its_schema_says_is_left_out(tmp_path: Path, message: dict[str, Any] | bytes) -> None:
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(library="test")
    ours = ChunkChannel(writer, LINE)
    if isinstance(message, dict):
        kind = GetMessageClass(schema_pool(CHUNK_MESSAGE.schema()).FindMessageTypeByName("rtuscope.Chunks"))
        message = kind(**message).SerializeToString()
    writer.add_message(1, 0, message, 0)
    ours.write(Block.from_chunks([Chunk(5, b"a")]))
    writer.finish()
    capture = opened(tmp_path / "odd.mcap", file.getvalue())
    assert list(capture.chunks()) == [Chunk(5, b"a")]
    assert capture.damage_count == 1


def schema_pool(schema: bytes) -> DescriptorPool:
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return pool


def test_files_with_messages_in_json_are_read(tmp_path: Path) -> None:
    message = {"t_ns": -5, "after_ns": [0, 9], "sizes": [1, 2], "data": "YWJj", "port": [0, 3], "mark": [1, 2]}
    capture = opened(tmp_path / "old.mcap", old_file([{**message, "errors": [2]}]))
    assert capture.line.baud == 9600
    assert list(capture.chunks()) == [Chunk(-5, b"a", mark=Mark.TX), Chunk(4, b"bc", 3, Mark.RX, (1,))]
    assert not capture.damage


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_the_writer_by_arrays_gives_what_the_library_s_gives(tmp_path: Path, compression: str) -> None:
    blocks = some_blocks()
    file = io.BytesIO()
    writer = ArrayWriter(file, chunk_size=4000, compression=compression)
    writer.start(library="test")
    ours = ChunkChannel(writer, LINE)
    for block in blocks:
        ours.write(block)
    writer.finish()
    theirs = read_whole(shared_file(blocks, chunk_size=4000))
    mine = read_whole(file.getvalue())
    assert mine == [message for message in theirs if message[0] == TOPIC]
    assert list(opened(tmp_path / "mine.mcap", file.getvalue()).chunks()) == [
        block.chunk(i) for block in blocks for i in range(len(block))
    ]


def read_whole(content: bytes) -> list[tuple[str, int, int, bytes]]:
    """Every message, read by index and in sequence with all CRCs checked; both must agree."""
    indexed = make_reader(io.BytesIO(content), validate_crcs=True)
    found = [(c.topic, m.log_time, m.sequence, bytes(m.data)) for _, c, m in indexed.iter_messages()]
    stream = NonSeekingReader(io.BytesIO(content), validate_crcs=True)
    assert found == [(c.topic, m.log_time, m.sequence, bytes(m.data)) for _, c, m in stream.iter_messages()]
    summary = indexed.get_summary()
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == len(found)
    assert summary.statistics.message_start_time == min(message[1] for message in found)
    assert summary.statistics.message_end_time == max(message[1] for message in found)
    return found


def test_what_was_flushed_is_there_whatever_follows(tmp_path: Path) -> None:
    blocks = some_blocks()
    file = io.BytesIO()
    writer = ArrayWriter(file)
    writer.start(library="test")
    ours = ChunkChannel(writer, LINE)
    for i, block in enumerate(blocks):
        ours.write(block)
        writer.flush()
        capture = opened(tmp_path / "live.mcap", file.getvalue())
        assert len(list(capture.chunks())) == 50 * (i + 1)
        assert capture.line == LINE


def test_chunks_of_other_channels_are_not_unpacked(tmp_path: Path) -> None:
    """Damage in what is no concern of ours goes unnoticed where a summary with a right CRC says whose chunk it is."""
    file = io.BytesIO()
    writer = ArrayWriter(file, chunk_size=1000)
    writer.start(library="test")
    ours = ChunkChannel(writer, LINE)
    first, second = some_blocks(2)
    ours.write(first)
    writer.flush()
    other = writer.register_channel("/other", "json", 0)
    writer.add_message(other, 7, b"x" * 2000, 7)
    ours.write(second)
    writer.finish()
    content = bytearray(file.getvalue())
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    (index,) = (index for index in summary.chunk_indexes if list(index.message_index_offsets) == [other])
    content[index.chunk_start_offset + index.chunk_length - 3] ^= 0xFF
    capture = opened(tmp_path / "whole.mcap", bytes(content))
    assert len(list(capture.chunks())) == 100
    assert not capture.damage
    cut = opened(tmp_path / "cut.mcap", bytes(content[:-1]))
    assert len(list(cut.chunks())) == 100
    assert cut.damage_count == 2  # the damaged chunk, and the end


def test_negative_times_are_kept(tmp_path: Path) -> None:
    chunks = [Chunk(-5, b"a"), Chunk(7, b"b")]
    captures.write(tmp_path / "negative.mcap", chunks)
    assert list(captures.open(tmp_path / "negative.mcap").chunks()) == chunks
