"""A batch's rows as JSON lines: thousands of them set at once as pieces in one array, and joined."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import orjson
from numpy.typing import NDArray

from analyzer.frames import Batch, Kind, Protocol, Rows
from analyzer.pdus import Pdus
from dissectors.annotation import check_fields, function_field, header_fields
from dissectors.envelopes import Adu, rtu
from dissectors.lengths import Role

from . import fields
from .envelope import HEAD, TAIL, Envelope
from .pieces import Cursor, Ints, Objects, Store, encoded, parted
from .source import Source
from .whole import Encoder, noise_json

_LEAST: Final = 4  # bytes of an RTU frame that has a check value
_CHECK: Final = 2  # bytes of it
_AROUND: Final = 4  # pieces around a form's: unit and function before, the check value's two behind


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Lines of one form."""

    form: fields.Form
    lines: Ints
    rows: fields.Rows


class JsonLines:
    """Frames as lines of JSON, with `noise` the stretches between them too; `explain` as `explain_json` has it."""

    def __init__(self, *, explain: bool = False, noise: bool = False) -> None:
        self._noise = noise
        self._store = Store()
        self._envelope = Envelope(self._store, explain)
        self._forms: dict[int, fields.Form | None] = {}
        self._whole = Encoder()
        self._unit = self._store.table(
            lambda unit: b'","fields":[' + encoded(header_fields(rtu(bytes([unit])))[0].to_json())
        )
        self._function = self._store.table(_function)
        self._check_place = self._store.table(lambda at: b"," + parted(_check(at, 0))[0])
        self._check_value = self._store.table(lambda crc: b"".join(parted(_check(0, crc))[1:]) + b"]")
        self._pdus: Pdus | None = None

    def text(self, batch: Batch, first: int, last: int) -> bytes:
        """The lines of rows `first` to `last` (excluded)."""
        if self._pdus is None or self._pdus.batch is not batch:
            self._pdus = Pdus(batch)
        noise = batch.rows["kind"][first:last] == Kind.NOISE
        here = first + np.flatnonzero(~noise | self._noise)
        rows = batch.rows[here]
        frames = np.flatnonzero(rows["kind"] != Kind.NOISE)
        sizes = np.ones(len(rows), np.int64)
        sizes[frames] = HEAD + 1 + TAIL
        source = _source(self._pdus, rows[frames])
        groups = self._groups(rows, here, source)
        for group in groups:
            sizes[group.lines] = HEAD + _AROUND + group.form.sizes(group.rows) + TAIL
        ends = np.cumsum(sizes)
        sheet = np.empty(int(ends[-1]) if len(ends) else 0, object)
        cursor = Cursor(sheet, ends - sizes)
        for line in np.flatnonzero(rows["kind"] == Kind.NOISE).tolist():
            sheet[cursor.at[line]] = _noise(batch, int(here[line]))
        if len(frames):
            self._envelope.put_head(rows[frames], here[frames], source, cursor.of(frames))
            self._envelope.put_tail(rows[frames], here[frames], batch, Cursor(sheet, ends[frames] - TAIL))
            self._put_fields(groups, rows, here, source, Cursor(sheet, cursor.at + HEAD), ends - TAIL)
        return b"".join(sheet.tolist())

    def _groups(self, rows: Rows, here: Ints, source: Source) -> list[_Group]:
        """The rows that are put together from pieces, by form."""
        able = np.flatnonzero(
            (rows["kind"] != Kind.NOISE) & (rows["protocol"] == Protocol.RTU) & (rows["length"] >= _LEAST)
        )
        keys = rows["kind"][able].astype(np.int64) << 8 | source.octets(source.pdus.begins[here[able]])
        groups = []
        for key in np.flatnonzero(np.bincount(keys)).tolist():
            if key not in self._forms:
                self._forms[key] = fields.form(key >> 8, key & 0xFF, self._store)
            if (form := self._forms[key]) is not None:
                lines = able[keys == key]
                kept, fits = form.split(here[lines], source)
                groups.append(_Group(form, lines[fits], kept))
        return groups

    def _put_fields(
        self, groups: list[_Group], rows: Rows, here: Ints, source: Source, cursor: Cursor, ends: Ints
    ) -> None:
        """All fields: those of the groups by pieces, the others' frame by frame."""
        whole = rows["kind"] != Kind.NOISE
        for group in groups:
            whole[group.lines] = False
            form_cursor = cursor.of(group.lines)
            form_cursor.at += 2
            group.form.put(group.rows, source, form_cursor)
        formed = np.concatenate([np.zeros(0, np.int64), *(group.lines for group in groups)])
        if len(formed):
            self._put_around(rows[formed], source, cursor.of(formed), Cursor(cursor.sheet, ends[formed] - 2))
        for line in np.flatnonzero(whole).tolist():
            frame = source.pdus.batch.frame(int(here[line]))
            cursor.sheet[cursor.at[line]] = b'","fields":' + self._whole.encoded(frame).fields

    def _put_around(self, rows: Rows, source: Source, head: Cursor, tail: Cursor) -> None:
        """Unit and function, and the check value, of RTU frames."""
        head.put(self._unit.take(source.octets(rows["at"])))
        kind = rows["kind"].astype(np.int64)
        head.put(self._function.take(kind << 8 | source.octets(rows["at"] + 1)))
        at = rows["length"] - _CHECK
        tail.put(self._check_place.take(at))
        tail.put(self._checks(rows, rows["at"] + at, source))

    def _checks(self, rows: Rows, at: Ints, source: Source) -> Objects:
        right: NDArray[np.bool_] = rows["check"]
        found = self._check_value.take(source.octets(at) | source.octets(at + 1) << 8)
        for i in np.flatnonzero(~right).tolist():
            begin, length = int(rows["at"][i]), int(rows["length"][i])
            adu = rtu(source.pdus.data[begin : begin + length].tobytes())
            found[i] = b"".join(parted(check_fields(adu, length - _CHECK)[0])[1:]) + b"]"
        return found


def _source(pdus: Pdus, frames: Rows) -> Source:
    plain = frames[frames["protocol"] == Protocol.RTU]
    if not len(plain):
        return Source(pdus, 0, 0)
    return Source(pdus, int(plain["at"].min()), int((plain["at"] + plain["length"]).max()))


def _function(key: int) -> bytes:
    role = Role.REQUEST if key >> 8 == Kind.REQUEST else Role.RESPONSE
    return b"," + encoded(function_field(bytes([0, key & 0xFF]), 1, role).to_json())


def _check(at: int, crc: int):
    """The field of a right CRC."""
    data = bytes(at) + crc.to_bytes(_CHECK, "little")
    return check_fields(Adu("rtu", data, 0, b"", True, crc, crc, 0, len(data)), at)[0]


def _noise(batch: Batch, row: int) -> bytes:
    return orjson.dumps(noise_json(batch, row), option=orjson.OPT_APPEND_NEWLINE)
