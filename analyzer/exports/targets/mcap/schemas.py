"""The messages of an exported MCAP: their schemas in the file and their bytes, from one declaration (docs/mcap.md).

Field names are a contract; field numbers follow from the order, so a new field goes last, before the text. Numbers are
of fixed width and a message has all its fields, so that a million are packed as columns. What a frame does not have (a
request's response time) is absent rather than -1, which a plot would show.

Register and bit values are messages for plots without a script. As they are: a channel a unit and area, a field an
address. An answer to a read carries values; an answer to a write confirms those of its request. A message has the
fields of its answer alone. The fields of a topic are the addresses met so far; where a later batch brings more, the
topic goes on in a channel whose schema has those too, every field under the number that it had.

By register maps: a topic a value, `/unit/13/values/Active_power`, a number in the unit of measure. The unit stands in
the name of the schema (`rtuscope.Value_kW`), the name, the address and the map's words in the metadata of the channel.
States and bits are numbers; texts and what has no number are on no topic.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.formats.mcap import records
from captures.formats.mcap.protobuf import ENCODING, Message, MessageField, Type, plain_items, plain_schema
from captures.formats.mcap.records import HEAD, Packed, PackedPart, Tails
from captures.formats.mcap.writer import TopicWriter
from captures.ragged import Bytes, Ints, sums
from dissectors.functions import functions
from dissectors.maps import RegisterMap
from dissectors.maps.model import MappedValue

from ....registers.readings import mapped_columns
from ....tables.batch import Batch
from ....tables.columns import AreaCode, Decoded
from ....tables.findings import Severity
from ....tables.schema import Kind, Protocol
from ....tables.transactions import Status
from ....tables.values import ConfirmedValues, confirmed_values

EVIDENCE: Final = ("length", "crc", "silence", "conversation", "margin")


def frame(*, explain: bool = False) -> Message:
    """One frame; log_time is its last stop bit. With `explain`, why its boundaries stand where they do, in bits."""
    evidence = (
        *(MessageField(f"evidence_{name}", Type.FLOAT) for name in EVIDENCE),
        MessageField("runner_up_start", Type.SFIXED64, optional=True),
        MessageField("runner_up_length", Type.FIXED32, optional=True),
        MessageField("runner_up_kind", Type.ENUM, names=_names(Kind)),
    )
    return Message(
        "rtuscope.Frame",
        (
            MessageField("index", Type.FIXED64),
            MessageField("start", Type.FIXED64),
            MessageField("length", Type.FIXED32),
            MessageField("t_start_ns", Type.SFIXED64),
            MessageField("protocol", Type.ENUM, names=_names(Protocol)),
            MessageField("direction", Type.ENUM, names=_names(Kind)),
            MessageField("unit", Type.FIXED32),
            MessageField("function", Type.ENUM, names=function_names()),
            MessageField("crc_ok", Type.BOOL),
            MessageField("address", Type.FIXED32, optional=True),
            MessageField("quantity", Type.FIXED32, optional=True),
            MessageField("exception", Type.FIXED32, optional=True),
            MessageField("confidence", Type.FLOAT),
            MessageField("request_start", Type.FIXED64, optional=True),
            MessageField("response_time_ns", Type.FIXED64, optional=True),
            MessageField("port", Type.FIXED32),
            MessageField("findings", Type.FIXED32),
            MessageField("response_time_low_ns", Type.FIXED64, optional=True),  # where the tap's clock bounds it only
            MessageField("response_time_high_ns", Type.FIXED64, optional=True),
            MessageField("taken_for_start", Type.FIXED64, optional=True),
            MessageField("unsure", Type.BOOL),
            *(evidence if explain else ()),
            MessageField("data", Type.BYTES),
        ),
    )


def transaction() -> Message:
    """A request and what became of it; log_time is the start of the answer, else the end of the request."""
    return Message(
        "rtuscope.Transaction",
        (
            MessageField("request", Type.FIXED64),
            MessageField("response", Type.FIXED64, optional=True),
            MessageField("unit", Type.FIXED32),
            MessageField("function", Type.ENUM, names=function_names()),
            MessageField("status", Type.ENUM, names=_names(Status)),
            MessageField("response_time_ms", Type.DOUBLE, optional=True),
            MessageField("retry", Type.BOOL),
            MessageField("late", Type.BOOL),
            MessageField(
                "response_time_low_ms", Type.DOUBLE, optional=True
            ),  # between what it lies as far as the tap's clock tells
            MessageField("response_time_high_ms", Type.DOUBLE, optional=True),
            MessageField("mistaken", Type.BOOL),
            MessageField("unsure", Type.BOOL),
        ),
    )


NOISE: Final = Message(
    "rtuscope.Noise",
    (
        MessageField("start", Type.FIXED64),
        MessageField("length", Type.FIXED32),
        MessageField("t_start_ns", Type.SFIXED64),
        MessageField("port", Type.FIXED32),
        MessageField("data", Type.BYTES),
    ),
)


REGISTER: Final = Type.FIXED32  # the type of a value, by what it is
BIT: Final = Type.BOOL


def _schema(area: str, letter: str, unit: int, addresses: Sequence[int]) -> tuple[str, bytes]:
    """Name and schema of a unit's values, a field an address: `r107` a register, `b19` a coil or input."""
    name = f"rtuscope.unit_{unit}_{area}"
    return name, plain_schema(name, (f"{letter}{address}" for address in addresses), BIT if letter == "b" else REGISTER)


