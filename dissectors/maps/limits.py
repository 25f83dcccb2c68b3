"""What a map says that its device takes, and what of a request is beyond it.

    limits = device_limits(chart)
    limits.longest_frame            # 40: bytes of an ADU, unit and check value counted; None where the map is silent
    breaches(chart, MapRequest(6, "holding", 8, 1, (0x3F80,)))

The header says it of the whole device: `longest_frame: 40`, `longest_read: 16`, `longest_write: 16` (registers),
`functions: 3, 4, 16`, `exceptions: 02 illegal address; 03 value out of range`. A row says it of its value: `access`,
`written_by` (functions), `min`, `max`, `values` of an enum. What is not said is not held against anybody; a header
that cannot be read says nothing. A breach carries numbers only: words are for who tells it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from ..limits import OVERHEAD
from .model import BIT_AREAS, MapArea, MappedValue, RegisterMap, read_mapped

WRITERS: Final = frozenset({5, 6, 15, 16, 22, 23})
"""Functions that write coils or registers ([1] 6.5, 6.6, 6.11, 6.12, 6.16, 6.17)."""
_COUNTED: Final = {5: 0, 6: 0, 15: 6, 16: 6}  # bytes of a request's PDU before what it writes; 0: fixed
_FIXED_PDU: Final = 5  # bytes: function, address, and a quantity or a value
_ANSWER_HEAD: Final = 2  # bytes: function and byte count

BreachKind = Literal["function", "frame", "quantity", "read-only", "writer", "part", "low", "high", "state"]


@dataclass(frozen=True, slots=True)
class DeviceLimits:
    """What a device takes, by its map's header. `longest_frame`: bytes of an ADU, in either direction; `longest_read`,
    `longest_write`: registers of one request; `functions`: the codes that it knows, none where it is not said;
    `exceptions`: what it means by each exception code."""

    longest_frame: int | None = None
    longest_read: int | None = None
    longest_write: int | None = None
    functions: frozenset[int] = frozenset()
    exceptions: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class MapRequest:
    """A request as a map sees it: `quantity` registers or bits from `address` (0-based) on; `words` are the registers
    (or bits) that it writes, from `address` on, none where it reads."""

    function: int
    area: MapArea
    address: int
    quantity: int
    words: Sequence[int] = ()

    @property
    def longer_frame(self) -> int:
        """Bytes of the longer ADU of request and answer ([1] 6.1 to 6.12)."""
        octets = (self.quantity + 7) // 8 if self.area in BIT_AREAS else 2 * self.quantity
        written = _COUNTED.get(self.function)
        head = _ANSWER_HEAD if written is None else written
        return OVERHEAD + max(_FIXED_PDU, (head + octets) * (head > 0))


@dataclass(frozen=True, slots=True)
class MapBreach:
    """What is beyond the map. `asked` stands against `limit`: function codes (`function`, `writer`: any of `limit`),
    bytes (`frame`), registers (`quantity`; `part`: of the value's own number), or the value in its unit of measure
    (`low`, `high`, `state`); `row` is the value that it is about, None where it is the whole request."""

    kind: BreachKind
    asked: float
    limit: tuple[float, ...] = ()
    row: MappedValue | None = None


def device_limits(chart: RegisterMap) -> DeviceLimits:
    """What the header of a map says that its device takes."""
    said = chart.other
    return DeviceLimits(
        longest_frame=_whole(said.get("longest_frame", "")),
        longest_read=_whole(said.get("longest_read", "")),
        longest_write=_whole(said.get("longest_write", "")),
        functions=frozenset(codes_in(said.get("functions", ""))),
        exceptions=dict(_exceptions(said.get("exceptions", ""))),
    )


def codes_in(text: str) -> tuple[int, ...]:
    """Function codes as a map lists them, decimal or hexadecimal with 0x: `3, 4, 0x10`."""
    return tuple(dict.fromkeys(int(code, 0 if "x" in code.lower() else 10) for code in _CODE.findall(text)))


_CODE: Final = re.compile(r"\b(?:0[xX][0-9A-Fa-f]{1,2}|\d{1,3})\b")


def _whole(text: str) -> int | None:
    """The number that a header begins with: `40 bytes`."""
    number = re.match(r"\s*(\d{1,5})\b", text)
    return int(number[1]) if number else None


def _exceptions(text: str) -> Iterator[tuple[int, str]]:
    """`02 illegal address; 03 value out of range`: codes of two digits."""
    for code, words in re.findall(r"\b0?([1-9][0-9]?)\W+([^;]+)", text):
        yield int(code), words.strip()


def breaches(chart: RegisterMap, request: MapRequest) -> Iterator[MapBreach]:
    """What of a request its device does not take by its map, the request as a whole first."""
    limits = device_limits(chart)
    if limits.functions and request.function not in limits.functions:
        yield MapBreach("function", request.function, tuple(sorted(limits.functions)))
    most = limits.longest_write if request.function in WRITERS else limits.longest_read
    sizes: tuple[tuple[BreachKind, int, int | None], ...] = (
        ("frame", request.longer_frame, limits.longest_frame),
        ("quantity", request.quantity, most),
    )
    for kind, asked, limit in sizes:
        if limit is not None and asked > limit:
            yield MapBreach(kind, asked, (limit,))
    if request.function in WRITERS:
        yield from _of_values(chart, request)


def _of_values(chart: RegisterMap, request: MapRequest) -> Iterator[MapBreach]:
    end = request.address + request.quantity
    for row in chart.rows:
        if row.area != request.area or row.end <= request.address or end <= row.address:
            continue
        if row.access == "r":
            yield MapBreach("read-only", request.function, (), row)
        if row.written_by and request.function not in row.written_by:
            yield MapBreach("writer", request.function, row.written_by, row)
        covered = min(end, row.end) - max(request.address, row.address)
        if covered < row.length:
            yield MapBreach("part", covered, (row.length,), row)
        elif len(request.words) == request.quantity:
            at = row.address - request.address
            yield from value_breaches(row, request.words[at : at + row.length])


def value_breaches(row: MappedValue, words: Sequence[int]) -> Iterator[MapBreach]:
    """How a value, by its registers, is beyond what its map allows."""
    value = read_mapped(row, words, None).value
    if not isinstance(value, int | float):
        return
    slack = 1e-6 * abs(value) if row.is_float else 0.51 * abs(row.scale)  # a limit may be rounded to a step
    bounds: tuple[tuple[BreachKind, float | None, int], ...] = (("low", row.minimum, -1), ("high", row.maximum, 1))
    for kind, bound, sign in bounds:
        if bound is not None and sign * (value - bound) > slack:
            yield MapBreach(kind, value, (bound,), row)
    if row.type == "enum" and row.values and value not in row.values:
        yield MapBreach("state", value, tuple(row.values), row)
