"""Register and bit values as messages, for plots without a script.

As they are: a channel a unit and area, a field an address. An answer to a read carries values; an answer to a write
confirms those of its request. A message has the fields of its answer alone. The fields of a topic are the addresses met
so far; where a later batch brings more, the topic goes on in a channel whose schema has those too, every field under
the number that it had.

By register maps: a topic a value, `/unit/13/values/Active_power`, a number in the unit of measure. The unit stands in
the name of the schema (`rtuscope.Value_kW`), the name, the address and the map's words in the metadata of the channel.
States and bits are numbers; texts and what has no number are on no topic.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from analyzer.exports.targets.mcap import schemas
from captures.formats.mcap import packing
from captures.formats.mcap.packing import HEAD, Packed, PackedPart, Tails
from captures.formats.mcap.protobuf import ENCODING, Message, MessageField, Type, plain_items
from captures.formats.mcap.writer import TopicWriter
from captures.ragged import Bytes, Ints, sums
from dissectors.maps import RegisterMap
from dissectors.maps.model import MappedValue

from ....registers.mapped import mapped_columns
from ....tables.batch import Batch
from ....tables.columns import AreaCode, Decoded
from ....tables.values import ConfirmedValues, confirmed_values

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
    """The topic of one unit and area: its addresses in the order of their fields, and its newest channel."""

    addresses: list[int] = field(default_factory=list)
    numbers: Ints = field(default_factory=lambda: np.full(_ADDRESSES, -1, np.int64))
    channel: int = 0


class UnitAreas:
    """The channels of an MCAP file that hold values, made as units and areas are met."""

    def __init__(self, writer: TopicWriter) -> None:
        self._writer = writer
        self._topics: dict[int, _UnitArea] = {}
        self.left_out = 0  # messages with an address for which a topic has no field left

    def messages(self, batch: Batch, decoded: Decoded) -> Packed:
        """The values that the rows of a batch confirm."""
        confirmed = confirmed_values(batch, decoded)
        keys = confirmed.area.astype(np.int64) << _UNIT_BITS | batch.rows.unit[confirmed.rows]
        _, addresses, _ = confirmed.spread()
        of_value = np.repeat(keys, confirmed.counts)
        numbers = np.zeros(len(addresses), np.int64)
        channels = np.zeros(len(keys), np.uint16)
        for key in np.unique(keys).tolist():
            mine = of_value == key
            topic = self._topic(key, addresses[mine])
            numbers[mine] = topic.numbers[addresses[mine]]
            channels[keys == key] = topic.channel
        fits = np.ones(len(keys), np.bool_)
        if (numbers < 0).any():
            owner = np.repeat(np.arange(len(keys)), confirmed.counts)
            fits[owner[numbers < 0]] = False
            self.left_out += int(np.count_nonzero(~fits))
            numbers = numbers[fits[owner]]
            confirmed, channels = confirmed.taken(fits), channels[fits]
        heads = packing.heads(np.zeros(1, [("record", HEAD)]), len(channels))
        times = batch.rows.t_end_ns[confirmed.rows]
        return packing.packed(channels, times, [PackedPart(None, heads)], _fields(confirmed, numbers))

    def _topic(self, key: int, addresses: Ints) -> _UnitArea:
        """The topic of a unit and area, with fields for these addresses."""
        topic = self._topics.setdefault(key, _UnitArea())
        new = np.unique(addresses[topic.numbers[addresses] < 0]).tolist()[: MAX_FIELDS - len(topic.addresses)]
        if new:
            topic.numbers[new] = np.arange(len(new)) + len(topic.addresses)
            topic.addresses += new
            area, letter = _AREAS[AreaCode(key >> _UNIT_BITS)]
            unit = key & (1 << _UNIT_BITS) - 1
            name, content = schemas.values(area, letter, unit, topic.addresses, bits=letter == "b")
            schema = self._writer.register_schema(name, ENCODING, content)
            topic.channel = self._writer.register_channel(f"/unit/{unit}/{area}", ENCODING, schema)
        return topic


def _fields(confirmed: ConfirmedValues, numbers: Ints) -> Tails:
    """The messages: a field a value, registers of one width and bits of another."""
    bits = confirmed.area <= AreaCode.DISCRETE_INPUTS
    begins, sizes = np.zeros(len(bits), np.int64), np.zeros(len(bits), np.int64)
    buffers: list[Bytes] = []
    first = sums(confirmed.counts)[:-1]
    for kind, selected in ((schemas.REGISTER, np.flatnonzero(~bits)), (schemas.BIT, np.flatnonzero(bits))):
        ends = sums(confirmed.counts[selected])
        counts = confirmed.counts[selected]
        within = np.arange(int(ends[-1])) - np.repeat(ends[:-1], counts)
        values = confirmed.values.take(within + np.repeat(confirmed.begins[selected], counts))
        items = plain_items(kind, numbers.take(within + np.repeat(first[selected], counts)), values)
        begins[selected] = ends[:-1] * items.itemsize + sum(map(len, buffers))
        sizes[selected] = counts * items.itemsize
        buffers.append(items.view(np.uint8))
    return Tails(np.concatenate(buffers), begins, sizes)


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
        heads = packing.heads(self._message.layout(HEAD), sum(map(len, values)))
        heads["value"] = np.concatenate(values)
        return packing.packed(np.concatenate(channels), np.concatenate(times), [PackedPart(None, heads)])

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
