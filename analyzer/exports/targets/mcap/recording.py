"""The one writer of an exported MCAP: blocks and batches come, chunks of messages go to the file.

Frames, noise and transactions are messages, one each: rows of a batch come in the order of their ends, transactions
once they are settled. Findings, the causes of a capture's trouble, and the user's own bookmarks are log messages,
`foxglove.Log`: their words are made one by one, so of findings only so many of a kind are told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from captures.formats.mcap import records
from captures.formats.mcap.channel import LOG_NAME, ChunkChannel, log_message, log_schema
from captures.formats.mcap.protobuf import ENCODING, Message, packed_length
from captures.formats.mcap.records import AT_ONCE, HEAD, METADATA, Packed, PackedPart, Tails
from captures.formats.mcap.writer import ArrayWriter, TopicWriter
from captures.ragged import Ints
from captures.recording.notes import NoteChannel

from ....causes.ledger import Ledger
from ....causes.reasoning import causes_of
from ....causes.registry import Cause
from ....causes.sureness import in_words
from ....outages import notes_of
from ....tables.batch import Batch, adu_of, rows_of_findings
from ....tables.columns import Decoded, decode
from ....tables.findings import Findings, Severity, evidence, rules
from ....tables.schema import BoundaryEvidence, Kind, Protocol, Rows
from ....tables.transactions import TransactionRows
from ....usernotes import Notes, marked_rows
from ....version import __version__
from ...sink import ExportOptions, OutputStream, Sink
from . import schemas
from .schemas import LEVELS, MappedTopics, UnitAreas

if TYPE_CHECKING:
    from captures import Block, Capture
    from dissectors.maps import RegisterMap

    from ....core import Analysed

_RENAMED: Final = {"direction": "kind", "crc_ok": "check"}
_PLAIN: Final = ("index", "start", "length", "t_start_ns", "direction", "unit", "function", "crc_ok", "confidence")
_RARE: Final = ("protocol", "exception", "port", "unsure")  # left out where they are 0 on all rows
_BOUNDS: Final = ("response_time_low_ns", "response_time_high_ns", "taken_for_start")  # left out where no row has them
_OPTIONAL: Final = ("address", "quantity", "request_start", "response_time_ns", *_BOUNDS)  # absent where below 0
_FLAGS: Final = ("retry", "late", "mistaken", "unsure")  # of transactions, left out where none has them

_Columns = dict[str, NDArray[Any]]


def frame_messages(
    batch: Batch, decoded: Decoded, message: Message, channel: int, findings: Ints | None
) -> Iterator[Packed]:
    """All frames of a batch; `findings` is how many there are on each row, None for none on any."""
    frames = np.flatnonzero(batch.rows.kind != Kind.NOISE)
    exact, low, high = batch.response_times
    low, high = (np.where(exact < 0, each, -1) for each in (low, high))
    for first in range(0, len(frames), AT_ONCE):
        which = frames[first : first + AT_ONCE]
        gapless = int(which[-1]) - int(which[0]) == len(which) - 1  # no noise between: no need to pick
        pick: Any = slice(int(which[0]), int(which[-1]) + 1) if gapless else which
        rows = batch.rows[pick]
        columns: _Columns = {name: rows.column(_RENAMED.get(name, name)) for name in (*_PLAIN, *_RARE)}
        columns |= {
            "findings": np.zeros(1, np.int64) if findings is None else findings[pick],
            "address": decoded.address[pick],
            "quantity": decoded.quantity[pick],
            "request_start": rows.request_start,
            "taken_for_start": rows.taken_for_start,
            "response_time_ns": exact[pick],
            "response_time_low_ns": low[pick],
            "response_time_high_ns": high[pick],
        }
        evidence = None if batch.evidence is None else batch.evidence[pick]
        yield _packed(columns, evidence, rows.t_end_ns, _bytes(batch, which, rows), message, channel)


def _packed(
    columns: _Columns, evidence: BoundaryEvidence | None, times: Ints, tails: Tails, message: Message, channel: int
) -> Packed:
    without = {name for name in (*_RARE, "findings") if not columns[name].any()}
    without |= {name for name in _BOUNDS if (columns[name] < 0).all()}
    heads = records.heads(message.layout(HEAD, without), len(times))
    for name in (*_PLAIN, *_RARE, "findings"):
        if name not in without and name != "exception":
            heads[name] = columns[name]
    for name in _OPTIONAL:
        if name not in without:
            message.put(heads, name, columns[name], present=columns[name] >= 0)
    if "exception" not in without:
        message.put(heads, "exception", columns["exception"], present=columns["exception"] > 0)
    if evidence is not None:
        _explain(heads, message, evidence)
    heads["data"] = packed_length(tails.sizes)
    return records.packed(channel, times, [PackedPart(None, heads)], tails)


def noise_messages(batch: Batch, channel: int) -> Packed:
    """All noise of a batch."""
    rows = batch.rows[batch.rows.kind == Kind.NOISE]
    heads = records.heads(schemas.NOISE.layout(HEAD), len(rows))
    for name in ("start", "length", "t_start_ns", "port"):
        heads[name] = rows.column(_RENAMED.get(name, name))
    tails = Tails(batch.data, rows.at, rows.length)
    heads["data"] = packed_length(tails.sizes)
    return records.packed(channel, rows.t_end_ns, [PackedPart(None, heads)], tails)


def _explain(heads: NDArray[np.void], message: Message, evidence: BoundaryEvidence) -> None:
    for name in schemas.EVIDENCE:
        heads[f"evidence_{name}"] = evidence.column(name)
    kind, start = evidence.rival_kind, evidence.rival_start
    rival = (start >= 0) & (kind != Kind.NOISE)
    heads["runner_up_kind"] = np.where(rival, kind, Kind.NOISE)
    message.put(heads, "runner_up_start", start, present=rival)
    message.put(heads, "runner_up_length", evidence.rival_length, present=rival)


def _bytes(batch: Batch, which: Ints, rows: Rows) -> Tails:
    """The frames' bytes; those of ASCII mode are what their digits stand for."""
    if not (rows.protocol == Protocol.ASCII).any():
        return Tails(batch.data, rows.at, rows.length)
    adus = [adu_of(batch.bytes_of(row), int(batch.rows.protocol[row])).data for row in which.tolist()]
    sizes = np.array([len(adu) for adu in adus], np.int64)
    return Tails(np.frombuffer(b"".join(adus), np.uint8), np.cumsum(sizes) - sizes, sizes)


