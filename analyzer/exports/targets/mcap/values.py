"""Register and bit values as messages: a channel a poll group, a field an address, for plots without a script.

A poll group is what one request asks for: unit, area, starting address and quantity. An answer to a read carries
values; an answer to a write confirms those of its request. Messages of one quantity have one layout, whatever their
addresses: only the schema knows those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analyzer.columns import AreaCode, Decoded, decode
from analyzer.exports.targets.mcap import schemas
from analyzer.frames import ROW, Batch, Kind
from captures.formats.mcap import packing
from captures.formats.mcap.packing import HEAD, Packed, Part, Tails
from captures.formats.mcap.protobuf import ENCODING, plain_items
from captures.formats.mcap.writer import ArrayWriter
from captures.ragged import Bytes, Ints, sums

MAX_GROUPS: Final = 4096  # topics that a viewer can still be asked to list; a bus has some dozens

# Area: its name in topics and the letter before an address.
_AREAS: Final = {
    AreaCode.COILS: ("coils", "b"),
    AreaCode.DISCRETE_INPUTS: ("discrete", "b"),
    AreaCode.INPUT_REGISTERS: ("input", "r"),
    AreaCode.HOLDING_REGISTERS: ("holding", "r"),
}
_MAX_COUNT: Final = 2000  # values of a frame: coils of a read ([1] 6.1)
_TOLD: Final = ("rows", "area", "address", "begins", "counts")
_ADDRESSES: Final = 1 << 16
_COUNT_BITS, _ADDRESS_BITS, _UNIT_BITS = 16, 16, 8


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """Values that some rows tell: of each the area, the first address, and where they lie in `values`."""

    rows: Ints
    area: NDArray[np.uint8]
    address: Ints
    begins: Ints
    counts: Ints
    values: NDArray[np.uint16]

    @classmethod
    def joined(cls, told: Sequence[_Told]) -> _Told:
        """All of them in the order of their rows; of one row in the order given."""
        columns = {name: np.concatenate([getattr(each, name) for each in told]) for name in _TOLD}
        order = np.argsort(columns["rows"], kind="stable")
        sizes = [len(each.values) for each in told]
        columns["begins"] += np.repeat(np.cumsum(sizes) - sizes, [len(each.rows) for each in told])
        return cls(
            **{name: column[order] for name, column in columns.items()},
            values=np.concatenate([each.values for each in told]),
        )

    def taken(self, which: NDArray[np.bool_]) -> _Told:
        """Those of some rows."""
        if which.all():
            return self
        return _Told(
            self.rows[which], self.area[which], self.address[which], self.begins[which], self.counts[which], self.values
        )


class PollGroups:
    """The channels of an MCAP file that hold values, made as groups are met."""

    def __init__(self, writer: ArrayWriter) -> None:
        self._writer = writer
        self._keys = np.zeros(0, np.int64)  # of the groups that are known, ascending
        self._channels = np.zeros(0, np.uint16)  # of each
        self._schemas: dict[tuple[int, int, int], int] = {}  # by area, start and count
        self.left_out = 0  # messages without a channel, since there are too many groups

    def messages(self, batch: Batch, decoded: Decoded) -> Packed:
        """The values that the rows of a batch tell."""
        told = _told(batch, decoded)
        keys = told.area.astype(np.int64) << _UNIT_BITS | batch.rows["unit"][told.rows]
        keys = (keys << _ADDRESS_BITS | told.address) << _COUNT_BITS | told.counts
        channels = self._channels_of(keys)
        if not channels.all():
            kept = channels > 0
            self.left_out += int(np.count_nonzero(~kept))
            told, channels = told.taken(kept), channels[kept]
        heads = packing.heads(np.zeros(1, [("record", HEAD)]), len(channels))
        times = batch.rows["t_end"][told.rows]
        return packing.packed(channels, times, [Part(None, heads)], _fields(told))

    def _channels_of(self, keys: Ints) -> NDArray[np.uint16]:
        """The channel of each key's group, made where it is new; 0 for groups that are too many."""
        place = np.searchsorted(self._keys, keys)
        known = place < len(self._keys)
        known[known] = self._keys[place[known]] == keys[known]
        if not known.all() and len(self._keys) < MAX_GROUPS:
            new = np.unique(keys[~known])[: MAX_GROUPS - len(self._keys)]
            self._add(new, np.array([self._channel(key) for key in new.tolist()], np.uint16))
            return self._channels_of(keys)
        channels = np.zeros(len(keys), np.uint16)
        channels[known] = self._channels[place[known]]
        return channels

    def _add(self, keys: Ints, channels: NDArray[np.uint16]) -> None:
        keys, channels = np.append(self._keys, keys), np.append(self._channels, channels)
        order = np.argsort(keys)
        self._keys, self._channels = keys[order], channels[order]

    def _channel(self, key: int) -> int:
        """A new group's channel."""
        count, rest = key & (1 << _COUNT_BITS) - 1, key >> _COUNT_BITS
        start, rest = rest & (1 << _ADDRESS_BITS) - 1, rest >> _ADDRESS_BITS
        unit, code = rest & (1 << _UNIT_BITS) - 1, AreaCode(rest >> _UNIT_BITS)
        area, letter = _AREAS[code]
        schema = self._schemas.get((code, start, count))
        if schema is None:
            name, content = schemas.values(area, letter, start, count, bits=letter == "b")
            schema = self._writer.register_schema(name, ENCODING, content)
            self._schemas[code, start, count] = schema
        topic = f"/unit/{unit}/{area}/{schemas.span(start, count)}"
        return self._writer.register_channel(topic, ENCODING, schema)