def function_names() -> Mapping[str, int]:
    """The declared functions' names as those of an enum, in capitals so that none is a field's; 0 is no function."""
    names: dict[str, int] = {"NO_FUNCTION": 0}
    for code, declared in sorted(functions().items()):
        name = re.sub(r"\W+", "_", declared.name, flags=re.ASCII).strip("_").upper()
        if not name or name[0].isdigit() or name in names:
            name = f"{name}_{code}" if name and not name[0].isdigit() else f"FUNCTION_{code}"
        names[name] = code
    return names


def _names(members: Iterable[IntEnum]) -> Mapping[str, int]:
    return {member.name.lower(): int(member) for member in members}


LEVELS: Final = {Severity.NOTE: 2, Severity.WARNING: 3, Severity.ERROR: 4}  # of log messages


MAX_FIELDS: Final = 2000  # of a topic: as many as field numbers of two bytes name

# Area: its name in topics and the letter before an address.
_AREAS: Final = {
    AreaCode.COILS: ("coils", "b"),
    AreaCode.DISCRETE_INPUTS: ("discrete", "b"),
    AreaCode.INPUT_REGISTERS: ("input", "r"),
    AreaCode.HOLDING_REGISTERS: ("holding", "r"),
}
_UNIT_BITS: Final = 8
_ADDRESSES: Final = 1 << 16


@dataclass(slots=True, eq=False)
class _UnitArea:
    """The topic of one unit and area: its addresses in the order of their fields."""

    key: int  # area << 8 | unit
    addresses: list[int] = field(default_factory=list)


