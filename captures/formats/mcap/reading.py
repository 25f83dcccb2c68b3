"""Raw chunks out of an MCAP file: what it holds, and of what is lost from when to when it was heard."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import orjson
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from ...chunks import Block, Note
from ...errors import CaptureError
from ...files import opened
from ...limits import TIME_LIMIT
from ...line import LineSettings
from .channel import UNDECLARED, TopicMessage, block_of, channel_in, messages_in
from .protobuf import ENCODING
from .records import MAGIC, METADATA, TOPIC, DamagedRecordError, one_line, records_in
from .scanning import FileBytes, Loss, ScannedRecord, read_summary, stream_of, walk

if TYPE_CHECKING:
    from ...recording.notes import Note as LineNote

_EPOCH_NS: Final = 10**17  # times after 1973 are a clock's
_HEAD_BYTES: Final = 1 << 12  # in which a file's metadata stand


@dataclass(frozen=True, slots=True)
class _McapSource:
    """The raw chunks of a file (`captures.chunks.Source`)."""

    path: Path
    line: LineSettings
    timed: bool
    complaints: tuple[str, ...]

    def notes(self) -> list[LineNote]:
        from ...recording.notes import read

        return read(self.path)

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        for complaint in self.complaints:
            note(f"metadata {METADATA!r}", complaint)
        losses = _Losses(note, self.timed)
        waiting: list[Block] = []
        size = 0
        with opened(self.path) as file:
            for item in _blocks_and_losses(FileBytes(file), self.timed, note):
                if isinstance(item, Loss):
                    losses.add(item)
                    continue
                if waiting and (losses.pending or size >= max_bytes):
                    yield Block.joined(waiting)
                    waiting, size = [], 0
                losses.end(item)
                waiting.append(item)
                size += len(item.data)
        if waiting:
            yield Block.joined(waiting)
        losses.end(None)


def read_source(path: Path) -> _McapSource:
    """The raw chunks of a file; CaptureError where it has none."""
    with opened(path) as file:
        data = FileBytes(file)
        begins = data.read(0, len(MAGIC)) == MAGIC
        settings = _settings(data)
    if settings is None and not begins:
        raise CaptureError(f"{path}: not an MCAP file, or damaged at its beginning")
    if settings is None:
        raise CaptureError(
            f"{path}: an MCAP file without raw bytes (no channel {TOPIC}): it was not recorded or exported by "
            "rtuscope, or was cut off before its settings"
        )
    try:
        header = orjson.loads(settings.get("line", "{}"))
    except orjson.JSONDecodeError:
        header = None
    if not isinstance(header, dict):
        return _McapSource(path, LineSettings(), True, ("the line settings are damaged and unknown",))
    line, complaints = LineSettings.from_header(header)
    return _McapSource(path, line, settings.get("timed") != "false", tuple(complaints))


def first_metadata(path: Path) -> dict[str, str]:
    """What a file of this tool says of itself at its beginning; nothing where it says nothing, or cannot be read."""
    with suppress(CaptureError), opened(path) as file:
        first = next(iter(walk(FileBytes(file, block=_HEAD_BYTES), None, _ignore)), None)
        if isinstance(first, ScannedRecord) and first.opcode == Opcode.METADATA:
            return _settings_record_in(first) or {}
    return {}


def log_time_span(path: Path) -> int:
    """From the first log time in a file to the last by its summary, ns; 0 where it has none."""
    with suppress(CaptureError), opened(path) as file:
        summary = read_summary(FileBytes(file, block=_HEAD_BYTES), TOPIC)
        return summary.span_ns if summary is not None else 0
    return 0


def _settings(data: FileBytes) -> dict[str, str] | None:
    """The settings record, or else those of the channel, empty text for lost ones; None in a file of other origin."""
    first = next(iter(walk(data, None, _ignore)), None)  # where this tool writes them
    if isinstance(first, ScannedRecord) and (settings := _settings_record_in(first)) is not None:
        return settings
    summary = read_summary(data, TOPIC)
    if summary is not None:
        if not any(summary.channels.values()):
            return None
        if "line" in summary.settings:
            return dict(summary.settings)
    channels = dict(summary.channels) if summary else {}
    ours = summary is not None
    for item in walk(data, summary, _ignore):
        if isinstance(item, Loss):
            continue
        if (settings := _settings_record_in(item)) is not None:
            return settings
        with suppress(DamagedRecordError):
            for message in messages_in(item, channels, TOPIC):
                ours = ours or _block(message, True) is not None
    return {"line": ""} if ours else None


def _settings_record_in(record: ScannedRecord) -> dict[str, str] | None:
    """Settings that a metadata record says, or the declaration of the channel."""
    if record.opcode == Opcode.METADATA:
        metadata = Metadata.read(stream_of(record.content))
        return dict(metadata.metadata) if metadata.name == METADATA else None
    if record.opcode == Opcode.CHANNEL:
        channel = Channel.read(stream_of(record.content))
        return dict(channel.metadata) if channel.topic == TOPIC else None
    if record.opcode == Opcode.CHUNK:
        with suppress(DamagedRecordError):
            for opcode, start, end in records_in(record.content, record.packed):
                if opcode == Opcode.CHANNEL:
                    channel = channel_in(record.content[start:end])
                    if channel.topic == TOPIC:
                        return dict(channel.metadata)
    return None


def _ignore(where: str, what: str) -> None:
    """For a first look, whose damage the reading itself will note."""


def _blocks_and_losses(data: FileBytes, timed: bool, note: Note) -> Iterator[Block | Loss]:
    """A block a message, in the order of the file, and in their places what cannot be given."""
    summary = read_summary(data, TOPIC)
    channels = dict(summary.channels) if summary else {}
    messages, whole = 0, True
    for item in walk(data, summary, note):
        if isinstance(item, Loss):
            whole = False
            yield item
            continue
        try:
            for message in messages_in(item, channels, TOPIC):
                messages += 1
                try:
                    block = _block(message, timed)
                except ValueError as error:
                    yield Loss(item.at, f"a damaged message on {TOPIC} ({one_line(error)})", message.log_time)
                else:
                    if block is not None:
                        yield block
        except DamagedRecordError as error:
            whole = False
            yield Loss(item.at, f"a damaged chunk ({error})")
    if whole and summary is not None and summary.messages is not None and messages < summary.messages:
        note("its summary", f"{summary.messages - messages} of {summary.messages} messages on {TOPIC} are missing")


def _block(message: TopicMessage, timed: bool) -> Block | None:
    """The chunks of a message, None where there are none; ValueError where it is damaged.

    A message whose channel's declaration is lost is one of chunks if it reads as such and its times agree.
    """
    if message.encoding != UNDECLARED:
        block = block_of(message.data, message.encoding, timed)
        return block if len(block) else None
    try:
        block = block_of(message.data, "json" if bytes(message.data[:1]) == b"{" else ENCODING, True)
    except ValueError:
        return None
    if not len(block) or max(int(block.t_ns[0]), 0) != message.log_time:
        return None
    return block if timed else block_of(message.data, ENCODING, False)


class _Losses:
    """Tells what is lost: one line for all that is lost between two blocks."""

    def __init__(self, note: Note, timed: bool) -> None:
        self.pending: list[Loss] = []
        self._note, self._timed = note, timed
        self._newest: int | None = None  # time of what was given

    def add(self, loss: Loss) -> None:
        """Something is lost here."""
        self.pending.append(loss)

    def end(self, following: Block | None) -> None:
        """This block comes next; None at the end."""
        if self.pending:
            first = self.pending[0]
            more = f", and {len(self.pending) - 1} more" if len(self.pending) > 1 else ""
            self._note(f"byte {first.at}", f"{first.what}{more}: {self._span(following)}")
            self.pending = []
        if following is not None:
            newest = int(following.t_ns.max())
            self._newest = newest if self._newest is None else max(newest, self._newest)

    def _span(self, following: Block | None) -> str:
        begin, end = self._newest, None if following is None else int(following.t_ns.min())
        if end is None:
            end = max((loss.last_ns for loss in self.pending if loss.last_ns is not None), default=None)
        lost = "may be lost" if all(loss.last_ns is None for loss in self.pending) else "is lost"
        if not self._timed or (begin is None and end is None):
            return f"what it held {lost}"
        if begin is None or end is None:
            bound = f"before {_moment(end)}" if end is not None else f"after {_moment(begin or 0)}"
            return f"data received {bound} {lost}"
        return f"data received between {_moment(begin)} and {_moment(end)} {lost}"


def _moment(t_ns: int) -> str:
    """A time as UTC, or in seconds where it is the capture's own."""
    if t_ns > _EPOCH_NS:
        return f"{np.datetime64(min(t_ns, TIME_LIMIT), 'ns').astype('datetime64[ms]')}Z"
    return f"{t_ns / 1e9:.3f} s"