def _told(batch: Batch, decoded: Decoded) -> _Told:
    """What good answers carry, and what they confirm of their requests."""
    rows, request = batch.rows, batch.rows["request"]
    good = (rows["kind"] == Kind.RESPONSE) & rows["check"] & (rows["exception"] == 0) & (request >= 0)
    has = decoded.offsets[1:] > decoded.offsets[:-1]
    own = np.flatnonzero(good & has)
    writes = np.flatnonzero(has & (rows["kind"] == Kind.REQUEST))
    indices, answers = rows["index"][writes], np.flatnonzero(good)
    asked = request[answers]
    place = np.searchsorted(indices, asked)
    here = place < len(writes)
    here[here] = indices[place[here]] == asked[here]
    confirmed = [_of(decoded, answers[here], writes[place[here]])]
    if batch.earlier:
        confirmed += _earlier(batch, answers[np.isin(asked, list(batch.earlier))])
    return _Told.joined([_of(decoded, own, own), *(told.taken(~_echoed(decoded, told)) for told in confirmed)])


def _of(decoded: Decoded, rows: Ints, sources: Ints) -> _Told:
    """The values of the rows `sources`, told by `rows`; those that have no area or address left out."""
    begins, ends = decoded.offsets[sources], decoded.offsets[1:][sources]
    address = decoded.value_address[sources].astype(np.int64)
    area = decoded.area[sources]
    counts = np.minimum(ends - begins, _ADDRESSES - address)
    told = _Told(rows, area, address, begins, counts, decoded.values)
    return told.taken((area > AreaCode.NONE) & (counts > 0) & (counts <= _MAX_COUNT) & (address >= 0))


def _earlier(batch: Batch, answers: Ints) -> list[_Told]:
    """The values of requests that lie in the batch before."""
    if not len(answers):
        return []
    captured = [batch.earlier[index] for index in batch.rows["request"][answers].tolist()]
    requests = np.zeros(len(captured), ROW)
    for name in ("unit", "function", "protocol"):
        requests[name] = batch.rows[name][answers]
    requests["kind"], requests["check"], requests["request"] = Kind.REQUEST, True, -1
    requests["length"] = [len(adu) for adu in captured]
    requests["at"] = np.cumsum(requests["length"]) - requests["length"]
    decoded = decode(Batch(requests, np.frombuffer(b"".join(captured), np.uint8)))
    return [_of(decoded, answers, np.arange(len(answers)))]


def _echoed(decoded: Decoded, told: _Told) -> NDArray[np.bool_]:
    """Whether a row's own values are at the same addresses: the answer to a single write repeats it."""
    own = decoded.offsets[told.rows + 1] - decoded.offsets[told.rows]
    same: NDArray[np.bool_] = (decoded.value_address[told.rows] == told.address) & (own == told.counts)
    return same


def _fields(told: _Told) -> Tails:
    """The messages: a field a value, registers of one width and bits of another."""
    bits = told.area <= AreaCode.DISCRETE_INPUTS
    begins, sizes = np.zeros(len(bits), np.int64), np.zeros(len(bits), np.int64)
    buffers: list[Bytes] = []
    for kind, here in ((schemas.REGISTER, np.flatnonzero(~bits)), (schemas.BIT, np.flatnonzero(bits))):
        ends = sums(told.counts[here])
        counts = told.counts[here]
        places = np.arange(int(ends[-1])) - np.repeat(ends[:-1], counts)
        items = plain_items(kind, places, told.values.take(places + np.repeat(told.begins[here], counts)))
        begins[here] = ends[:-1] * items.itemsize + sum(map(len, buffers))
        sizes[here] = counts * items.itemsize
        buffers.append(items.view(np.uint8))
    return Tails(np.concatenate(buffers), begins, sizes)
