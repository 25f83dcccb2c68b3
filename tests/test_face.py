"""`import rtuscope`: the public calls, their errors under one base, and their types."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import captures
from captures import samples
from dissectors import DeclarationError, Role, annotate, crc_ok, rtu

rtuscope = pytest.importorskip("rtuscope", reason="the project is not installed")
ROOT = Path(__file__).parents[1]


def test_a_capture_a_paste_a_frame_and_its_registers():
    bus = rtuscope.open(samples.path("healthy.jsonl"))
    assert sum(1 for _ in bus.frames()) > 100
    paste = rtuscope.parse("11 03 00 6B 00 03 76 87")
    assert [frame.to_json(0)["unit"] for frame in paste.frames()] == [17]
    assert rtuscope.build(3, unit=17, starting_address=107, quantity=3).hex() == "1103006b00037687"
    assert rtuscope.registers(bus) == rtuscope.registers(samples.path("healthy.jsonl")) != []


def test_every_error_is_under_one_base_and_still_its_own(tmp_path: Path):
    with pytest.raises(rtuscope.RtuscopeError, match="no such file") as told:
        rtuscope.open(tmp_path / "missing.mcap")
    assert isinstance(told.value, captures.CaptureError)
    with pytest.raises(rtuscope.RtuscopeError, match="no hex bytes"):
        rtuscope.parse("nothing here")
    with pytest.raises(rtuscope.RtuscopeError, match="needs starting_address") as missing:
        rtuscope.build(3, unit=17)
    assert isinstance(missing.value, DeclarationError)
    bus = rtuscope.open(samples.path("healthy.jsonl"))
    with pytest.raises(rtuscope.RtuscopeError, match="column 1"):
        bus.filter("unt == 3")
    with pytest.raises(rtuscope.RtuscopeError, match="no shipped map"):
        bus.with_maps("no-such-map")
    with pytest.raises(rtuscope.RtuscopeError, match="no suffix"):
        bus.export(tmp_path / "out")
    with pytest.raises(rtuscope.RtuscopeError), rtuscope.listen(str(tmp_path / "ttyNone")) as session:
        next(iter(session.steps()))


def test_a_capture_that_goes_while_it_is_read_is_under_the_base_too(tmp_path: Path):
    path = tmp_path / "bus.jsonl"
    path.write_bytes(Path(samples.path("healthy.jsonl")).read_bytes())
    bus = rtuscope.open(path)
    path.unlink()
    with pytest.raises(rtuscope.RtuscopeError):
        list(bus.batches())


@given(st.integers(0, 255), st.integers(0, 0xFFFF), st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=123))
def test_what_is_built_is_read_again(unit: int, address: int, values: list[int]):
    frame = rtuscope.build("write multiple registers", unit=unit, starting_address=address, registers=values)
    assert crc_ok(frame)
    read = {field.name: field.value for field in annotate(rtu(frame), Role.REQUEST)}
    assert (read["unit"], read["starting_address"], read["quantity"]) == (unit, address, len(values))
    assert read["byte_count"] == 2 * len(values)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ({"name": "no such", "unit": 1}, "no function 'no such' is declared: there are 1, 2, 3"),
        ({"name": 3, "unit": 1, "starting_address": 0, "quantity": 1, "bytes": 2}, "no field bytes; it has"),
        ({"name": 3, "unit": 1, "starting_address": 70_000, "quantity": 1}, "70000 does not fit 2 bytes"),
        ({"name": 16, "unit": 1, "starting_address": 0, "registers": ["x"]}, "registers: required argument"),
        ({"name": 6, "unit": 300, "register_address": 0, "register_value": 1}, "unit 300"),
    ],
)
def test_fields_that_do_not_fit_are_one_line(call: dict[str, object], words: str):
    with pytest.raises(rtuscope.RtuscopeError, match=words):
        rtuscope.build(call.pop("name"), **call)


def test_a_type_checker_knows_what_each_call_gives():
    pytest.importorskip("mypy", reason="the extra `lint` is not installed")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "typing_tests/face.py"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout
