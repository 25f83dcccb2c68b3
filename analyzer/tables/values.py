"""What registers, coils and inputs are, as the bus says it: values in good answers, and what an answer confirms.

An answer to a read carries values; an answer to a write confirms those of its request, each once: where the answer
repeats them (05, 06) they are told by the answer alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .batch import Batch
from .columns import AreaCode, Decoded, decode
from .schema import Kind, Rows

_MAX_COUNT: Final = 2000  # values of a frame: coils of a read ([1] 6.1)
_COLUMNS: Final = ("rows", "area", "address", "begins", "counts")
_ADDRESSES: Final = 1 << 16
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class ConfirmedValues:
    """Values by answers: of each the row (of its batch), the area, the first address, and where they lie in `values`.

    Arrays of one length but for `values`; `begins` and `counts` are indices into that.
    """

    rows: Ints
    area: NDArray[np.uint8]
    address: Ints
    begins: Ints
    counts: Ints
    values: NDArray[np.uint16]

    @classmethod
    def joined(cls, parts: Sequence[ConfirmedValues]) -> ConfirmedValues:
        """All of them in the order of their rows; of one row in the order given."""
        columns = {name: np.concatenate([getattr(each, name) for each in parts]) for name in _COLUMNS}
        order = np.argsort(columns["rows"], kind="stable")
        sizes = [len(each.values) for each in parts]
        columns["begins"] += np.repeat(np.cumsum(sizes) - sizes, [len(each.rows) for each in parts])
        return cls(
            **{name: column[order] for name, column in columns.items()},
            values=np.concatenate([each.values for each in parts]),
        )

    def taken(self, which: NDArray[np.bool_]) -> ConfirmedValues:
        """Those of some rows."""
        if which.all():
            return self
        return ConfirmedValues(
            self.rows[which], self.area[which], self.address[which], self.begins[which], self.counts[which], self.values
        )

    def spread(self) -> tuple[Ints, Ints, NDArray[np.uint16]]:
        """Value by value: the row that tells it, its address, the value; what runs past 65535 begins at 0 again."""
        within = np.arange(int(self.counts.sum())) - np.repeat(np.cumsum(self.counts) - self.counts, self.counts)
        address = (np.repeat(self.address, self.counts) + within) & (_ADDRESSES - 1)
        return np.repeat(self.rows, self.counts), address, self.values[np.repeat(self.begins, self.counts) + within]


def confirmed_values(batch: Batch, decoded: Decoded) -> ConfirmedValues:
    """What good answers carry, and what they confirm of their requests."""
    rows, request = batch.rows, batch.rows.request
    good = (rows.kind == Kind.RESPONSE) & rows.check & (rows.exception == 0) & (request >= 0)
    has = decoded.offsets[1:] > decoded.offsets[:-1]
    own = np.flatnonzero(good & has)
    writes = np.flatnonzero(has & (rows.kind == Kind.REQUEST))
    indices, answers = rows.index[writes], np.flatnonzero(good)
    requested = request[answers]
    position = np.searchsorted(indices, requested)
    inside = position < len(writes)
    inside[inside] = indices[position[inside]] == requested[inside]
    confirmed = [_of(decoded, answers[inside], writes[position[inside]])]
    if batch.earlier:
        confirmed += _earlier(batch, answers[np.isin(requested, list(batch.earlier))])
    return ConfirmedValues.joined(
        [_of(decoded, own, own), *(values.taken(~_echoed(decoded, values)) for values in confirmed)]
    )


def _of(decoded: Decoded, rows: Ints, sources: Ints) -> ConfirmedValues:
    """The values of the rows `sources`, told by `rows`; those that have no area or address left out."""
    begins, ends = decoded.offsets[sources], decoded.offsets[1:][sources]
    address = decoded.value_address[sources].astype(np.int64)
    area = decoded.area[sources]
    counts = np.minimum(ends - begins, _ADDRESSES - address)
    confirmed = ConfirmedValues(rows, area, address, begins, counts, decoded.values)
    return confirmed.taken((area > AreaCode.NONE) & (counts > 0) & (counts <= _MAX_COUNT) & (address >= 0))


def _earlier(batch: Batch, answers: Ints) -> list[ConfirmedValues]:
    """The values of requests that lie in the batch before."""
    if not len(answers):
        return []
    captured = [batch.earlier[index] for index in batch.rows.request[answers].tolist()]
    requests = Rows.zeros(len(captured))
    for name in ("unit", "function", "protocol"):
        requests.column(name)[:] = batch.rows.column(name)[answers]
    requests.kind[:], requests.check[:], requests.request[:] = Kind.REQUEST, True, -1
    requests.length[:] = [len(adu) for adu in captured]
    requests.at[:] = np.cumsum(requests.length) - requests.length
    decoded = decode(Batch(requests, np.frombuffer(b"".join(captured), np.uint8)))
    return [_of(decoded, answers, np.arange(len(answers)))]


def _echoed(decoded: Decoded, confirmed: ConfirmedValues) -> NDArray[np.bool_]:
    """Whether a row's own values are at the same addresses: the answer to a single write repeats it."""
    own = decoded.offsets[confirmed.rows + 1] - decoded.offsets[confirmed.rows]
    same: NDArray[np.bool_] = (decoded.value_address[confirmed.rows] == confirmed.address) & (own == confirmed.counts)
    return same
