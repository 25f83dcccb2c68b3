"""Maps by file or by name: reading, writing, the maps that come with this package, and which map serves which unit.

Files are of whatever characters spreadsheets and editors save.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from functools import lru_cache
from importlib.resources import files as package_files
from pathlib import Path
from typing import Any, Final

from .model import MapError, RegisterMap
from .table import read_table, write_table
from .vocabulary import known_letters

_MARKS: Final = (b"\xff\xfe", b"\xfe\xff")
_LOOK: Final = 4096  # bytes
_ACCENTED: Final = 0xC0  # from which on pages have letters beyond ASCII
_SAMPLE: Final = 1 << 15  # bytes that tell a code page
_WORD: Final = re.compile(rb"[A-Za-z\xc0-\xff]*[\xc0-\xff][A-Za-z\xc0-\xff]*")


def decoded(data: bytes) -> str | None:
    """The text: UTF-8, UTF-16 with its mark or without, else the Windows page that its words are of; None for bytes
    that are no text."""
    if data[:2] in _MARKS:
        return data.decode("utf-16", "replace").lstrip("\ufeff")
    if b"\0" in data[:_LOOK]:
        wide = _wide(data[:_LOOK])
        return data.decode(wide, "replace") if wide else None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode(_page(data), "replace")


def _wide(data: bytes) -> str | None:
    """UTF-16 without its mark: delimiters and line ends are ASCII in any language, so that one half has zeros alone."""
    even, odd = data[0::2].count(0), data[1::2].count(0)
    lead, other = max(even, odd), min(even, odd)
    if other or lead < len(data) // 16 or data.count(b"\0\0\0"):
        return None
    return ("utf-16-be", "utf-16-le")[odd > 0]


_PAGES: Final = (
    *("cp1252", "cp1250", "cp1251", "cp1254", "cp1253", "cp1257", "cp1255", "cp1256", "cp874", "koi8-r", "cp866"),
    *("cp932", "euc-kr", "gb18030", "big5"),
)


def _page(data: bytes) -> str:
    """The code page in which a text has most words of tables of registers; of none, Cyrillic where words are of its
    letters throughout."""
    words = _WORD.findall(data[:_SAMPLE])
    cyrillic = sum(2 * sum(letter >= _ACCENTED for letter in word) > len(word) for word in words)
    known = {page: known_letters(data[:_SAMPLE].decode(page, "replace")) for page in _PAGES if _is_of_page(data, page)}
    usual = ("cp1252", "cp1251")[2 * cyrillic >= len(words)]
    return max((usual, *known), key=lambda page: known.get(page, 0))


def _is_of_page(data: bytes, page: str) -> bool:
    """Whether a text may be of a code page."""
    try:
        data.decode(page)
    except UnicodeDecodeError:
        return False
    return True


_YAML: Final = (".yaml", ".yml")
_MOST: Final = 8 << 20  # bytes: no map is longer
_LAST_UNIT: Final = 255


def read_map(name: str | os.PathLike[str]) -> RegisterMap:
    """The map in a file (.csv, .tsv, .yaml), or the shipped one of that name; MapError says why there is none."""
    path = Path(name)
    there = os.path.isfile(path)  # noqa: PTH113 - pathlib's raises where that can be no file: too long, with a NUL
    if path.suffix.lower() not in (".csv", ".tsv", ".txt", *_YAML) and not there:
        if str(name) in shipped_names():
            return shipped_map(str(name))
        raise MapError(_unknown(str(name)))
    data = map_bytes(path)
    text = decoded(data)
    if text is None:
        raise MapError(f"{path}: binary, not text: a map is a table in CSV or YAML")
    if path.suffix.lower() in _YAML:
        from .yamlform import read_yaml

        return read_yaml(text, str(name))
    return read_table(text, str(name))


def map_bytes(path: str | os.PathLike[str]) -> bytes:
    """The content of a file that may be a map; MapError where it cannot be read, or is too long to be one."""
    try:
        with Path(path).open("rb") as file:
            data = file.read(_MOST + 1)
    except (OSError, ValueError) as error:
        raise MapError(f"{path}: {(getattr(error, 'strerror', None) or str(error)).lower()}") from error
    if len(data) > _MOST:
        raise MapError(f"{path}: over {_MOST >> 20} MiB: too large for a register map")
    return data


def map_text(chart: RegisterMap, name: str | os.PathLike[str]) -> str:
    """A map as the text of a file of this name."""
    if Path(name).suffix.lower() in _YAML:
        from .yamlform import write_yaml

        return write_yaml(chart)
    return write_table(chart)


def map_for_unit(text: str) -> tuple[RegisterMap, int | None]:
    """`MAP@UNIT` or `MAP`: the map and the unit that it is for, None for any."""
    match = re.fullmatch(r"(.+)@(\d+)", text)
    if match is None:
        return read_map(text), None
    unit = int(match[2])
    if unit > _LAST_UNIT:
        raise MapError(f"{text}: unit {unit}: must be 0 to {_LAST_UNIT}")
    return read_map(match[1]), unit


def shipped_names() -> list[str]:
    """The names of the maps that come with this package."""
    folder = package_files(__package__) / "shipped"
    return sorted(entry.name.removesuffix(".csv") for entry in folder.iterdir() if entry.name.endswith(".csv"))


@lru_cache(maxsize=128)
def shipped_map(name: str) -> RegisterMap:
    """One of them."""
    file = package_files(__package__) / "shipped" / f"{name}.csv"
    return read_table(file.read_text(encoding="utf-8"), f"{name}.csv")


def _unknown(name: str) -> str:
    from difflib import get_close_matches  # as analyzer.meant does, which this floor may not import

    near = get_close_matches(name, shipped_names(), 1)
    hint = f"did you mean {near[0]}?" if near else "`rtuscope map list` lists the shipped ones"
    return f"{name}: no such file and no shipped map of that name: {hint}"


def unit_maps(names: Iterable[str]) -> UnitMaps:
    """The maps of `MAP@UNIT` or `MAP` each; of several without a unit the first serves. MapError."""

    by_unit, other = {}, None
    for text in names:
        chart, unit = map_for_unit(text)
        if unit is None:
            other = other or chart
        else:
            by_unit[unit] = chart
    return UnitMaps(by_unit, other)


class UnitMaps(dict[int, RegisterMap]):
    """Maps by unit; `other` serves every unit that has none of its own."""

    def __init__(self, by_unit: dict[int, RegisterMap] | None = None, other: RegisterMap | None = None) -> None:
        super().__init__(by_unit or {})
        self.other = other

    def __missing__(self, unit: int) -> RegisterMap:
        if self.other is None:
            raise KeyError(unit)
        return self.other

    def get(self, unit: int, default: Any = None) -> Any:
        """The map of a unit."""
        return dict.get(self, unit, self.other if self.other is not None else default)

    def of(self, units: Iterable[int]) -> dict[int, RegisterMap]:
        """The maps of these units, those without one left out."""
        return {unit: self[unit] for unit in units if unit in self or self.other is not None}

    @property
    def all(self) -> list[RegisterMap]:
        """Every map, once."""
        listed = [*self.values(), *([self.other] if self.other is not None else [])]
        return list({id(chart): chart for chart in listed}.values())

    def __bool__(self) -> bool:
        return bool(self.all)
