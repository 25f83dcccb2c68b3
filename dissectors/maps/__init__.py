"""Register maps: what the addresses of a device hold, from tables that people have and back to them.

    chart = read_map("meter.csv")           # or the name of a map that comes with this package
    chart.at("input", 0)                    # MappedValue(name="Voltage L1", type="f32", ...)

`model` is what a map is, `cells` what stands in a column, `table` and `yamlform` the two forms of a file, `files` finds
them, `importers` reads what other programs and spreadsheets have. Nothing here knows of captures or time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from .files import map_for_unit, map_text, read_map, shipped_map, shipped_names
    from .model import DeviceSignature, MapError, MappedValue, RegisterMap

__all__ = [
    "DeviceSignature",
    "MapError",
    "MappedValue",
    "RegisterMap",
    "map_for_unit",
    "map_text",
    "read_map",
    "shipped_map",
    "shipped_names",
]

_HOME: Final = {
    **dict.fromkeys(("map_for_unit", "map_text", "read_map", "shipped_map", "shipped_names"), "files"),
    **dict.fromkeys(("MapError", "MappedValue", "RegisterMap", "DeviceSignature"), "model"),
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
