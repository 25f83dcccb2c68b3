"""Files of register maps that are made: a device's values in the words, the columns and the layout of a made-up maker.

`maps/styles.toml` has the makers; a style of the fold `fit` writes devices of one half of the layouts, the others those
of the other half. What is expected back is what the file shows, not what the device has.
"""

from __future__ import annotations

import io
import json
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Final
from zlib import crc32

from dissectors.maps import read_map, shipped_map, shipped_names
from dissectors.maps.model import MappedValue, RegisterMap

HOME: Final = Path(__file__).parent
_KINDS: Final = ("u16", "s16", "u32", "s32", "f32")
_ROWS: Final = 12
_LAST: Final = 9000  # address, so that a logical number of it has five digits
_TYPES: Final = (
    {"u16": "UINT16", "s16": "INT16", "u32": "UINT32", "s32": "INT32", "f32": "FLOAT32"},
    {"u16": "U16", "s16": "S16", "u32": "U32", "s32": "S32", "f32": "Float"},
    {"u16": "uint16", "s16": "int16", "u32": "uint32", "s32": "int32", "f32": "float"},
    {"u16": "UINT", "s16": "INT", "u32": "UDINT", "s32": "DINT", "f32": "REAL"},
)
_UNITS: Final = ("V", "A", "kW", "Hz", "°C", "kWh", "%", "bar")
_NOTES: Final = ("see chapter 4", "since rev. 2", "", "not in all models", "", "averaged over 1 s")


@dataclass(frozen=True, slots=True)
class MadeFile:
    """A file's name and content, and (area, address, name, type, scale, unit, access) of the rows in it."""

    style: str
    fold: str
    name: str
    data: bytes
    rows: list[tuple[Any, ...]]


def styles() -> list[dict[str, Any]]:
    """The made-up makers."""
    listed: list[dict[str, Any]] = tomllib.loads((HOME / "maps" / "styles.toml").read_text(encoding="utf-8"))["style"]
    return listed


def charts() -> tuple[list[RegisterMap], list[RegisterMap]]:
    """Devices whose makers lie in the half that fits, and the others."""
    every = [shipped_map(name) for name in shipped_names()]
    every += [read_map(path) for path in sorted((HOME / "layouts").glob("*.csv"))]
    halves: tuple[list[RegisterMap], list[RegisterMap]] = ([], [])
    for chart in every:
        if len(_shown_values(chart)) >= _ROWS // 2:
            halves[crc32((chart.vendor or chart.other.get("family", chart.device)).encode()) & 1].append(chart)
    return halves


def made_files(devices: int = 3) -> Iterator[MadeFile]:
    """Each style with some devices."""
    fit, others = charts()
    for style in styles():
        chance = Random(style["name"])
        for number, chart in enumerate(chance.sample(fit if style["fold"] == "fit" else others, devices)):
            yield _made(style, chart, chance, number)


def whole_files() -> Iterator[MadeFile]:
    """The files that were written whole, by hand; every second one may be looked at."""
    listed = tomllib.loads((HOME / "maps" / "whole.toml").read_text(encoding="utf-8"))["file"]
    for number, file in enumerate(listed):
        rows = []
        for row in file["rows"]:
            place, name, kind, scale, unit, access = (cell.strip() for cell in row.split("|"))
            area, address = place.split()
            rows.append((area, int(address), name, kind, float(scale), unit, access))
        fold = file.get("fold", "fresh" if number % 2 else "fresh-fit")
        yield MadeFile(file["name"], fold, file["name"], file["text"].lstrip("\n").encode(), rows)


def _shown_values(chart: RegisterMap) -> list[MappedValue]:
    """The numbers of a device that a file shows: the first of the area that has most, by address."""
    areas = [row.area for row in chart.rows]
    area = "input" if areas.count("input") > areas.count("holding") else "holding"
    numbers = {row.address: row for row in chart.rows if row.area == area and row.type in _KINDS}
    return [numbers[address] for address in sorted(numbers) if address < _LAST][:_ROWS]


