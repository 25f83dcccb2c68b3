"""Values that a map computes from others."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import ran

from analyzer.simulation.conversation import adu
from dissectors.maps import MapError, shipped_map
from dissectors.maps.formulas import Formula, FormulaError, formula_of
from dissectors.maps.model import readings_by_map
from dissectors.maps.table import read_table, write_table

SUPPLY = shipped_map("el-psu")


def settings(kind: int) -> dict[tuple[str, int], int]:
    """The registers of the supply that its voltage follows from: 0.5 V, a gain of 1.25, a limit of 100.0 V."""
    words = struct.unpack(">4H", struct.pack(">ff", 0.5, 1.25))
    return {("holding", 3): kind, ("holding", 15): 1000, **{("holding", 6 + at): word for at, word in enumerate(words)}}


@pytest.mark.parametrize(("kind", "limit"), [(0, 27.5), (9, 550), (11, 100)])
def test_the_voltage_of_the_supply_as_its_manual_computes_it(kind: int, limit: float) -> None:
    (reading,) = readings_by_map(SUPPLY, "input", {0: 13107}, settings(kind))
    assert reading.value == pytest.approx(0.5 + 13107 / 65535 * 1.25 * limit)
    assert reading.text == f"{0.5 + 0.2 * 1.25 * limit:.7g} V"
    assert reading.to_json()["unit_of_measure"] == "V" and reading.raw == 13107


def test_what_is_not_known_is_named_and_the_code_stays() -> None:
    (reading,) = readings_by_map(SUPPLY, "input", {0: 13107})
    assert reading.value is None
    assert reading.text == "13107 (needs Voltage offset, Voltage gain, Voltage limit, Supply type)"
    (reading,) = readings_by_map(SUPPLY, "input", {0: 13107}, settings(5))
    assert (reading.value, reading.text) == (None, "13107 (needs another state)")


def test_parse_computes_from_the_frames_before(capsys: pytest.CaptureFixture[str]) -> None:
    def asked(function: int, address: int, words: list[int]) -> bytes:
        data = struct.pack(f">{len(words)}H", *words)
        return adu(1, struct.pack(">BHH", function, address, len(words))) + adu(1, bytes((function, len(data))) + data)

    known = settings(0)
    frames = asked(3, 3, [0]) + asked(3, 6, [known["holding", 6 + at] for at in range(4)]) + asked(3, 15, [1000])
    shown = ran(capsys, "parse", "--map", "el-psu", (frames + asked(4, 0, [13107])).hex()).out
    assert "Voltage code  7.375 V" in shown
    assert "Voltage code  13107 (needs" in ran(capsys, "parse", "--map", "el-psu", asked(4, 0, [13107]).hex()).out


def test_a_formula_survives_the_file() -> None:
    assert read_table(write_table(SUPPLY), "x.csv").rows == SUPPLY.rows
    with pytest.raises(MapError, match=r"row 2: formula is 'raw \*\* 2': expected numbers"):
        read_table("area,address,name,formula\nholding,1,U,raw ** 2\n", "x.csv")
    with pytest.raises(MapError, match=r"x\.csv: formulas: formula is 'Nobody': expected the name of a value"):
        read_table("area,address,name,formula\nholding,1,U,[Nobody] * 2\n", "x.csv")


@pytest.mark.parametrize(
    "text",
    ["__import__('os')", "raw ** 9", "9 if raw else 1", "raw.real", "raw(1)", "'a' * raw", "v0", "[a", "lambda: 1",
     "raw; raw = 1" * 40,
     "(" * 290, "-" * 290 + "1", "{raw: 1}", "[raw, raw]", "{**raw}[U]", "True + raw", "raw[0]"],
)  # fmt: skip
def test_nothing_but_arithmetic_is_a_formula(text: str) -> None:
    try:
        value = formula_of(text).value(1.0, lambda _: None)
    except FormulaError:
        pass
    else:
        assert value is None or text.startswith("-")


@given(st.text(max_size=60), st.floats())
def test_no_formula_harms(text: str, raw: float) -> None:
    try:
        formula = Formula(text)
    except FormulaError:
        return
    formula.value(raw, lambda _: raw)


def test_division_by_nothing_is_no_value() -> None:
    assert formula_of("raw / [U]").value(4.0, lambda _: 0.0) is None
    assert formula_of("raw / [U]").value(4.0, lambda _: 8.0) == 0.5


def test_a_formula_has_300_characters_at_most() -> None:
    longest = "raw" + " + 1" * 74 + " "
    assert len(longest) == 300
    assert formula_of(longest).value(1.0, lambda _: None) == 75
    with pytest.raises(FormulaError):
        formula_of(longest + " ")
