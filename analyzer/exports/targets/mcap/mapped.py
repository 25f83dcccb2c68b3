"""Mapped values as messages: a topic a value, `/unit/13/values/Active_power`, a number in the unit of measure.

The unit stands in the name of the schema (`rtuscope.Value_kW`), the name, the address and the map's words in the
metadata of the channel. States and bits are numbers; texts and what has no number are on no topic.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from captures.formats.mcap import packing
from captures.formats.mcap.packing import HEAD, Packed, PackedPart
from captures.formats.mcap.protobuf import ENCODING, Message, MessageField, Type
from captures.formats.mcap.writer import TopicWriter
from dissectors.maps import RegisterMap
from dissectors.maps.model import MappedValue

from ....registers.mapped import mapped_columns
from ....tables.batch import Batch
from ....tables.columns import Decoded

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
