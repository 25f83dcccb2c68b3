"""Sites other than the usual ones: writes alone, a unit twice as fast behind a tap without marks, RTU among ASCII."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest

from analyzer.causes.foreignframes import PROTOCOLS, rtu_frames
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import Bench, Expected, FieldCapture, read_pdu, site, write_pdu
from analyzer.simulation.field.cases.drivers import duplicated
from analyzer.simulation.field.cases.registry import field_cases
from analyzer.simulation.field.master import FieldPoll
from captures.chunks import Capture
from dissectors.crc import crc_bytes


def _named(made: FieldCapture) -> list[tuple[str, tuple[int, ...]]]:
    capture = Capture.of(made.line, made.chunks)
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))
    return [(cause.cause, cause.units) for cause in found]


def _bench(seed: int, tap: str, *pdus: Callable[[float], bytes]) -> Bench:
    bench = site(Random(seed), tap, units=(3, 3), bauds=(9600,), seconds=(60, 60.1), parities=("N",))
    bench.master.polls = [FieldPoll(unit, pdu) for unit in bench.units for pdu in pdus]
    bench.master.manners.pause_ms = lambda _: 60.0
    return bench


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_second_answers_to_writes_are_no_silence_in_spells(seed: int, tap: str) -> None:
    random = Random(seed)
    bench = _bench(seed, tap, write_pdu(random, 6, 10), write_pdu(random, 16, 100, 3))
    unit = bench.unit()
    unit.delay_ms = 10.0
    duplicated(bench.random, bench, unit)
    assert "unit-restarts" not in [cause for cause, _ in _named(bench.run(Expected("duplicate-address")))]


@pytest.mark.parametrize("seed", [1, 2])
def test_answers_half_as_long_are_not_those_of_a_driver_that_is_late(seed: int) -> None:
    bench = _bench(seed, "precise", read_pdu(3, 0, 10), read_pdu(3, 50, 2))
    bench.marks_errors, unit = False, bench.unit()
    unit.sends = replace(bench.uart, baud=19200)
    assert _named(bench.run(Expected(None)))[0] == ("unit-line-settings", (unit.unit,))


def test_ones_and_zeros_that_check_as_long_as_they_last_are_no_meters_frames() -> None:
    meter = PROTOCOLS["a meter's own protocol with the CRC of Modbus"]
    random = Random(4)
    answers = [bytes.fromhex("440017ffff00000000000041") + random.randbytes(11) for _ in range(60)]
    assert not meter(b"".join(answers))
    frames = [each + crc_bytes(each) for each in (bytes.fromhex("02de439d63") + random.randbytes(7) for _ in range(60))]
    assert meter(b"".join(frames)) == 60


def test_rtu_among_lines_of_ascii_is_another_protocol() -> None:
    assert _named(field_cases()["other-protocol"].capture("precise", 61000))[0] == ("other-protocol", ())


def test_requests_of_rtu_are_counted_in_any_bytes() -> None:
    asked = bytes.fromhex("0e0300000006")
    request = asked + crc_bytes(asked)
    assert rtu_frames([b"\r\n:0A" + request + request, request[:-1], b""]) == 2
