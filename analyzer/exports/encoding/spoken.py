"""What frames speak of, and when, as pieces: address, quantity, values, time."""

from __future__ import annotations

from functools import partial
from typing import Final, NamedTuple

import numpy as np

from captures.ragged import counted_on

from ...tables.batch import Batch
from ...tables.columns import Decoded, Pdus, decode
from ...tables.schema import Kind, Rows
from ...words import is_clock
from .forms import BatchBytes, Forms, Group, Whole
from .sheet import Cursor, Ints, Pieces, Sheet, Store, TextTable, inside, without
from .summaries import summary_pieces


class SpokenWords(NamedTuple):
    """What frames speak of: -1 for none; how many values each has, and the values of all, end to end."""

    address: Ints
    quantity: Ints
    counts: Ints
    values: Ints


class Speech:
    """What the rows of batches speak of, each batch decoded once."""

    def __init__(self) -> None:
        self._decoded: tuple[Batch, Decoded] | None = None

    def of(self, pdus: Pdus, row_numbers: Ints) -> SpokenWords:
        """That of some rows of a batch."""
        batch = pdus.batch
        if self._decoded is None or self._decoded[0] is not batch:
            self._decoded = batch, decode(batch, pdus)
        decoded = self._decoded[1]
        begins = decoded.offsets[row_numbers]
        counts = decoded.offsets[row_numbers + 1] - begins
        values = decoded.values.take(np.repeat(begins, counts) + counted_on(counts)).astype(np.int64)
        address, quantity = (column[row_numbers].astype(np.int64) for column in (decoded.address, decoded.quantity))
        return SpokenWords(address, quantity, counts, values)


def separated(words: SpokenWords, values: TextTable) -> Pieces:
    """The pieces of all values; `values` has each behind a separator of one byte, which the first of a row lacks."""
    numbers = values.take_pieces(words.values)
    return np.where(counted_on(words.counts) > 0, numbers, without(numbers, 1))


class ClockPieces:
    """ISO 8601 in UTC to the microsecond: `PIECES` of each time; `otherwise` for times that no clock of ours gave."""

    PIECES = 3

    def __init__(self, store: Store, before: bytes, behind: bytes, otherwise: bytes) -> None:
        self._store = store
        self._behind, self._otherwise = b"Z" + behind, otherwise
        self._second = store.table(lambda second: before + f"{np.datetime64(second, 's')}.".encode())

    def put(self, t_ns: Ints, cursor: Cursor) -> None:
        """The times of some lines."""
        second, fraction, zone = np.full((self.PIECES, len(t_ns)), self._store.fixed(b""), np.int64)
        second[:] = self._store.fixed(self._otherwise)
        clocked = np.flatnonzero(is_clock(t_ns))
        if len(clocked):
            seconds, rest = np.divmod(t_ns[clocked] // 1000, 1_000_000)
            second[clocked] = self._second.take_pieces(seconds)
            fraction[clocked] = without(cursor.sheet.numbers(1_000_000 + rest), 1)
            zone[clocked] = self._store.fixed(self._behind)
        for part in (second, fraction, zone):
            cursor.put(part)


_SPOKEN: Final = 3 + ClockPieces.PIECES  # pieces of a frame, values and summary left out


class SpokenLines(NamedTuple):
    """Which rows are frames, what they speak of, summaries set from pieces, and how many pieces each row has."""

    frames: Ints
    words: SpokenWords
    groups: list[Group]
    sizes: Ints


class Speaking:
    """The pieces of what frames speak of, in words, and when: between the fields and the line's end."""

    def __init__(self, store: Store) -> None:
        self._speech = Speech()
        self._forms = Forms(partial(summary_pieces, store, inside, inside))
        self._summary_texts = Whole(lambda frame: inside(frame.summary()))
        self._address = store.table(lambda key: b',"address":%s,"quantity":' % _number_or_null(key))
        self._quantity = store.table(lambda key: b'%s,"values":[' % _number_or_null(key))
        self._value = store.table_of_many(lambda numbers: [b",%d" % number for number in numbers])
        self._clock = ClockPieces(store, b'","time":"', b'"', b'","time":null')

    def of(self, rows: Rows, row_numbers: Ints, source: BatchBytes) -> SpokenLines:
        """That of some rows of a batch, noise among them, which has no pieces."""
        frames = np.flatnonzero(rows.kind != Kind.NOISE)
        words = self._speech.of(source.pdus, row_numbers[frames])
        groups = self._forms.groups(rows, row_numbers, source)
        sizes = np.zeros(len(rows), np.int64)
        sizes[frames] = _SPOKEN + 1 + words.counts
        for group in groups:
            sizes[group.lines] += group.sizes() - 1
        return SpokenLines(frames, words, groups, sizes)

    def put(
        self, spoken: SpokenLines, tail: int, rows: Rows, row_numbers: Ints, source: BatchBytes, sheet: Sheet
    ) -> None:
        """All pieces; `tail` of each line are behind these."""
        frames, words, groups, sizes = spoken
        cursor = sheet.before_end(frames, tail + sizes[frames])
        cursor.put(self._address.take_pieces(words.address + 1))
        cursor.put(self._quantity.take_pieces(words.quantity + 1))
        cursor.spread(words.counts, separated(words, self._value))
        cursor.put(b'],"summary":"')
        behind = tail + ClockPieces.PIECES
        unformed = rows.kind != Kind.NOISE
        for group in groups:
            group.put(source, sheet.before_end(group.lines, behind + group.sizes()))
            unformed[group.lines] = False
        annotated = (source.pdus.batch.frame(row) for row in row_numbers[unformed].tolist())
        texts = [self._summary_texts.text(frame) for frame in annotated]
        sheet.before_end(np.flatnonzero(unformed), behind + 1).put_texts(texts)
        self._clock.put(rows.t_start_ns[frames], sheet.before_end(frames, behind))


def _number_or_null(key: int) -> bytes:
    """One less than the key; null for 0."""
    return b"%d" % (key - 1) if key else b"null"
