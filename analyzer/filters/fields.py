"""The fields of the display filter, an entry each: name, other names, kind, help, an example, how rows come by it.

Completion, errors, the reference (`docs/filters.md`) and evaluation all follow from these entries. A row that has no
such thing (noise has no unit, a request no response time) is told by `Held.known`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from types import MappingProxyType
from typing import Final

import numpy as np

from ..tables.columns import AreaCode
from ..tables.schema import NO_GAP, Direction, Protocol
from ..tables.schema import Kind as RowKind
from .held import HeldSlice
from .kinds import (
    BITS,
    EQUAL,
    ORDER,
    REGISTERS,
    Addresses,
    Duration,
    FieldKind,
    Flag,
    Hex,
    Moment,
    Named,
    NumberKind,
    Prose,
)
from .slices import Bytes, Each, FieldSlice, Mask, Several, TableSlice, TextSlice, ValueSlice
from .tree import Node, tests

_HUGE: Final = 2**62


class Cost(IntEnum):
    """What a field is worked out from: those that cost less are looked at first."""

    COLUMNS = 0
    FINDINGS = 1
    BYTES = 2  # from here on, only for rows that the cheaper tests of a conjunction leave
    CONTENTS = 3
    WORDS = 4


@dataclass(frozen=True)
class FilterField:
    """One field.

    `get` gives what rows hold; the mask says which rows matter (None: all). `each` gives it value by value, for fields
    that speak of single values; `settled` fields are only known once the frames after a row have come.
    """

    name: str
    kind: FieldKind
    help: str
    example: str
    get: Callable[[TableSlice, Mask | None], FieldSlice]
    cost: Cost = Cost.COLUMNS
    aliases: tuple[str, ...] = ()
    each: Callable[[Each], ValueSlice] | None = None
    settled: bool = False


def cost(node: Node) -> Cost:
    """What the dearest test of a node costs."""
    return max(test.field.cost for test in tests(node))


def _column(name: str, *, all_rows: bool = False) -> Callable[[TableSlice, Mask | None], FieldSlice]:
    """A column that frames have, or all rows."""
    return lambda section, _: ValueSlice(section.column(name), None if all_rows else section.frames)


def _where(name: str, has: Callable[[ValueSlice], Mask]) -> Callable[[TableSlice, Mask | None], FieldSlice]:
    """A column with a value that says that there is none."""

    def get(section: TableSlice, _: Mask | None) -> FieldSlice:
        values = ValueSlice(section.column(name))
        return ValueSlice(values.values, has(values))

    return get


def _flag(
    mask_of: Callable[[TableSlice], Mask], *, all_rows: bool = True
) -> Callable[[TableSlice, Mask | None], FieldSlice]:
    return lambda section, _: ValueSlice(mask_of(section), None if all_rows else section.frames)


def _findings(section: TableSlice, _: Mask | None) -> FieldSlice:
    rows, rules = section.found()
    return Several(ValueSlice(rules), rows, len(section))


def _severities(section: TableSlice, _: Mask | None) -> FieldSlice:
    from ..tables.findings import rules as declared

    rows, rules = section.found()
    grave = np.array([rule.severity for rule in declared()], np.uint8)
    return Several(ValueSlice(grave[rules]), rows, len(section))


def _quantity(section: TableSlice, requested: Mask | None) -> FieldSlice:
    quantity = section.spoken(requested).quantity
    return ValueSlice(quantity, quantity >= 0)


def _spoken(areas: tuple[AreaCode, ...] | None) -> Callable[[TableSlice, Mask | None], FieldSlice]:
    """The addresses that a frame speaks of, in some areas (None: in any, or in none)."""

    def get(section: TableSlice, requested: Mask | None) -> FieldSlice:
        spoken = section.spoken(requested)
        first = spoken.address.astype(np.int64)
        has = first >= 0
        if areas is not None:
            has &= np.isin(spoken.area, areas)
        return ValueSlice(first, has, first + np.maximum(spoken.quantity, 1) - 1, spoken.area)

    return get


def _addresses(areas: tuple[AreaCode, ...] | None) -> Callable[[Each], ValueSlice]:
    def each(values: Each) -> ValueSlice:
        has = values.address >= 0
        if areas is not None:
            among = np.zeros(256, np.bool_)
            among[[*areas]] = True
            has &= among[values.area]
        return ValueSlice(values.address, has, values.address, values.area)

    return each


def _value(each: Each) -> ValueSlice:
    return ValueSlice(each.value)


def _signed(each: Each) -> ValueSlice:
    return ValueSlice(each.value.view(np.int16), np.isin(each.area, REGISTERS) | (each.area == AreaCode.NONE))


def _unmapped(section: TableSlice, _: Mask | None) -> FieldSlice:
    """What no map says of: `mapped.field_of_names` puts the maps in."""
    return TextSlice((), np.zeros(0, np.intp), len(section))


def _functions() -> Mapping[int, str]:
    from dissectors.functions import functions

    return {code: declared.name for code, declared in sorted(functions().items())}


def _exceptions() -> Mapping[int, str]:
    from dissectors.functions.exceptions import EXCEPTIONS

    return {code: name for code, (name, _) in EXCEPTIONS.items()}


def _codes() -> Mapping[int, str]:
    from ..tables.findings import codes

    return dict(enumerate(codes()))


def _grades() -> Mapping[int, str]:
    from ..tables.findings import Severity

    return {grade.value: grade.name.lower() for grade in Severity}


def _directions() -> Mapping[int, str]:
    return {direction.value: direction.name for direction in Direction}


def _protocols() -> Mapping[int, str]:
    return {protocol.value: protocol.name.lower() for protocol in Protocol}


FIELDS: Final = (
    FilterField(
        "unit", NumberKind(0, 255), "unit (server) address", "unit == 17", _column("unit"),
        aliases=("slave", "server", "mbrtu.unit_id", "mbtcp.unit_id")
    ),
    FilterField(
        "function", Named("function", _functions, (*EQUAL, *ORDER, "contains", "matches"), numeric=True),
        "function code, without the exception bit", 'function in (3, 4) or function == "Write Single Coil"',
        _column("function"), aliases=("function_code", "fc", "modbus.func_code"),
    ),
    FilterField(
        "direction", Named("direction", _directions), "which way a frame goes", "direction == request",
        _column("kind"),
    ),
    FilterField(
        "request", Flag(), "a request", "request", _flag(lambda section: section.column("kind") == RowKind.REQUEST)
    ),
    FilterField(
        "response", Flag(), "a response, an exception too", "response and not exception",
        _flag(lambda section: section.column("kind") == RowKind.RESPONSE),
    ),
    FilterField("noise", Flag(), "bytes outside frames", "not noise", _flag(lambda section: ~section.frames)),
    FilterField(
        "broadcast", Flag(), "a request to all units", "broadcast",
        _flag(lambda section: (section.column("unit") == 0) & (section.column("kind") == RowKind.REQUEST)),
    ),
    FilterField(
        "exception", Named("exception", _exceptions, (*EQUAL, *ORDER, "contains", "matches"), numeric=True, least=1),
        "exception code of a response", 'exception == 2 or exception == "server device busy"',
        _where("exception", lambda exceptions: exceptions.values > 0), aliases=("modbus.exception_code",),
    ),
    FilterField(
        "crc_ok", Flag(), "the check value (CRC, or LRC in ASCII mode) is correct", "crc_ok == false",
        _flag(lambda section: section.column("check"), all_rows=False), aliases=("crc", "check"),
    ),
    FilterField(
        "finding", Named("finding", _codes, (*EQUAL, "contains", "matches")), "code of a finding about the row",
        'finding == "late-response"', _findings, Cost.FINDINGS, settled=True,
    ),
    FilterField(
        "severity", Named("severity", _grades, (*EQUAL, *ORDER)), "severity of a finding about the row",
        "severity >= warning", _severities, Cost.FINDINGS, settled=True,
    ),
    FilterField(
        "retry", Flag(), "a request that repeats one without a good answer", "retry",
        _flag(lambda section: section.column("retry")), settled=True,
    ),
    FilterField(
        "late", Flag(), "an answer that came after the client had gone on", "late",
        _flag(lambda section: section.column("late")), settled=True,
    ),
    FilterField(
        "displaced", Flag(), "an answer that the client takes for that to another request", "displaced and unit == 9",
        _flag(lambda section: section.column("taken_for_start") >= 0),
    ),
    FilterField(
        "unsure", Flag(), "an answer whose request is unclear", "not unsure",
        _flag(lambda section: section.column("unsure")),
    ),
    FilterField(
        "unanswered", Flag(), "a request that nobody answered", "unanswered and unit == 9",
        _flag(lambda section: section.column("unanswered")), settled=True,
    ),
    FilterField(
        "response_time", Duration(), "end of a request to start of its answer, of an answer; where the tap can tell",
        "response_time > 50ms", _where("response_ns", lambda times: times.values >= 0),
    ),
    FilterField(
        "gap", Duration(), "silence before the row; where the tap can tell", "gap > 3.5 chars",
        _where("gap_before_ns", lambda gaps: gaps.values != NO_GAP),
    ),
    FilterField(
        "gap_inside", Duration(), "longest silence inside the row; where the tap can tell", "gap_inside > 1.5 chars",
        _where("gap_most_ns", lambda gaps: gaps.values != NO_GAP),
    ),
    FilterField("time", Moment(), "start of the row", "time in 10s..12.5s", _column("t_start_ns", all_rows=True)),
    FilterField(
        "register", Addresses(REGISTERS), "registers that the frame reads, writes or answers", "register == 40108",
        _spoken(REGISTERS), Cost.CONTENTS, ("reg",), _addresses(REGISTERS),
    ),
    FilterField(
        "bit", Addresses(BITS), "coils and discrete inputs that the frame reads, writes or answers", "bit in 16..23",
        _spoken(BITS), Cost.CONTENTS, ("coil",), _addresses(BITS),
    ),
    FilterField(
        "address", Addresses(), "addresses of any area that the frame reads, writes or answers", "address == 0x6B",
        _spoken(None), Cost.CONTENTS, ("modbus.reference_num",), _addresses(None),
    ),
    FilterField(
        "quantity", NumberKind(0, 0xFFFF), "how many registers, coils or inputs", "quantity > 100", _quantity,
        Cost.CONTENTS, ("modbus.word_cnt", "modbus.bit_cnt"),
    ),
    FilterField(
        "value", NumberKind(0, 0xFFFF), "register values, unsigned, and bits (0 or 1) in the frame", "value > 1000",
        HeldSlice, Cost.CONTENTS, ("modbus.regval_uint16", "modbus.bitval"), _value,
    ),
    FilterField(
        "signed_value", NumberKind(-0x8000, 0x7FFF), "register values in the frame, as 16-bit signed numbers",
        "register == 40001 and signed_value < 0",
        lambda section, requested: HeldSlice(section, requested, signed=True, left_out=frozenset(BITS)),
        Cost.CONTENTS, (), _signed,
    ),
    FilterField(
        "name", Prose(), "names of the mapped values that the answer holds (with --map)", 'name contains "Voltage"',
        _unmapped, Cost.CONTENTS,
    ),
    FilterField(
        "hex", Hex(), "bytes of the row, check value included", 'hex contains "03 02"',
        lambda section, _: Bytes(section.batch), Cost.BYTES,
    ),
    FilterField(
        "text", Prose(), "the frame in words, as lists show it; slow on its own",
        'unit == 17 and text contains "read 3"',
        TableSlice.summaries, Cost.WORDS, ("summary",),
    ),
    FilterField(
        "confidence", NumberKind(0, 1, whole=False), "how sure the row's boundaries are", "confidence < 0.9",
        _column("confidence"),
    ),
    FilterField(
        "index", NumberKind(0, _HUGE), "number of the frame, from 0", "index in 1000..1100", _column("index"),
        aliases=("number",),
    ),
    FilterField(
        "length", NumberKind(0, _HUGE), "bytes", "length > 64", _column("length", all_rows=True),
        aliases=("frame.len",),
    ),
    FilterField(
        "start", NumberKind(0, _HUGE), "offset of the first byte in its port's stream", "start >= 4096",
        _column("start", all_rows=True),
    ),
    FilterField("port", NumberKind(0, 255), "which tap of several", "port == 1", _column("port", all_rows=True)),
    FilterField(
        "protocol", Named("protocol", _protocols), "envelope of the frame", "protocol == ascii", _column("protocol"),
    ),
    FilterField(
        "uart_errors", NumberKind(1, 0xFFFF), "bytes with a UART parity or framing error", "uart_errors > 0",
        _where("errors", lambda errors: errors.values > 0), aliases=("parity_errors",),
    ),
)  # fmt: skip


@cache
def by_name() -> Mapping[str, FilterField]:
    """Fields by all their names."""
    return MappingProxyType({name: field for field in FIELDS for name in (field.name, *field.aliases)})
