"""What Home Assistant is told: no value is shown longer than it is known to be so; units and classes are its own."""

from __future__ import annotations

import ast
import importlib.util
import json
import os
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from buses import LINE, adu, spaced
from hypothesis import given
from hypothesis import strategies as st

from analyzer.live import Replay, Session
from analyzer.live.outlets.freshness import Freshness, Presence
from analyzer.live.outlets.homeassistant import BY_NAME, CLASSES, SPELLINGS, sensor_of, value_entity
from analyzer.live.session import SessionStep
from captures.chunks import Capture
from captures.live.wire import PortEvent
from dissectors.maps import read_map, shipped_map, shipped_names
from dissectors.maps.model import MappedValue

pytest.importorskip("paho.mqtt.client")

MAP = "area,address,name,type,unit,access\nholding,107,Power,u16,W,\ncoil,0,Pump running,bool,,\n"
ANSWER = "110302"
POWER, AVAILABLE = "rtuscope/unit/17/values/Power", "rtuscope/unit/17/available"
CONFIG = "homeassistant/sensor/rtuscope/unit_17_values_Power/config"


class Bench:
    """An outlet without a broker, a clock that is set by hand, and steps of a bus."""

    def __init__(self, folder: Path) -> None:
        from analyzer.live.outlets.mqtt import Mqtt

        (folder / "m.csv").write_text(MAP)
        self.now = 1000.0
        self.outlet = Mqtt(
            "mqtt://127.0.0.1:1", {17: read_map(folder / "m.csv")}, lambda _: None, clock=lambda: self.now
        )

    def hear(self, *pdus: str) -> None:
        capture = Capture.of(LINE, spaced([adu(pdu) for pdu in pdus]))
        with Session(Replay(capture, None)) as session:
            for step in session.steps():
                self.outlet.feed(step, LINE)

    def poll(self, value: int, wait_s: float = 1.0) -> None:
        self.hear("1103006b0001", f"{ANSWER}{value:04x}")
        self.pass_time(wait_s)

    def pass_time(self, seconds: float) -> None:
        self.now += seconds
        self.event()

    def event(self, *kinds: str) -> None:
        from analyzer.core import Analysed

        events = [PortEvent(0, 0, kind, kind, {}) for kind in kinds]
        self.outlet.feed(SessionStep(0, Analysed.nothing(), events), LINE)

    @property
    def states(self) -> Mapping[str, str]:
        return self.outlet._states

    def config(self, topic: str = CONFIG) -> Any:
        return json.loads(self.states[topic])


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path)
    yield bench
    bench.outlet.close()


def test_a_value_is_available_with_us_with_its_unit_and_while_it_is_polled(bench: Bench) -> None:
    for value in range(100, 108):
        bench.poll(value, 2.0)
    config = bench.config()
    assert config["availability"] == [{"topic": "rtuscope/status"}, {"topic": AVAILABLE}]
    assert config["availability_mode"] == "all"
    assert config["expire_after"] == 60
    assert bench.states[AVAILABLE] == "online"
    assert bench.states[POWER] == "107"


def test_a_unit_that_died_is_told_and_its_values_are_not_kept_at_the_broker(bench: Bench) -> None:
    bench.poll(100)
    bench.hear("1103006b0001", "1103006b0001")
    assert bench.states[AVAILABLE] == "online", "one request without an answer is no death"
    bench.hear(*["1103006b0001"] * 5)
    assert bench.states[AVAILABLE] == "offline"
    assert bench.states[POWER] == ""
    bench.poll(100)
    assert (bench.states[AVAILABLE], bench.states[POWER]) == ("online", "100"), "the same value, after all"


@pytest.mark.parametrize("what", ["the adapter is pulled", "the tap is away", "the client asks no more", "the end"])
def test_what_nobody_hears_any_more_is_not_shown_as_live(bench: Bench, what: str) -> None:
    for value in (100, 101, 102):
        bench.poll(value)
    if what == "the end":
        bench.outlet.close()
    elif what == "the client asks no more":
        bench.pass_time(50)
        assert bench.states[POWER] == "102"
        for _ in range(20):
            bench.pass_time(1)
    else:
        bench.event("lost" if "adapter" in what else "waiting")
        bench.pass_time(2)
        assert json.loads(bench.states["rtuscope/unit/17/health"])["answers"] is False
    assert bench.states[AVAILABLE] == "offline"
    assert bench.states[POWER] == ""