def transaction_messages(settled: TransactionRows, off_ns: float, message: Message, channel: int) -> Iterator[Packed]:
    """All of them in the order of their times: the start of the answer, or the end of a request that got none."""
    times = np.where(settled.response >= 0, settled.t_response_ns, settled.t_request_ns)
    if np.any(times[1:] < times[:-1]):
        order = np.argsort(times, kind="stable")
        settled, times = settled[order], times[order]
    for first in range(0, len(settled), AT_ONCE):
        block = slice(first, first + AT_ONCE)
        yield _packed_transactions(settled[block], off_ns, times[block], message, channel)


def _packed_transactions(
    settled: TransactionRows, off_ns: float, times: Ints, message: Message, channel: int
) -> Packed:
    flags = [name for name in _FLAGS if settled.column(name).any()]
    heads = records.heads(message.layout(HEAD, {*_FLAGS} - {*flags}), len(settled))
    for name in ("request", "unit", "function", "status", *flags):
        heads[name] = settled.column(name)
    message.put(heads, "response", settled.response, present=settled.response >= 0)
    exact, low, high = settled.response_times(off_ns)
    message.put(heads, "response_time_ms", exact / 1e6, present=exact >= 0)
    message.put(heads, "response_time_low_ms", low / 1e6, present=low >= 0)
    message.put(heads, "response_time_high_ms", high / 1e6, present=low >= 0)
    return records.packed(channel, times, [PackedPart(None, heads)])


MAX_OF_A_KIND: Final = 20_000  # further ones are counted on their frames, not told


