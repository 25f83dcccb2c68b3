"""What Home Assistant is told for values and units to appear in it by themselves (its MQTT discovery).

`CLASSES` says which of its device classes a unit of measure belongs to, and what it makes of their history. The names
and spellings are Home Assistant's; a test compares them with its own constants where those are at hand. Units that
several of its classes have (%) are told apart by the name of the value, and units that none has stand as they are.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from dissectors.maps.model import MappedValue, RegisterMap

from ...exports.targets.mcap.schemas import topic_name
from ...version import __version__

Entity = tuple[str, Mapping[str, Any]]  # the topic behind the prefix, and what stands there


class SensorClass(NamedTuple):
    """A device class, or None: `state` is what is made of its history, `units` those that stand for it."""

    device: str | None
    state: str
    units: tuple[str, ...]


_NOW, _GROWS = "measurement", "total_increasing"

CLASSES: Final = (
    SensorClass("apparent_power", _NOW, ("mVA", "VA", "kVA")),
    SensorClass("area", _NOW, ("mm²", "cm²", "m²", "km²", "ha")),
    SensorClass("conductivity", _NOW, ("S/cm", "mS/cm", "μS/cm")),
    SensorClass("current", _NOW, ("μA", "mA", "A")),
    SensorClass("data_rate", _NOW, ("bit/s", "kbit/s", "Mbit/s", "Gbit/s", "B/s", "kB/s", "MB/s", "GB/s")),
    SensorClass("distance", _NOW, ("mm", "cm", "m", "km", "in", "ft", "yd", "mi")),
    SensorClass("duration", _NOW, ("μs", "ms", "s", "min")),
    SensorClass("duration", _GROWS, ("h", "d")),  # of operation, as meters and drives count them
    SensorClass("energy", _GROWS, ("J", "kJ", "MJ", "GJ", "mWh", "Wh", "kWh", "MWh", "GWh", "TWh", "Mcal", "Gcal")),
    SensorClass("frequency", _NOW, ("mHz", "Hz", "kHz", "MHz", "GHz")),
    SensorClass("illuminance", _NOW, ("lx",)),
    SensorClass("irradiance", _NOW, ("W/m²",)),
    SensorClass("power", _NOW, ("mW", "W", "kW", "MW", "GW", "TW")),
    SensorClass("precipitation_intensity", _NOW, ("mm/h", "mm/d")),
    SensorClass("pressure", _NOW, ("Pa", "hPa", "kPa", "mbar", "cbar", "bar", "mmHg", "inHg", "psi")),
    SensorClass("reactive_energy", _GROWS, ("varh", "kvarh")),
    SensorClass("reactive_power", _NOW, ("mvar", "var", "kvar")),
    SensorClass("signal_strength", _NOW, ("dBm",)),
    SensorClass("sound_pressure", _NOW, ("dB", "dBA")),
    SensorClass("speed", _NOW, ("m/s", "mm/s", "m/min", "km/h", "ft/s", "mph")),
    SensorClass("temperature", _NOW, ("°C", "°F", "K")),
    SensorClass("voltage", _NOW, ("μV", "mV", "V", "kV", "MV")),
    SensorClass("volume", _GROWS, ("mL", "L", "m³", "ft³", "gal")),
    SensorClass("volume_flow_rate", _NOW, ("mL/s", "L/s", "L/min", "L/h", "m³/s", "m³/min", "m³/h", "gal/min")),
    SensorClass("weight", _NOW, ("mg", "g", "kg", "oz", "lb")),
    SensorClass(None, _GROWS, ("mAh", "Ah", "kAh", "VAh", "kVAh", "MVAh", "MVArh")),
    SensorClass(None, _NOW, ("%", "°", "rpm", "Nm", "Ω", "kΩ", "MΩ", "GJ/h", "ppm", "ppb", "kg/h", "t/h", "N", "kN")),
)  # fmt: skip

BY_NAME: Final = (  # a name says what its unit does not
    (re.compile(r"humid|влажн|feuchte", re.I), "humidity", ("%",)),
    (re.compile(r"state of charge|\bsoc\b|battery (?:level|charge)|заряд батаре", re.I), "battery", ("%",)),
    (re.compile(r"power factor|\bcos ?(?:φ|phi)|коэффициент мощности", re.I), "power_factor", ("%", "")),
    (re.compile(r"\bph\b", re.I), "ph", ("",)),
    (re.compile(r"\bco2\b|carbon dioxide", re.I), "carbon_dioxide", ("ppm",)),
)

SPELLINGS: Final[Mapping[str, str]] = {  # as people write them in maps: as Home Assistant does
    **dict.fromkeys(("m3", "m^3", "cbm", "м³", "м3"), "m³"), **dict.fromkeys(("m3/h", "m^3/h", "м³/ч", "м3/ч"), "m³/h"),
    **dict.fromkeys(("VAr", "VAR", "Var", "вар"), "var"), **dict.fromkeys(("kVAr", "kVAR", "kVar", "квар"), "kvar"),
    **dict.fromkeys(("VArh", "VARh", "Varh"), "varh"), **dict.fromkeys(("kVArh", "kVARh", "kVarh"), "kvarh"),
    **dict.fromkeys(("degC", "deg C", "° C", "ºC", "℃"), "°C"), **dict.fromkeys(("degF", "deg F", "° F", "ºF"), "°F"),
    "µA": "μA", "µV": "μV", "µs": "μs", "us": "μs", "µS/cm": "μS/cm", "uS/cm": "μS/cm", "ohm": "Ω", "kohm": "kΩ",
    "l": "L", "л": "L", "l/min": "L/min", "л/мин": "L/min", "l/h": "L/h", "л/ч": "L/h",
    "l/s": "L/s", **dict.fromkeys(("sec", "с"), "s"), **dict.fromkeys(("hrs", "hours", "ч"), "h"), "days": "d",
    "мин": "min", **dict.fromkeys(("RPM", "1/min", "min⁻¹", "об/мин"), "rpm"), "deg": "°", "W/m2": "W/m²",
    "В": "V", "А": "A", "Вт": "W", "кВт": "kW", "Гц": "Hz", "кВт·ч": "kWh", "кВтч": "kWh", "Вт·ч": "Wh", "кПа": "kPa",
    "Па": "Pa", "бар": "bar", "м/с": "m/s", "кг": "kg", "Гкал": "Gcal", "ГДж": "GJ",
}  # fmt: skip

_OF_UNIT: Final = {unit: each for each in CLASSES for unit in each.units}
_WORDS: Final = ("enum", "bits", "text", "time")  # types that give no number
_BALANCE: Final = re.compile(r"\bnet\b|balance|сальдо", re.I)  # goes down, too
_ALL: Final = "all"
_ON, _OFF = "1", "0"


def node_of(base: str) -> str:
    """The part of Home Assistant's topics that is ours."""
    return topic_name(base.replace("/", "_"))