def test_a_value_that_nobody_asks_for_goes_stale_alone(bench: Bench) -> None:
    bench.hear("110100000001", "11010101")
    for _ in range(40):
        bench.poll(100, 10.0)
    assert bench.states["rtuscope/unit/17/values/Pump_running"] == ""
    assert (bench.states[POWER], bench.states[AVAILABLE]) == ("100", "online")


def test_a_value_that_stays_is_told_again_before_it_expires(bench: Bench) -> None:
    told: list[float] = []
    put = bench.outlet._mail.put
    bench.outlet._mail.put = lambda letter: (told.append(bench.now) if letter.topic == POWER else None, put(letter))[1]  # type: ignore[func-returns-value, method-assign]
    for _ in range(300):
        bench.poll(100, 1.0)
    gaps = [b - a for a, b in pairwise(told)]
    assert gaps[5:] and max(gaps[5:]) <= 60 / 2 and min(gaps[5:]) >= 10


def test_a_value_polled_once_an_hour_does_not_expire_between(bench: Bench) -> None:
    for _ in range(3):
        bench.poll(100, 3600.0)
    assert bench.config()["expire_after"] >= 2 * 3600
    assert bench.states[POWER] == "100"


def test_what_a_session_before_left_at_the_broker_is_taken_back(bench: Bench) -> None:
    bench.poll(100)
    bench.outlet._retained = {
        "rtuscope/unit/9/values/Voltage": "230", "rtuscope/unit/9/available": "online", POWER: "99",
        "rtuscope/unit/9/health": "{}", "homeassistant/sensor/rtuscope/x/config": "{}",
    }  # fmt: skip
    left = dict(bench.outlet._left_over())
    assert left == {"rtuscope/unit/9/values/Voltage": "", "rtuscope/unit/9/available": "offline", POWER: ""}


def test_coils_are_binary_sensors(bench: Bench) -> None:
    bench.hear("110100000001", "11010101")
    config = bench.config("homeassistant/binary_sensor/rtuscope/unit_17_values_Pump_running/config")
    assert (config["payload_on"], config["payload_off"]) == ("1", "0")
    assert config["expire_after"] and config["availability_mode"] == "all"
    assert bench.states["rtuscope/unit/17/values/Pump_running"] == "1"
    assert not any(topic.startswith("homeassistant/sensor") for topic in bench.states)