class Log:
    """The findings' channel."""

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self._counts: dict[int, int] = {}  # by rule
        self._end = 0  # ns, of the rows so far
        self.left_out = 0

    def messages(self, findings: Findings, batch: Batch) -> Packed:
        """What was found about the rows of a batch, or about the bus as a whole, which comes at the end."""
        findings = findings[self._room(findings)]
        times = findings.t_ns.copy()
        if len(batch):
            self._end = max(self._end, int(batch.rows.t_end_ns.max()))
            rows = rows_of_findings(batch.rows, findings)
            times[rows >= 0] = batch.rows.t_end_ns[rows[rows >= 0]]
        times[findings.start < 0] = self._end
        order = np.argsort(times, kind="stable")
        texts = _texts(findings[order], times[order].tolist())
        sizes = np.array([len(text) for text in texts], np.int64)
        tails = Tails(np.frombuffer(b"".join(texts), np.uint8), np.cumsum(sizes) - sizes, sizes)
        heads = records.heads(np.zeros(1, [("record", HEAD)]), len(texts))
        return records.packed(self._channel, times[order], [PackedPart(None, heads)], tails)

    def _room(self, findings: Findings) -> Ints:
        """Which of these are told."""
        fitting = np.ones(len(findings), np.bool_)
        for rule in np.unique(findings.rule).tolist():
            own = np.flatnonzero(findings.rule == rule)
            before = self._counts.get(rule, 0)
            fitting[own[max(MAX_OF_A_KIND - before, 0) :]] = False
            self._counts[rule] = before + len(own)
        self.left_out += int(np.count_nonzero(~fitting))
        return np.flatnonzero(fitting)


def _texts(findings: Findings, times: list[int]) -> list[bytes]:
    """Their messages; times are in ns."""
    declared = rules()
    texts = []
    for number, figures, t_ns in zip(findings.rule.tolist(), findings.numbers.tolist(), times, strict=True):
        rule = declared[number]
        text = rule.words(rule.text, evidence(rule, figures))
        texts.append(log_message(t_ns, LEVELS[rule.severity], text, rule.code))
    return texts


CAUSES: Final = f"{METADATA}/causes"  # name of the metadata record with what explains the findings


class Stories:
    """Batches as they come; topics `/bookmarks` and, at the end, `/causes`."""

    def __init__(self, writer: ArrayWriter, capture: Capture, *, whole: bool) -> None:
        """`whole`: nothing of the bus is left out by a filter; a part of it tells no story."""
        self._writer = writer
        self._ledger = Ledger(capture.line) if whole else None
        self._notes, self._marked = Notes.of_capture(capture.path), -1  # and their channel, once there is one

    def batch(self, analysed: Analysed) -> None:
        """The next rows."""
        rows = analysed.batch.rows
        for row, comment in marked_rows(self._notes, rows.port, rows.start).items():
            self._mark(int(rows.t_end_ns[row]), int(rows.index[row]), comment)
        if self._ledger is not None:
            self._ledger.feed(analysed.batch, analysed.transactions)

    def close(self) -> None:
        """The causes, best first: as messages at the end of the capture, and whole as JSON in a metadata record."""
        if self._ledger is None:
            return
        self._ledger.close()
        if causes := causes_of(self._ledger):
            self._tell(causes, self._ledger.end)

    def _tell(self, causes: Sequence[Cause], end_ns: int) -> None:
        channel = self._channel("/causes")
        for cause in causes:
            text = f"{cause.text} ({in_words(cause.confidence)}; to confirm: {cause.deciding_test}; do: {cause.remedy})"
            message = log_message(end_ns, LEVELS[Severity[cause.severity.upper()]], text, cause.cause)
            self._writer.add_message(channel, end_ns, message, end_ns)
        lines = [orjson.dumps(cause.to_json()).decode() for cause in causes]
        names = [f"{rank:02d} {cause.cause}" for rank, cause in enumerate(causes, 1)]
        self._writer.add_metadata(CAUSES, dict(zip(names, lines, strict=True)))

    def _mark(self, t_ns: int, index: int, comment: str) -> None:
        if self._marked < 0:
            self._marked = self._channel("/bookmarks")
        message = log_message(
            t_ns, LEVELS[Severity.NOTE], comment or "bookmark", f"frame {index}" if index >= 0 else "noise"
        )
        self._writer.add_message(self._marked, t_ns, message, t_ns)

    def _channel(self, topic: str) -> int:
        schema = self._writer.register_schema(LOG_NAME, ENCODING, log_schema())
        return self._writer.register_channel(topic, ENCODING, schema)