def available_topic(unit: int) -> str:
    """Where it is told, below the base, whether a unit is there: `online` or `offline`."""
    return f"unit/{unit}/available"


def value_entity(
    base: str, unit: int, row: MappedValue, topic: str, chart: RegisterMap | None, expire_s: int
) -> Entity:
    """A mapped value; it is shown as unavailable without us, without its unit, and `expire_s` after the last one."""
    there = [{"topic": f"{base}/status"}, {"topic": f"{base}/{available_topic(unit)}"}]
    config: dict[str, Any] = {
        **_of_unit(base, unit, chart),
        "name": row.name,
        "state_topic": f"{base}/{topic}",
        "availability": there,
        "availability_mode": _ALL,
        "expire_after": expire_s,
    }
    if row.area in ("coil", "discrete") or row.type == "bool":
        return _entity("binary_sensor", base, topic, {**config, "payload_on": _ON, "payload_off": _OFF})
    return _entity("sensor", base, topic, {**config, **sensor_of(row)})


def sensor_of(row: MappedValue) -> dict[str, str]:
    """What kind of sensor a register's value is. What can be written is a setting, of which no statistics are kept."""
    config: dict[str, str] = {}
    if row.writable:
        config["entity_category"] = "diagnostic"
    if row.type in _WORDS:
        return config
    unit = SPELLINGS.get(row.unit, row.unit)
    told = _OF_UNIT.get(unit, SensorClass(None, _NOW, ()))
    device = next((name for words, name, units in BY_NAME if unit in units and words.search(row.name)), told.device)
    state = "total" if told.state == _GROWS and _BALANCE.search(row.name) else told.state
    if unit:
        config["unit_of_measurement"] = unit
    if device is not None:
        config["device_class"] = device
    if row.writable and device in ("energy", "reactive_energy", "volume"):
        del config["device_class"]  # those are for what grows, and it shows them only with statistics
    bare = not unit and device is None and not row.is_float and row.scale == 1
    if not row.writable and not bare:  # a bare number is a version, a code, an address
        config["state_class"] = state
    return config


def health_entity(base: str, unit: int, chart: RegisterMap | None) -> Entity:
    """Whether a unit answers, with its counts as attributes."""
    topic = f"unit/{unit}/health"
    config = {
        **_of_unit(base, unit, chart),
        "name": "Answers",
        "device_class": "connectivity",
        "entity_category": "diagnostic",
        "state_topic": f"{base}/{topic}",
        "availability_topic": f"{base}/status",
        "value_template": "{{ 'ON' if value_json.answers else 'OFF' }}",
        "json_attributes_topic": f"{base}/{topic}",
    }
    return _entity("binary_sensor", base, topic, config)


def _entity(kind: str, base: str, topic: str, config: dict[str, Any]) -> Entity:
    node = node_of(base)
    name = topic_name(topic.replace("/", "_"))
    return f"{kind}/{node}/{name}/config", {**config, "unique_id": f"{node}_{name}"}


def _of_unit(base: str, unit: int, chart: RegisterMap | None) -> dict[str, Any]:
    device: dict[str, Any] = {"identifiers": [f"{node_of(base)}_unit_{unit}"], "name": f"Modbus unit {unit}"}
    if chart is not None:
        device |= {key: value for key, value in (("manufacturer", chart.vendor), ("model", chart.device)) if value}
    return {"device": device, "origin": {"name": "rtuscope", "sw_version": __version__}}
