"""The topics of an MCAP export, live: `rtuscope sniff PORT --foxglove 8765`, then open ws://localhost:8765.

Messages and schemas are those of the file, byte for byte: the same code makes them. The library's server lets in any
page of the web; a door before it asks where a request comes from.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from captures.formats.mcap.records import HEAD, Packed
from dissectors.maps.model import RegisterMap

from ...exports.targets.mcap.recording import Topics
from ...extras import needs
from ...version import __version__
from ...webguard import refusal
from . import OutletError
from .door import Door, hidden_address

if TYPE_CHECKING:
    from captures.line import LineSettings

    from ..session import SessionStep

_VIEWERS: Final = ("https://app.foxglove.dev",)  # pages that are let in; desktop programs are no pages of the web
_BACKLOG: Final = 4096  # messages that wait for a viewer; the oldest are dropped, for that viewer alone


class Foxglove:
    """A WebSocket server with the topics of a session."""

    def __init__(
        self,
        host: str,
        port: int,
        charts: Mapping[int, RegisterMap] | None = None,
        *,
        origins: Collection[str] = (),
    ) -> None:
        """OutletError where it cannot begin. `origins`: pages besides Foxglove's own that are let in."""
        try:
            import foxglove
        except ImportError as error:
            raise OutletError(needs("--foxglove", "foxglove-sdk", "foxglove")) from error
        logging.getLogger("foxglove").addHandler(logging.NullHandler())  # a viewer that just goes is no trouble of ours
        self._writer = _Channels(foxglove)
        self._topics = Topics(self._writer, explain=False, noise=True, charts=charts)
        name, hidden = f"rtuscope {__version__}", hidden_address()
        judge = partial(refusal, listening=host, also=frozenset({*_VIEWERS, *origins}), programs=True)
        self._door = Door(host, port, judge)
        try:
            self._server = foxglove.start_server(
                name=name, host=hidden, port=0, context=self._writer.context, message_backlog_size=_BACKLOG
            )
        except Exception as error:  # the library's own kinds
            self._door.close()
            raise OutletError(f"--foxglove {host}:{port}: {error}") from error
        self._door.lead_to(hidden, int(self._server.port))

    @property
    def port(self) -> int:
        """Where it serves."""
        return self._door.port

    def feed(self, step: SessionStep, line: LineSettings) -> None:  # noqa: ARG002
        """The messages of a step."""
        if len(step.batch) or len(step.findings) or len(step.analysed.transactions):
            self._topics.batch(step.analysed, findings=step.findings)

    def close(self) -> None:
        """End the server."""
        self._door.close()
        self._server.stop()


class _Channels:
    """In place of a file's writer: schemas and channels of the server, messages to whoever looks."""

    def __init__(self, foxglove: Any) -> None:
        self._foxglove = foxglove
        self.context = foxglove.Context()
        self._schemas: list[Any] = []
        self._channels: list[Any] = []
        self._of_topic: dict[str, int] = {}

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """A new schema's number, from 1."""
        self._schemas.append(self._foxglove.Schema(name=name, encoding=encoding, data=data))
        return len(self._schemas)

    def register_channel(
        self, topic: str, message_encoding: str, schema_id: int, metadata: dict[str, str] | None = None
    ) -> int:
        """A new channel's number, from 1. A topic that goes on with a wider schema leaves its old channel."""
        if topic in self._of_topic:
            self._channels[self._of_topic[topic] - 1].close()
        channel = self._foxglove.Channel(
            topic,
            schema=self._schemas[schema_id - 1],
            message_encoding=message_encoding,
            context=self.context,
            metadata=metadata,
        )
        self._channels.append(channel)
        self._of_topic[topic] = len(self._channels)
        return len(self._channels)

    def add(self, messages: Packed) -> None:
        """Send them."""
        if not len(messages):
            return
        data = messages.data.tobytes()
        ends = [*messages.offsets[1:].tolist(), len(data)]
        columns = (messages.channels.tolist(), messages.log_times.tolist(), messages.offsets.tolist(), ends)
        for channel, log_time, begin, end in zip(*columns, strict=True):
            self._channels[channel - 1].log(data[begin + HEAD.itemsize : end], log_time=log_time)
