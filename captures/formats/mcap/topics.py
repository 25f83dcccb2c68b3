"""Messages of one topic out of the records of an MCAP file, whatever stands beside them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from mcap.opcode import Opcode
from mcap.records import Channel

from .records import MESSAGE, RECORD, DamagedRecordError, one_line, records_in
from .scanning import ScannedRecord, stream_of

UNDECLARED: Final = ""  # encoding of messages whose channel's declaration is lost
_HEAD: Final = MESSAGE.size - RECORD.size  # of a message, before its data


@dataclass(frozen=True, slots=True)
class TopicMessage:
    """A message of the topic that was asked for, or of a channel that is not declared; `log_time` in ns."""

    log_time: int
    encoding: str
    data: memoryview


def messages_in(record: ScannedRecord, channels: dict[int, str | None], topic: str) -> Iterator[TopicMessage]:
    """The messages in a record; DamagedRecordError ends it where there may be more.

    `channels` collects the encodings of declared channels by id, None for those of other topics.
    """
    content = memoryview(record.content)
    inner: Iterator[tuple[int, int, int]] = iter([(record.opcode, 0, len(content))])
    if record.opcode == Opcode.CHUNK:
        inner = records_in(record.content, record.packed)
    for opcode, start, end in inner:
        if opcode == Opcode.CHANNEL:
            channel = channel_in(record.content[start:end])
            channels[channel.id] = channel.message_encoding if channel.topic == topic else None
        elif opcode == Opcode.MESSAGE and end - start >= _HEAD:
            encoding = channels.get(int.from_bytes(content[start : start + 2], "little"), UNDECLARED)
            if encoding is not None:
                log_time = int.from_bytes(content[start + 6 : start + 14], "little")
                yield TopicMessage(log_time, encoding, content[start + _HEAD : end])


def channel_in(content: bytes) -> Channel:
    """A channel record inside a chunk; DamagedRecordError where it is none."""
    try:
        channel: Channel = Channel.read(stream_of(content))
    except Exception as error:  # the library's, of many kinds
        raise DamagedRecordError(f"a damaged channel: {one_line(error)}") from error
    return channel
