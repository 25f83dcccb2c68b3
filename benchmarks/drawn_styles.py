"""What is drawn of a file of a register map: its language, its layout, how it says things, and what the device has."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final

_HOME: Final = Path(__file__).parent / "maps"
_WIDE: Final = ("u32", "s32", "f32")
_DIGITS: Final = {"coil": "0", "discrete": "1", "input": "3", "holding": "4"}
_CODES: Final = {"coil": 1, "discrete": 2, "input": 4, "holding": 3}
_AREA_WORDS: Final = (
    {"coil": "Coil", "discrete": "Discrete input", "input": "Input register", "holding": "Holding register"},
    {"coil": "CO", "discrete": "DI", "input": "IR", "holding": "HR"},
    {"coil": "0x", "discrete": "1x", "input": "3x", "holding": "4x"},
    {"coil": "coil", "discrete": "discrete", "input": "input", "holding": "holding"},
)


@cache
def _pieces() -> Mapping[str, Any]:
    return tomllib.loads((_HOME / "pieces.toml").read_text(encoding="utf-8"))


_RECORDS: Final = ("json", "json-named", "yaml", "toml", "ini", "xml", "python")
_LINES: Final = ("bullets", "colons", "dashes", "defines", "constants")
_TABLES: Final = (
    *("semicolons", "commas", "tabs", "quoted", "bars", "markdown", "html", "wiki", "jira", "asciidoc", "latex"),
    *("blanks", "two-blanks", "pages", "rst", "grid", "box"),
)
KINDS: Final = {
    **dict.fromkeys(_TABLES, "table"),
    **dict.fromkeys(_RECORDS, "records"),
    **dict.fromkeys(_LINES, "lines"),
}
"""What layouts are: tables, records, or lines."""


@dataclass(slots=True)
class DrawnPoint:
    """What a device holds at an address."""

    area: str
    address: int
    name: str
    type: str
    scale: float
    unit: str
    access: str

    @property
    def words(self) -> int:
        return 2 if self.type in _WIDE else 1

    @property
    def step(self) -> str:
        return f"{self.scale:g}"

    @property
    def times(self) -> int:
        return round(1 / self.scale)

    @property
    def tens(self) -> int:
        return len(str(self.times)) - 1


@dataclass(slots=True)
class DrawnStyle:
    """What was drawn of a file: how it says things."""

    language: Mapping[str, Any]
    chance: Random
    number: int
    layout: str
    area: str  # title, column, code, logical, logical6, prefix, none
    address: str  # dec, hex, h, bare, one, offset, range, both
    scale: str
    unit: str
    kind: str
    access: str
    extras: Sequence[str]
    headings: dict[str, str] = field(default_factory=dict)

    def word(self, what: str) -> str:
        """A word of the language, the same wherever it stands in the file."""
        if what not in self.headings:
            self.headings[what] = self.chance.choice(self.language[what])
        return self.headings[what]

    def number_text(self, text: str) -> str:
        """A number with the sign that the language parts decimals with."""
        commas = self.language["name"] not in ("english", "chinese", "japanese", "korean")
        return text.replace(".", ",") if commas and self.number % 2 == 0 and self.is_table else text

    @property
    def is_table(self) -> bool:
        return KINDS[self.layout] == "table"


def _behind(style: DrawnStyle, point: DrawnPoint, form: str, mark: str) -> str:
    """What stands behind a name: the unit, and a step that is not 1 before it."""
    step = f"{mark}{style.number_text(point.step)} " * (point.scale != 1)
    return form.format(f"{step}{point.unit}") if point.unit else ""


_SCALES: Final[Mapping[str, Callable[[DrawnStyle, DrawnPoint], tuple[str, str]]]] = {
    # in a column of its own
    "step": lambda s, p: ("scale", s.number_text(p.step)),
    "times step": lambda s, p: ("scale", "x" + s.number_text(p.step)),
    "over": lambda _, p: ("scale", f"/{p.times}" if p.times > 1 else "1"),
    "fraction": lambda _, p: ("scale", f"1/{p.times}" if p.times > 1 else "1"),
    "tens": lambda _, p: ("scale", f"10^-{p.tens}" if p.tens else "1"),
    "raised": lambda _, p: ("scale", f"10{['⁻¹', '⁻²', '⁻³'][p.tens - 1]}" if p.tens else "1"),
    "divisor": lambda _, p: ("divisor", str(p.times)),
    "step unit": lambda s, p: ("scale+unit", f"{s.number_text(p.step)} {p.unit}".strip()),
    # with the unit
    "unit step": lambda s, p: ("unit=", f"{s.number_text(p.step)} {p.unit}".strip() if p.scale != 1 else p.unit),
    "unit tight": lambda s, p: ("unit=", f"{s.number_text(p.step)}{p.unit}" if p.scale != 1 else p.unit),
    "unit x": lambda s, p: ("unit=", f"x{s.number_text(p.step)} {p.unit}".strip() if p.scale != 1 else p.unit),
    # behind the name
    "name brackets": lambda s, p: ("name+", _behind(s, p, " [{}]", "")),
    "name round": lambda s, p: ("name+", _behind(s, p, " ({})", "x")),
    "name comma": lambda s, p: ("name+", _behind(s, p, ", {}", "")),
    # in a remark
    "lsb": lambda s, p: ("remark", f"1 LSB = {s.number_text(p.step)} {p.unit}" if p.scale != 1 else ""),
    "raw over": lambda _, p: ("remark", f"raw / {p.times} = {p.unit}" if p.scale != 1 else ""),
    "value over": lambda _, p: ("remark", f"value / {p.times}" if p.scale != 1 else ""),
    "times": lambda s, p: ("remark", f"x{s.number_text(p.step)}" if p.scale != 1 else ""),
    "resolution": lambda s, p: ("remark", f"{s.word('scale')}: {s.number_text(p.step)} {p.unit}" * (p.scale != 1)),
    "per bit": lambda s, p: ("remark", f"{s.number_text(p.step)} {p.unit}/bit" if p.scale != 1 else ""),
    "formula": lambda s, p: ("remark", f"value = raw * {s.number_text(p.step)}" if p.scale != 1 else ""),
    "none": lambda _, __: ("", ""),
}  # fmt: skip
_WITH_UNIT: Final = frozenset(
    {"step unit", "unit step", "unit tight", "unit x", "name brackets", "name round", "name comma"}
)


def drawn_style(number: int) -> DrawnStyle:
    chance = Random(f"map {number}")
    languages = _pieces()["language"]
    language = languages[(2 * chance.randrange(len(languages) // 2) + number % 2)]
    layout = chance.choice([*KINDS])
    is_table = KINDS[layout] == "table"
    area = chance.choice(("title", "title", "column", "code", "logical", "logical6", "prefix", "none"))
    address = chance.choice(("dec", "dec", "dec", "hex", "h", "bare", "one", "range"))
    address = "dec" if area in ("logical", "logical6", "prefix") else address
    scale = chance.choice([*_SCALES])
    if not is_table:
        address = chance.choice(("dec", "dec", "hex", "one")) if area in ("title", "column", "code", "none") else "dec"
    if KINDS[layout] == "lines":
        area = chance.choice(("title", "none", "logical"))
        address = "dec" if area == "logical" else chance.choice(("dec", "hex"))
        scale = chance.choice(("step unit", "name brackets", "name round", "none"))
    unit = chance.choice(("column", "column", "column", "brackets", "comma"))
    unit = "said" if scale in _WITH_UNIT else unit if is_table else "column"
    kind = chance.choice(("word", "word", "word", "words signed", "words", "none"))
    access = chance.choice(("column", "none"))
    extras = [
        extra
        for extra in ("number", "default", "range", "groups", "reserved", "again", "blank")
        if chance.random() < 0.2
    ]
    return DrawnStyle(language, chance, number, layout, area, address, scale, unit, kind, access, extras)


def points_of(style: DrawnStyle) -> list[DrawnPoint]:
    chance = style.chance
    areas = (
        ["holding"]
        if style.area == "none"
        else chance.choice((["input"], ["holding"], ["input", "holding"], ["holding", "input"], ["coil", "input"]))
    )
    if KINDS[style.layout] == "lines" and style.area == "title":
        areas = areas[:1]
    names = chance.sample(style.language["names"], len(style.language["names"]))
    types = ["u16", "s16", "u32", "s32", "f32"]
    if style.kind in ("words signed", "words", "none"):
        types = {"words signed": types[:4], "words": ["u16", "u32"], "none": ["u16"]}[style.kind]
    points = []
    address = chance.choice((0, 0, 10, 100, 256) if style.area == "logical" else (0, 0, 10, 100, 256, 1000, 4096))
    first = address
    for at, area in enumerate(areas):
        address = first if style.area in ("title", "column", "code") and at else address
        share = len(names) // len(areas)
        for text in names[at * share : (at + 1) * share]:
            name, _, unit = text.partition("|")
            kind = chance.choice(types)
            scale = (
                chance.choice((1.0, 0.1, 0.1, 0.01, 0.001)) if kind != "f32" and unit and style.scale != "none" else 1.0
            )
            access = (
                ("r", "rw")[area in ("holding", "coil") and chance.random() < 0.4] if style.access == "column" else ""
            )
            if area in ("coil", "discrete"):
                kind, scale, unit = "bool", 1.0, ""
            points.append(DrawnPoint(area, address, name, kind, scale, unit, access))
            address += points[-1].words + chance.choice((0, 0, 0, 1, 2))
    return points


def columns_of(style: DrawnStyle) -> list[str]:
    """What the columns of a table hold, in an order of chance, most often the usual one."""
    sample = DrawnPoint("input", 0, "", "u16", 0.1, "V", "")
    scale = _SCALES[style.scale](style, sample)[0]
    columns = ["address", "label"]
    columns += ["number"] * ("number" in style.extras)
    columns += {"column": ["area"], "code": ["function"]}.get(style.area, [])
    columns += {"word": ["type"], "words signed": ["words", "signed"], "words": ["words"], "none": []}[style.kind]
    columns += [part for part in scale.removesuffix("=").split("+") if part in ("scale", "divisor")]
    columns += ["unit"] * (style.unit == "column" or scale == "unit=")
    columns += ["access"] * (style.access == "column")
    columns += ["default"] * ("default" in style.extras) + ["range"] * ("range" in style.extras)
    columns += ["remark"] * (scale == "remark")
    if style.chance.random() < 0.3:
        style.chance.shuffle(columns)
    elif "number" in columns:
        columns = ["number", *(one for one in columns if one != "number")]
    return columns


def address_text(style: DrawnStyle, point: DrawnPoint) -> str:
    at = point.address
    if style.area in ("logical", "logical6", "prefix"):
        forms = {"logical": f"{at + 1:04d}", "logical6": f"{at + 1:05d}", "prefix": f"x{at + 1:04d}"}
        return _DIGITS[point.area] + forms[style.area]
    return {
        "hex": f"0x{at:04X}",
        "h": f"{at:04X}h",
        "bare": f"{at:04X}",
        "one": str(at + 1),
        "range": f"{at}-{at + 1}" if point.words > 1 else str(at),
    }.get(style.address, str(at))


def cells_of(style: DrawnStyle, point: DrawnPoint, at: int) -> dict[str, str]:
    """What the columns show of a point."""
    types = _pieces()["types"]
    form = style.number % len(types["u16"])
    role, said = _SCALES[style.scale](style, point)
    rights = dict(zip(("r", "rw"), style.language["rights"], strict=True))
    cells = {
        "address": address_text(style, point),
        "label": point.name,
        "number": str(at + 1),
        "area": _AREA_WORDS[style.number // 2 % len(_AREA_WORDS)][point.area],
        "function": (f"{_CODES[point.area]}", f"0{_CODES[point.area]}", f"0x0{_CODES[point.area]}")[
            style.number // 2 % 3
        ],
        "type": "BOOL" if point.type == "bool" else types[point.type][form],
        "words": str(point.words),
        "signed": style.language["yes"][point.type != "s16" and point.type != "s32"],
        "unit": point.unit,
        "access": rights.get(point.access, ""),
        "default": ("0", "10", "1", "-", "25")[at % 5],
        "range": f"0...{100 * (at + 1)}",
        "remark": "",
    }
    if point.type == "bool":
        said = ""
    if role in ("scale", "divisor", "remark"):
        cells[role] = said
    elif role == "scale+unit":
        cells["scale"] = said
    elif role == "unit=":
        cells["unit"] = said
    elif role == "name+":
        cells["label"] += said
    if style.unit == "brackets" and point.unit:
        cells["label"] += f" ({point.unit})"
    if style.unit == "comma" and point.unit:
        cells["label"] += f", {point.unit}"
    return cells


def heading_of(style: DrawnStyle, role: str) -> str:
    word = style.word(role)
    if role == "address" and style.address == "bare" and style.number % 4 < 2:
        word += " (hex)"
    return word


def notes_of(style: DrawnStyle) -> list[str]:
    notes = []
    if style.address == "one":
        notes.append(style.word("one"))
    if style.address == "bare" and style.number % 4 >= 2:
        notes.append(style.word("hex"))
    if style.number % 3 == 0:
        notes.append(style.word("low"))
    return notes
