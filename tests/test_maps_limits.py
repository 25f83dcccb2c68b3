"""What a map says that its device takes, and what of a request is beyond it."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.maps import RegisterMap, shipped_map
from dissectors.maps.limits import MapRequest, breaches, device_limits
from dissectors.maps.model import MapArea, MappedValue
from dissectors.maps.table import read_table, write_table

SUPPLY = shipped_map("el-psu")


def test_the_header_of_the_supply() -> None:
    limits = device_limits(SUPPLY)
    assert limits.longest_frame == 40
    assert limits.functions == {3, 4, 6, 16, 17}
    assert dict(limits.exceptions) == {2: "illegal address", 3: "value out of range"}
    assert (limits.longest_read, limits.longest_write) == (None, None)


REQUESTS = {
    "all is well": (MapRequest(3, "holding", 0, 16), []),
    "a function that it does not know": (MapRequest(1, "coil", 0, 8), [("function", 1, None)]),
    "an answer of 41 bytes": (MapRequest(3, "holding", 0, 18), [("frame", 41, None)]),
    "a write of 41 bytes": (MapRequest(16, "holding", 100, 16, (0,) * 16), [("frame", 41, None)]),
    "half of a float by function 06": (
        MapRequest(6, "holding", 8, 1, (0x3F80,)),
        [("writer", 6, "Voltage gain"), ("part", 1, "Voltage gain")],
    ),
    "a whole float by function 16": (MapRequest(16, "holding", 8, 2, (0x3F80, 0)), []),
    "over its greatest value": (
        MapRequest(6, "holding", 4, 1, (1024,)),
        [("high", 1024, "Voltage PWM")],
    ),
    "under its least": (MapRequest(6, "holding", 0, 1, (0,)), [("low", 0, "Unit")]),
    "a state without a name": (
        MapRequest(6, "holding", 3, 1, (5,)),
        [("state", 5, "Supply type")],
    ),
    "its greatest value, and its least": (MapRequest(16, "holding", 4, 1, (1023,)), []),
    "values whose words are not known": (MapRequest(16, "holding", 4, 1), []),
}  # fmt: skip


@pytest.mark.parametrize("case", REQUESTS)
def test_what_a_request_has_beyond_the_map(case: str) -> None:
    request, expected = REQUESTS[case]
    found = [(one.kind, one.asked, one.row.name if one.row else None) for one in breaches(SUPPLY, request)]
    assert found == expected


def test_a_value_that_is_only_read() -> None:
    chart = RegisterMap("x", (MappedValue("holding", 5, "U", "u16", access="r"),))
    assert [one.kind for one in breaches(chart, MapRequest(6, "holding", 5, 1, (1,)))] == ["read-only"]


def test_longest_requests_and_headers_that_say_nothing() -> None:
    chart = replace(SUPPLY, other={"longest_read": "10 registers", "functions": "all", "longest_frame": "short"})
    limits = device_limits(chart)
    assert (limits.longest_read, limits.longest_frame, limits.functions) == (10, None, frozenset())
    assert [one.kind for one in breaches(chart, MapRequest(3, "holding", 0, 11))] == ["quantity"]


LIMITED = {  # header of the map, function, area, quantity: what is beyond it
    "as many registers as it reads": ({"longest_read": "10"}, 3, "holding", 10, []),
    "as many as it writes": ({"longest_write": "4", "longest_read": "1"}, 16, "holding", 4, []),
    "more than it writes": ({"longest_write": "4", "longest_read": "9"}, 16, "holding", 5, [("quantity", 5.0, (4.0,))]),
    "functions in hex and decimal": ({"functions": "0x10, 3"}, 4, "input", 1, [("function", 4.0, (3.0, 16.0))]),
    "a function with a decimal zero": ({"functions": "03 10"}, 10, "holding", 1, []),
    "coils in whole bytes": ({"longest_frame": "8"}, 1, "coil", 24, []),
    "one coil more": ({"longest_frame": "8"}, 1, "coil", 25, [("frame", 9.0, (8.0,))]),
    "a request is eight bytes itself": ({"longest_frame": "7"}, 6, "holding", 1, [("frame", 8.0, (7.0,))]),
}  # fmt: skip


@pytest.mark.parametrize("case", LIMITED)
def test_limits_of_headers(case: str) -> None:
    other, function, area, quantity, expected = LIMITED[case]
    request = MapRequest(function, cast(MapArea, area), 0, quantity)
    found = breaches(RegisterMap("x", (), other=other), request)
    assert [(one.kind, one.asked, one.limit) for one in found] == expected


WIDE = MappedValue("holding", 5, "U", "u32", length=2, scale=0.5, minimum=2.25, maximum=9.25)
VALUES = {"half a step under": (4, []), "less": (3, ["low"]), "half a step over": (19, []), "more": (20, ["high"])}


@pytest.mark.parametrize("case", VALUES)
def test_values_at_their_bounds(case: str) -> None:
    raw, expected = VALUES[case]
    chart = RegisterMap("x", (WIDE,))
    assert [one.kind for one in breaches(chart, MapRequest(16, "holding", 4, 3, (0, 0, raw)))] == expected


@pytest.mark.parametrize(
    ("address", "quantity", "asked"), [(4, 1, None), (4, 2, 1), (5, 1, 1), (6, 3, 1), (7, 2, None)]
)
def test_parts_of_a_value(address: int, quantity: int, asked: int | None) -> None:
    request = MapRequest(16, "holding", address, quantity, (0,) * quantity)
    found = [(one.asked, one.limit) for one in breaches(RegisterMap("x", (WIDE,)), request)]
    assert found == ([(asked, (2,))] if asked else [])


def test_writers_survive_the_file_and_wrong_ones_are_an_error() -> None:
    assert read_table(write_table(SUPPLY), "x.csv").rows == SUPPLY.rows
    assert {row.written_by for row in SUPPLY.rows if row.is_float and row.area == "holding"} == {(16,)}
    with pytest.raises(ValueError, match="written_by is '200': expected function codes"):
        read_table("area,address,name,written_by\nholding,1,U,200\n", "x.csv")


@given(st.dictionaries(st.sampled_from(("functions", "longest_frame", "exceptions")), st.text(max_size=40)))
def test_no_header_harms(said: dict[str, str]) -> None:
    device_limits(replace(SUPPLY, other=said))