LEFT_OUT: Final = f"{METADATA}/left out"  # name of the metadata record that says what is not on any topic


class Topics:
    """The topics of what was analysed, as messages."""

    def __init__(
        self, writer: TopicWriter, *, explain: bool, noise: bool, charts: Mapping[int, RegisterMap] | None
    ) -> None:
        self._writer = writer
        self._frame, self._transaction = schemas.frame(explain=explain), schemas.transaction()
        self._frames = self._channel("/frames", self._frame)
        self._transactions = self._channel("/transactions", self._transaction)
        schema = writer.register_schema(LOG_NAME, ENCODING, log_schema())
        self._log = Log(writer.register_channel("/findings", ENCODING, schema))
        self._noise = self._channel("/noise", schemas.NOISE) if noise else None
        self._values = UnitAreas(writer)
        self._mapped = MappedTopics(writer, charts) if charts else None

    def batch(self, analysed: Analysed, findings: Findings | None = None) -> None:
        """A chunk or more of each topic, so that who reads one topic does not unpack the others.

        `findings`: those that are told, where they are others than those on the batch's rows.
        """
        batch = analysed.batch
        findings = batch.findings if findings is None else findings
        decoded = decode(batch)
        add = self._writer.add
        for messages in transaction_messages(
            analysed.transactions, analysed.off_ns, self._transaction, self._transactions
        ):
            add(messages)
        counts = batch.finding_counts if len(batch.finding_rows) else None
        for messages in frame_messages(batch, decoded, self._frame, self._frames, counts):
            add(messages)
        add(self._values.messages(batch, decoded))
        if self._mapped is not None and (mapped := self._mapped.messages(batch, decoded)) is not None:
            add(mapped)
        if self._noise is not None:
            add(noise_messages(batch, self._noise))
        if findings is not None:
            add(self._log.messages(findings, batch))

    def left_out(self) -> dict[str, str]:
        """What is on no topic, in words."""
        left_out = {
            "values": f"{self._values.left_out} messages: too many addresses" if self._values.left_out else "",
            "findings": f"{self._log.left_out} messages: too many of a kind" if self._log.left_out else "",
        }
        return {key: words for key, words in left_out.items() if words}

    def _channel(self, topic: str, message: Message) -> int:
        schema = self._writer.register_schema(message.name, ENCODING, message.schema())
        return self._writer.register_channel(topic, ENCODING, schema)


class Recording(Sink):
    """A sink (`analyzer.exports.sink`) onto one file."""

    def __init__(self, out: OutputStream, capture: Capture, options: ExportOptions) -> None:
        self._writer = ArrayWriter(out)
        self._writer.start(library=f"rtuscope {__version__}")
        self._chunks = ChunkChannel(self._writer, capture.line, timed=capture.timed, about=_about(capture))
        self._topics = Topics(self._writer, explain=options.explain, noise=options.noise, charts=options.charts)
        self._stories = Stories(self._writer, capture, whole=options.filter is None)
        if notes := notes_of(capture):
            channel = NoteChannel(self._writer)
            for note in notes:
                channel.write(note)

    def block(self, block: Block) -> None:
        """Raw chunks."""
        self._chunks.write(block)

    def batch(self, analysed: Analysed) -> None:
        """All topics of a batch."""
        self._topics.batch(analysed)
        self._stories.batch(analysed)

    def close(self) -> None:
        """The causes, what is left out, and the index."""
        self._stories.close()
        if left_out := self._topics.left_out():
            self._writer.add_metadata(LEFT_OUT, left_out)
        self._writer.finish()


def _about(capture: Capture) -> dict[str, str]:
    return {
        "tool": f"rtuscope {__version__}",
        "source_format": capture.format,
        "time_base": "ns on the capture's clock; log_time of a frame is its last stop bit"
        if capture.timed
        else "none: the capture has no times",
    }
