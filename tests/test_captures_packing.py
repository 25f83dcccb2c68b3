"""Messages packed as arrays, against the mcap library that writes them one by one; and protobuf against its library."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, Writer

from captures.formats.mcap import records
from captures.formats.mcap.protobuf import (
    PLAIN,
    Message,
    MessageField,
    Type,
    fields_in,
    packed_length,
    plain_items,
    plain_schema,
)
from captures.formats.mcap.records import HEAD, PackedPart, Tails, packed
from captures.formats.mcap.writer import ArrayWriter
from captures.ragged import copy_pieces, copy_spilling


@dataclass(frozen=True)
class One:
    """A message as the test makes it: its channel, time and data."""

    channel: int
    time: int
    data: bytes


# A data byte of 0 at the end of a head would be lost in numpy's type for bytes, so there is none.
octets = st.binary(min_size=2, max_size=40).map(lambda data: data.replace(b"\0", b"\1"))
ones = st.lists(st.builds(One, st.integers(1, 4), st.integers(-5, 2**62), octets), max_size=60)


def records_of(messages: list[One], split: int) -> records.Packed:
    """The messages by arrays: their first bytes as heads of one width or two, the rest as tails."""
    widths = np.array([1 + (i % 2 if split else 0) for i in range(len(messages))])
    parts = []
    for width in (1, 2):
        which = np.flatnonzero(widths == width)
        heads = records.heads(np.zeros(1, [("record", HEAD), ("first", f"S{width}")]), len(which))
        heads["first"] = [messages[i].data[:width] for i in which]
        parts.append(PackedPart(which, heads))
    rests = [message.data[width:] for message, width in zip(messages, widths.tolist(), strict=True)]
    sizes = np.array([len(rest) for rest in rests], np.int64)
    tails = Tails(np.frombuffer(b"".join(rests), np.uint8), np.cumsum(sizes) - sizes, sizes)
    channels, times = (np.array([getattr(m, name) for m in messages], np.int64) for name in ("channel", "time"))
    return packed(channels, times, parts, tails)


def started(writer: Any) -> Any:
    writer.start(library="test")
    schema = writer.register_schema("any", "", b"")
    for number in range(1, 5):
        writer.register_channel(f"/{number}", "", schema)
    return writer


def told(content: bytes, reader: Any) -> list[tuple[str, int, bytes]]:
    return [(c.topic, m.log_time, bytes(m.data)) for _, c, m in reader(io.BytesIO(content), validate_crcs=True)]


def in_sequence(file: Any, **options: Any) -> Any:
    return NonSeekingReader(file, **options).iter_messages(log_time_order=False)


def by_index(file: Any, **options: Any) -> Any:
    return make_reader(file, **options).iter_messages()


@given(messages=ones, split=st.integers(0, 1), size=st.sampled_from([1, 200, 1 << 20]))
def test_packed_messages_are_what_single_ones_would_be(messages: list[One], split: int, size: int) -> None:
    mine, theirs = io.BytesIO(), io.BytesIO()
    writer = started(ArrayWriter(mine, chunk_size=size, compression=""))
    writer.add(records_of(messages, split))
    writer.finish()
    plain = started(Writer(theirs, compression=CompressionType.NONE))
    for m in messages:
        plain.add_message(m.channel, max(m.time, 0), m.data, max(m.time, 0))
    plain.finish()
    assert told(mine.getvalue(), in_sequence) == told(theirs.getvalue(), in_sequence)
    assert sorted(told(mine.getvalue(), by_index)) == sorted(told(theirs.getvalue(), by_index))
    ours, other = (make_reader(io.BytesIO(f.getvalue())).get_summary() for f in (mine, theirs))
    assert ours is not None and other is not None and ours.statistics is not None and other.statistics is not None
    for name in ("message_count", "message_start_time", "message_end_time", "channel_count", "schema_count"):
        assert getattr(ours.statistics, name) == getattr(other.statistics, name), name
    assert dict(ours.statistics.channel_message_counts) == dict(other.statistics.channel_message_counts)
    assert [repr(channel) for channel in ours.channels.values()] == [repr(each) for each in other.channels.values()]
    assert [repr(schema) for schema in ours.schemas.values()] == [repr(each) for each in other.schemas.values()]
    if size == 1:
        assert len(ours.chunk_indexes) == len(messages)


def class_of(name: str, schema: bytes) -> Any:
    """The class that protobuf's library makes of a schema."""
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema).file:
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(name))


EVERY = Message(
    "test.Every",
    (
        *(
            MessageField(f"{kind.name.lower()}_{i}", kind, optional=i == 1)
            for kind in Type
            if kind < Type.STRING
            for i in (0, 1)
        ),
        MessageField("signed", Type.SFIXED32),
        MessageField("long", Type.SFIXED64, optional=True),
        MessageField("colour", Type.ENUM, names={"none": 0, "red": 1}),
        MessageField("other_colour", Type.ENUM, names={"none": 0, "red": 1}),
        MessageField("late", Type.FIXED32, optional=True),
        MessageField("far", Type.BOOL),
        MessageField("farther", Type.DOUBLE, optional=True),
        MessageField("text", Type.STRING),
    ),
)