@given(st.lists(st.floats(0.05, 5000), min_size=2, max_size=60))
def test_nothing_that_comes_in_its_period_goes_stale(waits: list[float]) -> None:
    """Whatever the times between: one not longer than the middle of the newest five does not make it stale."""
    fresh, now = Freshness(), 0.0
    fresh.heard(now)
    for number, wait in enumerate(waits):
        newest = sorted(waits[max(0, number - 5) : number])
        if number and wait <= newest[len(newest) // 2]:
            assert not fresh.goes_stale(now + wait)
        now += wait
        fresh.heard(now)
    assert fresh.goes_stale(now + fresh.expire_s + 1)
    assert not fresh.goes_stale(now + 2 * fresh.expire_s), "once"


def test_a_presence_takes_three_misses_in_a_row() -> None:
    presence = Presence()
    for answered, unanswered, there in ((1, 0, True), (0, 2, True), (1, 0, True), (0, 2, True), (0, 1, False)):
        presence.settled(answered, unanswered, 0.0)
        assert presence.there is there


# Its device classes and units


def test_every_unit_of_the_shipped_maps_has_a_class_or_is_known_to_have_none() -> None:
    known = {unit for each in CLASSES for unit in each.units}
    units = {row.unit for name in shipped_names() for row in shipped_map(name).rows if row.unit}
    assert len(units) > 30
    assert {unit for unit in units if SPELLINGS.get(unit, unit) not in known} == set()


@pytest.mark.parametrize(
    ("row", "told"),
    [
        (("Total reactive energy", "f32", "kvarh", ""), ("reactive_energy", "total_increasing", None)),
        (("Active energy", "u32", "GJ", ""), ("energy", "total_increasing", None)),
        (("Net energy", "f32", "kWh", ""), ("energy", "total", None)),
        (("Humidity", "u16", "%", ""), ("humidity", "measurement", None)),
        (("Battery state of charge", "u16", "%", ""), ("battery", "measurement", None)),
        (("THD voltage L1", "f32", "%", ""), (None, "measurement", None)),
        (("Power factor L1", "f32", "", ""), ("power_factor", "measurement", None)),
        (("Flow", "f32", "m3/h", ""), ("volume_flow_rate", "measurement", None)),
        (("Baud rate", "u16", "", "rw"), (None, None, "diagnostic")),
        (("Pulse width", "f32", "ms", "rw"), ("duration", None, "diagnostic")),
        (("Energy limit", "f32", "kWh", "rw"), (None, None, "diagnostic")),
        (("Firmware version", "u16", "", ""), (None, None, None)),
        (("Running hours", "u32", "h", ""), ("duration", "total_increasing", None)),
        (("State", "enum", "", ""), (None, None, None)),
    ],
)
def test_what_a_value_is(row: tuple[str, str, str, str], told: tuple[str | None, ...]) -> None:
    name, kind, unit, access = row
    config = sensor_of(MappedValue("holding", 0, name, kind, unit=unit, access=access))
    assert (config.get("device_class"), config.get("state_class"), config.get("entity_category")) == told


def test_every_value_of_the_shipped_maps_is_announced_as_home_assistant_takes_it() -> None:
    units = {
        device: {unit for each in CLASSES if each.device == device for unit in each.units} for device, *_ in CLASSES
    }
    grows = {"energy", "reactive_energy", "volume"}
    count = 0
    for name in shipped_names():
        chart = shipped_map(name)
        for row in chart.rows:
            topic, config = value_entity("rtuscope", 1, row, f"unit/1/values/{row.address}", chart, 60)
            json.dumps(config)
            count += 1
            assert topic.startswith(
                "binary_sensor/" if row.area in ("coil", "discrete") else ("sensor/", "binary_sensor/")
            )
            device, state = config.get("device_class"), config.get("state_class")
            if device in grows:
                assert state in ("total", "total_increasing"), row
            elif device is not None and device != "duration":
                assert state in ("measurement", None), row
            if device in units and device is not None:
                assert config["unit_of_measurement"] in units[device], row
    assert count > 1000


def _home_assistant() -> Path | None:
    """Home Assistant's package, as files: installed, or unpacked where a variable says."""
    named = os.environ.get("RTUSCOPE_TEST_HOMEASSISTANT")
    if named:
        return Path(named)
    found = importlib.util.find_spec("homeassistant")
    return None if found is None or found.origin is None else Path(found.origin).parent


def _strings(node: ast.AST, names: Mapping[str, Any]) -> set[str | None]:
    """The units that a set of Home Assistant's source stands for."""
    if isinstance(node, ast.Constant):
        return {None if node.value is None else str(node.value)}
    if isinstance(node, ast.Name):
        value = names[node.id]
        return {value} if isinstance(value, str) else set(value.values())
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return {names[node.value.id][node.attr]}
    parts = node.elts if isinstance(node, ast.Set) else getattr(node, "args", [getattr(node, "value", None)])
    return set().union(*(_strings(part, names) for part in parts if part is not None))


@pytest.mark.skipif(_home_assistant() is None, reason="Home Assistant's package is not here")
def test_classes_units_and_states_are_home_assistants_own() -> None:
    folder = _home_assistant()
    assert folder is not None
    names: dict[str, Any] = {}
    for path in (folder / "const.py", folder / "components/sensor/const.py"):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                names[node.name] = {
                    each.targets[0].id: each.value.value
                    for each in node.body
                    if isinstance(each, ast.Assign) and isinstance(each.value, ast.Constant)
                    and isinstance(each.targets[0], ast.Name)
                }  # fmt: skip
            elif isinstance(node, ast.AnnAssign | ast.Assign):
                target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
                if isinstance(target, ast.Name) and isinstance(node.value, ast.Constant):
                    names[target.id] = node.value.value
                elif isinstance(target, ast.Name) and target.id in ("DEVICE_CLASS_UNITS", "DEVICE_CLASS_STATE_CLASSES"):
                    assert isinstance(node.value, ast.Dict)
                    names[target.id] = {
                        next(iter(_strings(key, names))): _strings(value, names)
                        for key, value in zip(node.value.keys, node.value.values, strict=True)
                        if key is not None
                    }
    units, states = names["DEVICE_CLASS_UNITS"], names["DEVICE_CLASS_STATE_CLASSES"]
    assert len(units) > 40
    for device, state, own in CLASSES:
        if device is not None:
            assert set(own) <= units[device], device
            assert state in states[device], device
    for _, device, own in BY_NAME:
        assert {unit or None for unit in own} <= units[device], device
        assert "measurement" in states[device]
