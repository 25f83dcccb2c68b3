"""SunSpec on the wire: `SunS`, then models one behind another, each with its number and length, to FFFF.

What was read of a unit is walked; models that are known are put where the chain has them. A model that nobody knows is
named by its number, so that its registers are not taken for others'.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from dissectors.maps import RegisterMap, shipped_map
from dissectors.maps.model import MappedValue

from .readings import BlockReadings

_MARK: Final = (0x5375, 0x6E53)  # SunS
_BASES: Final = (40000, 50000, 0)
_END: Final = 0xFFFF
_MOST: Final = 64  # models of a device
_LONGEST: Final = 4096
_HOME: Final = {  # models by number: the shipped map and the address there of the model's number
    1: ("fronius-sunspec-int", 40002),
    **dict.fromkeys((101, 102, 103), ("fronius-sunspec-int", 40069)),
    **dict.fromkeys((111, 112, 113), ("fronius-sunspec-float", 40069)),
}


@dataclass(frozen=True, slots=True)
class ChainModel:
    """A model of a device: its number, the address of that number, and the registers behind number and length."""

    number: int
    address: int
    length: int


def sunspec_chain(blocks: Iterable[BlockReadings]) -> list[ChainModel]:
    """The models of a unit as far as they were read; empty where no chain begins."""
    words: dict[int, int] = {}
    for block in blocks:
        if block.area == "holding" and not block.written:
            words.update(enumerate(block.last.tolist(), block.address))
    for base in _BASES:
        if (words.get(base), words.get(base + 1)) == _MARK:
            return _walked(words, base + 2)
    return []


def _walked(words: Mapping[int, int], at: int) -> list[ChainModel]:
    models: list[ChainModel] = []
    while len(models) < _MOST and words.get(at, _END) != _END and 0 < words.get(at + 1, 0) <= _LONGEST:
        models.append(ChainModel(words[at], at, words[at + 1]))
        at += 2 + words[at + 1]
    return models


def sunspec_map(chain: list[ChainModel]) -> RegisterMap | None:
    """The map of a device with this chain; None where none of its models is known but the first."""
    rows: list[MappedValue] = []
    for model in chain:
        rows += _placed(model)
    if not any(model.number in _HOME and model.number != 1 for model in chain):
        return None
    numbers = ", ".join(str(model.number) for model in chain)
    source = "SunSpec Alliance information models (Apache-2.0), put where the device has them"
    return RegisterMap(f"SunSpec device (models {numbers})", tuple(rows), vendor="SunSpec", source=source)


def at_home(chain: list[ChainModel]) -> bool:
    """Whether all models stand where a shipped map has them."""
    return all(model.number in _HOME and _HOME[model.number][1] == model.address for model in chain)


def _placed(model: ChainModel) -> list[MappedValue]:
    if model.number not in _HOME:
        name = f"SunSpec model {model.number}"
        return [MappedValue("holding", model.address, name, "u16"),
                MappedValue("holding", model.address + 1, f"{name} length", "u16")]  # fmt: skip
    name, home = _HOME[model.number]
    shift = model.address - home
    last = model.address + 2 + model.length
    return [
        replace(
            row,
            address=row.address + shift,
            scale_address=None if row.scale_address is None else row.scale_address + shift,
        )
        for row in _rows(name, home)
        if row.end + shift <= last
    ]


@lru_cache(maxsize=8)
def _rows(name: str, home: int) -> tuple[MappedValue, ...]:
    """The rows of a shipped map from this model on, to the next one."""
    rows = shipped_map(name).rows
    later = [at for shipped, at in _HOME.values() if shipped == name and at > home]
    end = min(later, default=0x10000)
    return tuple(row for row in rows if home <= row.address < end)