@given(data=st.data(), present=st.lists(st.booleans(), min_size=20, max_size=20))
def test_rows_are_messages_that_protobuf_s_own_library_reads(data: st.DataObject, present: list[bool]) -> None:
    kind = class_of(EVERY.name, EVERY.schema())
    row = EVERY.layout().copy()
    expected: dict[str, Any] = {}
    for field, there in zip(EVERY.fields[:-1], present, strict=False):
        limit = 1 if field.type in (Type.BOOL, Type.ENUM) else 2**31 - 1
        value = data.draw(st.integers(0, limit) if field.type != Type.FLOAT else st.integers(0, 1000))
        if field.optional:
            EVERY.put(row, field.name, value, present=np.array([there]))
        else:
            row[field.name] = value
        expected[field.name] = value if there or not field.optional else None
    text = data.draw(st.text(max_size=300)).encode()
    row["text"] = packed_length([len(text)])
    message = kind.FromString(row.tobytes() + text)
    assert message.text == text.decode()
    for field in EVERY.fields[:-1]:
        if field.optional:
            assert message.HasField(field.name) == (expected[field.name] is not None), field.name
        if expected[field.name] is not None:
            assert getattr(message, field.name) == expected[field.name], field.name


@given(st.lists(st.integers(0, (1 << 28) - 1), min_size=1))
def test_padded_lengths_are_varints(sizes: list[int]) -> None:
    found = packed_length(sizes).astype("<u4").tobytes()
    for i, size in enumerate(sizes):
        piece = found[4 * i : 4 * i + 4]
        assert sum((byte & 0x7F) << 7 * k for k, byte in enumerate(piece)) == size
        assert [byte >> 7 for byte in piece] == [1, 1, 1, 0]


@given(st.binary(max_size=60))
def test_any_bytes_are_fields_or_refused(content: bytes) -> None:
    try:
        found = list(fields_in(content))
    except ValueError:
        return
    assert all(isinstance(value, int) or len(value) <= len(content) for _, value in found)


@given(st.lists(st.integers(0, 90), max_size=40), st.randoms(use_true_random=False))
def test_pieces_go_to_their_places(sizes: list[int], random: Any) -> None:
    data = np.frombuffer(random.randbytes(100), np.uint8)
    begins = np.array([random.randrange(101 - size) for size in sizes], np.int64)
    lengths = np.array(sizes, np.int64)
    at = np.cumsum(lengths) - lengths
    out = np.zeros(int(lengths.sum()), np.uint8)
    copy_pieces(out, at, data, begins, lengths)
    whole = data.tobytes()
    assert out.tobytes() == b"".join(whole[b : b + n] for b, n in zip(begins.tolist(), sizes, strict=True))


@given(st.lists(st.integers(0, 90) | st.integers(65_500, 65_600), max_size=12), st.randoms(use_true_random=False))
def test_spilling_leaves_the_pieces_and_what_is_written_later(sizes: list[int], random: Any) -> None:
    """As heads stand between tails: 15 bytes between pieces, written when the pieces are there."""
    whole = bytes(range(251)) * 263
    begins = np.array([random.randrange(len(whole) + 1 - size) for size in sizes], np.int64)
    lengths = np.array(sizes, np.int64)
    at = np.cumsum(lengths + 15) - lengths
    out = np.zeros(int((lengths + 15).sum()), np.uint8)
    copy_spilling(out, at, np.frombuffer(whole, np.uint8), begins, lengths)
    for place in at.tolist():
        out[place - 15 : place] = 7
    pieces = (b"\7" * 15 + whole[b : b + n] for b, n in zip(begins.tolist(), sizes, strict=True))
    assert out.tobytes() == b"".join(pieces)


@pytest.mark.parametrize("kind", [Type.FIXED32, Type.BOOL])
@pytest.mark.parametrize("count", [1, 125, PLAIN])
def test_plain_items_are_messages_of_their_schema(kind: Type, count: int) -> None:
    names = [f"r{address}" for address in range(9_990, 9_990 + count)]
    message = class_of("rtuscope.x", plain_schema("rtuscope.x", names, kind))
    values = np.arange(count) % (2 if kind is Type.BOOL else 60_000)
    read = message.FromString(plain_items(kind, np.arange(count), values).tobytes())
    assert [int(getattr(read, name)) for name in names] == values.tolist()


def test_there_are_only_so_many_channels() -> None:
    writer = ArrayWriter(io.BytesIO())
    for i in range(65535):
        writer.register_channel(f"/{i}", "", 0)
    with pytest.raises(ValueError, match="65535"):
        writer.register_channel("/more", "", 0)