def _made(style: dict[str, Any], chart: RegisterMap, chance: Random, number: int) -> MadeFile:
    values = _shown_values(chart)
    area = values[0].area
    has_area = any(role in ("area", "function") for _, role in style["columns"])
    types = chance.choice(_TYPES)
    shown: list[tuple[str, dict[str, str]]] = []
    expected: list[tuple[Any, ...]] = []
    for row in values:
        name = f"{style['names'][len(shown) % len(style['names'])]} {len(shown) // len(style['names']) + 1}"
        if style["layout"] in ("cstruct", "ini", "yamlnamed"):
            name = name.replace(" ", "_")
        scale = row.scale if row.scale in (1, 0.1, 0.01, 0.001) and row.type != "f32" else 1.0
        unit = row.unit if row.unit in _UNITS else chance.choice(_UNITS)
        cells = _Cells(style, row, name, scale, unit, types[row.type], len(shown), area, values[0].address < 1000)
        line = {heading: cells.of(role) for heading, role in style["columns"]}
        shown.append((name, line))
        roles = {role for _, role in style["columns"]}
        steps = roles & {"scale", "gain", "divisor", "over"}
        there = area if has_area else "input" if style.get("address") == "logical" and area == "input" else "holding"
        writes = {"access": cells.access, "writable": cells.access}
        access = next((writes[role] for role in ("access", "writable") if role in roles), "")
        expected.append((there, row.address, name, row.type, scale if steps else 1.0, unit, access))
    headings = [heading for heading, _ in style["columns"]]
    name, data = LAYOUTS[style["layout"]](headings, shown, style.get("title", ""))
    return MadeFile(style["name"], style["fold"], f"{style['name']}-{number}{name}", data, expected)


@dataclass(slots=True)
class _Cells:
    style: dict[str, Any]
    row: MappedValue
    name: str
    scale: float
    unit: str
    type_word: str
    number: int
    area: str
    is_near: bool  # to the first register: logical numbers that are far from it look like addresses

    @property
    def access(self) -> str:
        return "rw" if self.number % 3 == 2 else "r"

    def _decimal(self, number: float) -> str:
        text = f"{number:g}"
        return text.replace(".", ",") if self.style.get("comma") else text

    def of(self, role: str) -> str:
        """What a column shows of the value."""
        at, length = self.row.address, self.row.length
        forms = {
            "0x": f"0x{at:04X}",
            "h": f"{at:04X}h",
            "bare": f"{at:04X}",
            "range": f"{at}-{at + length - 1}" if length > 1 else str(at),
            "logical": f"{'3' if self.area == 'input' else '4'}{at + 1:04d}" if self.is_near else str(at),
        }
        steps = round(1 / self.scale)
        words = self.style.get("access", {})
        cells: dict[str, str] = {
            "address": forms.get(self.style.get("address", ""), str(at)),
            "hex": f"0x{at:04X}",
            "no": str(self.number + 1),
            "name": self.name,
            "type": self.type_word,
            "unit": self.unit,
            "scale": self._decimal(self.scale),
            "gain": str(steps),
            "divisor": str(steps),
            "over": f"/{steps}" if steps > 1 else "1",
            "access": words.get(self.access, self.access),
            "writable": "ja" if self.access == "rw" else "nein",
            "length": str(length),
            "octets": str(2 * length),
            "min": "0",
            "max": str(100 * (1 + self.number)),
            "range": f"0...{100 * (1 + self.number)}",
            "remark": _NOTES[self.number % len(_NOTES)],
            "area": self.area,
            "function": "04" if self.area == "input" else "03",
        }
        return cells[role]


Shown = Sequence[tuple[str, dict[str, str]]]


def _csv(delimiter: str) -> Any:
    def written(headings: list[str], shown: Shown, title: str) -> tuple[str, bytes]:
        lines = [title, ""] if title else []
        lines += [delimiter.join(headings), *(delimiter.join(line.values()) for _, line in shown)]
        return ".csv", "\r\n".join(lines).encode("utf-8-sig")

    return written


def _plain(line: dict[str, str], headings: Sequence[str]) -> dict[str, Any]:
    numbers = {key: int(cell) for key, cell in line.items() if cell.isdecimal()}
    return {key: numbers.get(key, line[key]) for key in headings}


