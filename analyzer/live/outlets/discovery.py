"""What Home Assistant is told, so that values and units appear by themselves (its MQTT discovery)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from dissectors.maps.model import MappedValue, RegisterMap

from ...exports.targets.mcap.values import topic_name
from ...version import __version__

_CLASSES: Final = {  # unit of measure: device class
    "V": "voltage", "A": "current", "W": "power", "kW": "power", "VA": "apparent_power", "var": "reactive_power",
    "Hz": "frequency", "Wh": "energy", "kWh": "energy", "MWh": "energy", "°C": "temperature", "°F": "temperature",
    "Pa": "pressure", "bar": "pressure", "kPa": "pressure",
}  # fmt: skip
_GROWS: Final = ("Wh", "kWh", "MWh")
_NUMBERLESS: Final = ("enum", "bits", "text", "time")
Entity = tuple[str, Mapping[str, Any]]  # the topic behind the prefix, and what stands there


def node_of(base: str) -> str:
    """The part of Home Assistant's topics that is ours."""
    return topic_name(base.replace("/", "_"))


def value_entity(base: str, unit: int, row: MappedValue, topic: str, chart: RegisterMap | None) -> Entity:
    """A mapped value as a sensor."""
    config = {**_of_unit(base, unit, chart), "name": row.name, "state_topic": f"{base}/{topic}"}
    if row.type not in _NUMBERLESS and row.area in ("holding", "input"):
        config["state_class"] = "total_increasing" if row.unit in _GROWS else "measurement"
        if row.unit:
            config["unit_of_measurement"] = row.unit
        if row.unit in _CLASSES:
            config["device_class"] = _CLASSES[row.unit]
    return _entity("sensor", base, topic, config)


def health_entity(base: str, unit: int, chart: RegisterMap | None) -> Entity:
    """Whether a unit answers, with its counts as attributes."""
    topic = f"unit/{unit}/health"
    config = {
        **_of_unit(base, unit, chart),
        "name": "Answers",
        "device_class": "connectivity",
        "state_topic": f"{base}/{topic}",
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
    return {
        "device": device,
        "origin": {"name": "rtuscope", "sw_version": __version__},
        "availability_topic": f"{base}/status",
    }