class UnitAreas:
    """The channels of an MCAP file that hold values, made as units and areas are met."""

    def __init__(self, writer: TopicWriter) -> None:
        self._writer = writer
        self._topics: list[_UnitArea] = []
        self._places = np.full(len(AreaCode) << _UNIT_BITS, -1, np.int64)  # in `_topics`, by area and unit
        self._channels = np.zeros(0, np.uint16)  # the newest of each topic
        self._numbers = np.zeros((0, _ADDRESSES), np.int16)  # of each topic, the field of each address; -1: it has none
        self.left_out = 0  # messages with an address for which a topic has no field left

    def messages(self, batch: Batch, decoded: Decoded) -> Packed:
        """The values that the rows of a batch confirm."""
        confirmed = confirmed_values(batch, decoded)
        keys = confirmed.area.astype(np.int64) << _UNIT_BITS | batch.rows.unit[confirmed.rows]
        self._meet(keys)
        places = self._places.take(keys)
        _, addresses, values = confirmed.spread()
        codes = np.repeat(places * _ADDRESSES, confirmed.counts) + addresses
        numbers = self._numbers.ravel().take(codes)
        if (missing := numbers < 0).any():
            self._extend(np.unique(codes[missing]))
            numbers = self._numbers.ravel().take(codes)
        channels = self._channels.take(places)
        if (numbers < 0).any():
            owner = np.repeat(np.arange(len(keys)), confirmed.counts)
            fits = np.ones(len(keys), np.bool_)
            fits[owner[numbers < 0]] = False
            self.left_out += int(np.count_nonzero(~fits))
            numbers, values = numbers[fits[owner]], values[fits[owner]]
            confirmed, channels = confirmed.taken(fits), channels[fits]
        heads = records.heads(np.zeros(1, [("record", HEAD)]), len(channels))
        times = batch.rows.t_end_ns[confirmed.rows]
        return records.packed(channels, times, [PackedPart(None, heads)], _fields(confirmed, numbers, values))

    def _meet(self, keys: Ints) -> None:
        """Places for units and areas that were not met before."""
        met = np.bincount(keys, minlength=len(self._places)).nonzero()[0]
        new = met[self._places[met] < 0]
        if len(new):
            self._places[new] = np.arange(len(new)) + len(self._topics)
            self._topics += map(_UnitArea, new.tolist())
            self._numbers = np.concatenate((self._numbers, np.full((len(new), _ADDRESSES), -1, np.int16)))
            self._channels = np.concatenate((self._channels, np.zeros(len(new), np.uint16)))

    def _extend(self, codes: Ints) -> None:
        """Fields for addresses that topics had not; `codes` ascend: the topic's place and the address."""
        places, first = np.unique(codes // _ADDRESSES, return_index=True)
        added = zip(places.tolist(), np.split(codes % _ADDRESSES, first[1:]), strict=True)
        for place, addresses in sorted(added, key=lambda each: self._topics[each[0]].key):
            topic = self._topics[place]
            new = addresses[: MAX_FIELDS - len(topic.addresses)]
            if not len(new):
                continue
            self._numbers[place, new] = np.arange(len(new)) + len(topic.addresses)
            topic.addresses += new.tolist()
            area, letter = _AREAS[AreaCode(topic.key >> _UNIT_BITS)]
            unit = topic.key & (1 << _UNIT_BITS) - 1
            name, content = _schema(area, letter, unit, topic.addresses)
            schema = self._writer.register_schema(name, ENCODING, content)
            self._channels[place] = self._writer.register_channel(f"/unit/{unit}/{area}", ENCODING, schema)


def _fields(confirmed: ConfirmedValues, numbers: NDArray[np.int16], values: NDArray[np.uint16]) -> Tails:
    """The messages: a field a value, registers of one width and bits of another."""
    bits = confirmed.area <= AreaCode.DISCRETE_INPUTS
    begins, sizes = np.zeros(len(bits), np.int64), np.zeros(len(bits), np.int64)
    buffers: list[Bytes] = []
    for kind, mine in ((REGISTER, ~bits), (BIT, bits)):
        if not mine.any():
            continue
        pick = slice(None) if mine.all() else np.repeat(mine, confirmed.counts)
        items = plain_items(kind, numbers[pick], values[pick])
        counts = confirmed.counts[mine]
        begins[mine] = sums(counts)[:-1] * items.itemsize + sum(map(len, buffers))
        sizes[mine] = counts * items.itemsize
        buffers.append(items.view(np.uint8))
    return Tails(np.concatenate(buffers) if buffers else np.zeros(0, np.uint8), begins, sizes)


_VALUE: Final = "rtuscope.Value"
_LETTERS: Final = {"°": "deg", "%": "percent", "³": "3", "²": "2", "/": "_per_", "Ω": "Ohm", "µ": "u", "€": "EUR"}


class MappedTopics:
    """The channels of mapped values, made as values are met."""

    def __init__(self, writer: TopicWriter, charts: Mapping[int, RegisterMap]) -> None:
        self._writer = writer
        self._charts = charts
        self._message = Message(_VALUE, (MessageField("value", Type.DOUBLE),))  # one layout for all units of measure
        self._channels: dict[tuple[int, str, int, str], int] = {}
        self._topics: set[str] = set()
        self._schemas: dict[str, int] = {}

    def messages(self, batch: Batch, decoded: Decoded) -> Packed | None:
        """The values that the answers of a batch hold, in the order of their topics."""
        channels, times, values = [], [], []
        for column in mapped_columns(batch, decoded, self._charts):
            readable = np.flatnonzero(~np.isnan(column.values))
            if len(readable):
                channels.append(np.full(len(readable), self._channel(column.unit, column.row), np.uint16))
                times.append(batch.rows.t_end_ns[column.answers[readable]])
                values.append(column.values[readable])
        if not channels:
            return None
        heads = records.heads(self._message.layout(HEAD), sum(map(len, values)))
        heads["value"] = np.concatenate(values)
        return records.packed(np.concatenate(channels), np.concatenate(times), [PackedPart(None, heads)])

    def _channel(self, unit: int, row: MappedValue) -> int:
        key = (unit, row.area, row.address, row.name)
        if key not in self._channels:
            topic = f"/unit/{unit}/values/{topic_name(row.name)}"
            if topic in self._topics:
                topic = f"{topic}_{row.address}"
            self._topics.add(topic)
            about = {"name": row.name, "area": row.area, "address": str(row.address), "unit_of_measure": row.unit}
            if row.values:
                about["values"] = "; ".join(f"{state}={name}" for state, name in row.values.items())
            self._channels[key] = self._writer.register_channel(topic, ENCODING, self._schema(row.unit), about)
        return self._channels[key]

    def _schema(self, unit: str) -> int:
        name = "_".join(filter(None, (_VALUE, topic_name(unit, re.ASCII))))
        if name not in self._schemas:
            content = replace(self._message, name=name).schema()
            self._schemas[name] = self._writer.register_schema(name, ENCODING, content)
        return self._schemas[name]


def topic_name(text: str, flags: re.RegexFlag = re.NOFLAG) -> str:
    """A name as topics and schemas have them: letters, digits and underscores."""
    words = "".join(_LETTERS.get(letter, letter) for letter in text)
    return re.sub(r"[^\w]+", "_", words, flags=flags).strip("_")