def _markdown(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    rows = [headings, ["---"] * len(headings), *(list(line.values()) for _, line in shown)]
    return ".md", "\n".join(["# Device", "", *(f"| {' | '.join(row)} |" for row in rows)]).encode()


def _widths(headings: list[str], shown: Shown) -> list[int]:
    return [max(len(heading), *(len(line[heading]) for _, line in shown)) for heading in headings]


def _blanks(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    rows = [headings, *(list(line.values()) for _, line in shown)]
    widths = _widths(headings, shown)
    lines = ["   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return ".txt", "\n".join(lines).encode()


def _rst(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    widths = _widths(headings, shown)
    rule = " ".join("=" * width for width in widths)
    rows = [headings, *(list(line.values()) for _, line in shown)]
    lines = [" ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return ".rst", "\n".join([rule, lines[0], rule, *lines[1:], rule]).encode()


def _json(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    records = [_plain(line, headings) for _, line in shown]
    return ".json", json.dumps({"device": "made", "registers": records}, ensure_ascii=False).encode()


def _json_arrays(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    rows = [headings, *(list(_plain(line, headings).values()) for _, line in shown)]
    return ".json", json.dumps({"table": rows}, ensure_ascii=False).encode()


def _yaml(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    lines = ["points:"]
    for _, line in shown:
        lines += [f"  {'-' if not at else ' '} {key}: {json.dumps(value, ensure_ascii=False)}"
                  for at, (key, value) in enumerate(_plain(line, headings).items())]  # fmt: skip
    return ".yaml", "\n".join(lines).encode()


def _yaml_named(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    lines = ["battery:"]
    for name, line in shown:
        lines.append(f"  {name}:")
        lines += [f"    {key}: {json.dumps(value)}" for key, value in _plain(line, headings).items()]
    return ".yaml", "\n".join(lines).encode()


def _toml(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    lines = []
    for _, line in shown:
        lines += ["[[point]]", *(f"{key} = {json.dumps(value)}" for key, value in _plain(line, headings).items()), ""]
    return ".toml", "\n".join(lines).encode()


def _ini(_: list[str], shown: Shown, __: str) -> tuple[str, bytes]:
    lines = []
    for name, line in shown:
        lines += [f"[{name}]", *(f"{key} = {value}" for key, value in line.items()), ""]
    return ".ini", "\n".join(lines).encode()


def _html(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    head = "".join(f"<th>{heading}</th>" for heading in headings)
    rows = ["<tr>" + "".join(f"<td>{cell}</td>" for cell in line.values()) + "</tr>" for _, line in shown]
    return ".html", f"<html><body><table>\n<tr>{head}</tr>\n{chr(10).join(rows)}\n</table></body></html>".encode()


def _latex(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    rows = [headings, *(list(line.values()) for _, line in shown)]
    cells = [" & ".join(cell.replace("%", r"\%") for cell in row) + r" \\" for row in rows]
    body = "\n".join([cells[0], r"\hline", *cells[1:]])
    return ".tex", f"\\begin{{tabular}}{{lllll}}\n{body}\n\\end{{tabular}}\n".encode()


def _c_struct(_: list[str], shown: Shown, __: str) -> tuple[str, bytes]:
    lines = ["#include <stdint.h>", "static const struct reg registers[] = {"]
    for _name, line in shown:
        fields = ", ".join(
            f".{key} = {value if key in ('address', 'scale') else json.dumps(value, ensure_ascii=False)}"
            for key, value in line.items()
        )
        lines.append(f"    {{ {fields} }},")
    return ".c", "\n".join([*lines, "};", ""]).encode()


def _c_table(headings: list[str], shown: Shown, _: str) -> tuple[str, bytes]:
    lines = ["/* registers of the fan */", "typedef struct { " + " ".join(
        f"{'uint16_t' if key == 'addr' else 'float' if key == 'k' else 'const char *'} {key};" for key in headings
    ) + " } point_t;", "", "point_t points[] = {"]  # fmt: skip
    for _, line in shown:
        cells = [value if key in ("addr", "k") else json.dumps(value, ensure_ascii=False)
                 for key, value in line.items()]  # fmt: skip
        lines.append("    {" + ", ".join(cells) + "},")
    return ".h", "\n".join([*lines, "};", ""]).encode()


def _xlsx(headings: list[str], shown: Shown, title: str) -> tuple[str, bytes]:
    import openpyxl

    book, file = openpyxl.Workbook(), io.BytesIO()
    rows: list[list[Any]] = [[title], []] if title else []
    rows += [headings, *(list(_plain(line, headings).values()) for _, line in shown)]
    for row in rows:
        book.active.append(row)
    book.save(file)
    return ".xlsx", file.getvalue()


LAYOUTS: Final[dict[str, Any]] = {
    "csv;": _csv(";"), "csv,": _csv(","), "csv\t": _csv("\t"), "markdown": _markdown, "blanks": _blanks, "rst": _rst,
    "json": _json, "jsonarrays": _json_arrays, "yaml": _yaml, "yamlnamed": _yaml_named, "toml": _toml, "ini": _ini,
    "html": _html, "latex": _latex, "cstruct": _c_struct, "ctable": _c_table, "xlsx": _xlsx,
}  # fmt: skip
