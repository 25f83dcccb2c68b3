"""`rtuscope plot`: one register over time, drawn in the terminal or as a picture."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ..languages import register_words, tr
from .commands import DONE, UsageError
from .inputs import (
    add_capture_arguments,
    add_map_argument,
    chosen_charts,
    load_functions,
    open_capture,
    tell_damage,
    unit_number,
)
from .terminal import add_overwrite_argument, to_be_overwritten

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..analysis import Analysis

EXAMPLE = """\
rtuscope simulate meter.jsonl --map eastron-sdm630@1
rtuscope plot meter.jsonl unit 1 30001 --map eastron-sdm630@1"""
_AREAS: Final = ("holding", "input", "coil", "discrete")
_PICTURES: Final = (".png", ".svg", ".pdf")
_LINES: Final = 12  # of a curve that moves
_LABEL: Final = 12  # columns left of the curve
_NARROWEST: Final = 20  # columns of the curve


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument("word", metavar="unit", choices=("unit",), help="the word `unit`, followed by its number")
    parser.add_argument("unit", type=unit_number, metavar="N", help="the unit's number")
    parser.add_argument(
        "address", metavar="ADDRESS", help="40108, 400108 or 4x108 as manuals count; below 10000 as on the wire, from 0"
    )
    parser.add_argument("--area", choices=_AREAS, help="the area, if several areas have this wire address")
    parser.add_argument("-o", "--output", metavar="FILE", help="a picture: .png, .svg or .pdf (needs matplotlib)")
    add_overwrite_argument(parser, "FILE")
    add_map_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Draw it."""
    from ..analysis import Analysis
    from ..registers.telling import place_words

    picture = _picture(arguments.output)
    load_functions(arguments)
    area, address = place_of(arguments.address)
    capture = open_capture(arguments)
    if not capture.timed:
        raise UsageError(f"{arguments.capture}: a capture without timestamps cannot be plotted")
    bus = Analysis(capture, maps=chosen_charts(arguments) or None)
    readings = _readings(bus, arguments.unit, address)
    tell_damage(arguments.capture, capture)
    area = _area(area or arguments.area, readings, arguments.unit, address)
    times, numbers, name = readings[area]
    place = name or place_words(area, address)
    title = register_words("unit {unit} {place}", unit=arguments.unit, place=place)
    if picture is None:
        _draw(title, times, numbers)
        return DONE
    from ..exports.sink import output
    from ..plots import drawn_series

    to_be_overwritten(arguments.output, overwrite=arguments.overwrite, source=capture.path)
    try:
        drawn = drawn_series(picture.suffix[1:].lower(), {name or area: (times, numbers)}, title)
    except ImportError as error:
        raise UsageError(str(error)) from error
    with output(picture) as file:
        file.write(drawn)
    return DONE


def place_of(text: str) -> tuple[str | None, int]:
    """Area (None: not said) and address from 0 of a register as people write it; UsageError for what is none."""
    from dissectors.values import ValueFormError, physical

    from ..exports.records import AREA_NAMES
    from ..tables.columns import AREA_CODES

    if text.isascii() and text.isdecimal() and len(text) < 5:
        return None, int(text)
    try:
        area, address = physical(text)
    except ValueFormError:
        raise UsageError(
            f"{text!r} is not an address: use 40108, 400108 or 4x108, or count from 0 as on the wire"
        ) from None
    return AREA_NAMES[AREA_CODES[area]], address


def _picture(text: str | None) -> Path | None:
    if text is None:
        return None
    path = Path(text)
    if path.suffix.lower() not in _PICTURES:
        raise UsageError(f"{text}: a picture's name must end in {', '.join(_PICTURES)}")
    return path


Reading = tuple["NDArray[np.int64]", "NDArray[np.float64]", str | None]


def _readings(bus: Analysis, unit: int, address: int) -> dict[str, Reading]:
    """By area the times (ns, ascending), numbers and name of an address of a unit."""
    import numpy as np

    found: dict[str, list[tuple[int, float, str | None]]] = {}
    for columns in bus.columns("values"):
        chosen = (np.array(columns["unit"]) == unit) & (np.array(columns["address"]) == address)
        for at in np.flatnonzero(chosen).tolist():
            number, raw = columns.get("value", columns["raw"])[at], columns["raw"][at]
            shown = raw if number is None else number
            name = columns["name"][at] if "name" in columns else None
            if isinstance(shown, int | float):
                found.setdefault(columns["area"][at], []).append((columns["t_ns"][at], float(shown), name))
    made: dict[str, Reading] = {}
    for area, rows in found.items():
        rows.sort(key=lambda row: row[0])
        name = next((row[2] for row in rows if row[2]), None)
        made[area] = np.array([row[0] for row in rows], np.int64), np.array([row[1] for row in rows]), name
    return made


def _area(area: str | None, readings: dict[str, Reading], unit: int, address: int) -> str:
    """The area that is meant; UsageError where it has no reading, or where several have."""
    if area is None and len(readings) > 1:
        raise UsageError(f"unit {unit} has {address} in {' and '.join(readings)}: choose with --area")
    if area is None and readings:
        return next(iter(readings))
    if area not in readings:
        from ..registers.telling import place_words

        place = place_words(area, address) if area else f"address {address}"
        raise UsageError(f"unit {unit} has no readings of {place}: rtuscope registers lists what there is")
    return area


def _draw(title: str, times: NDArray[np.int64], numbers: NDArray[np.float64]) -> None:
    """The curve in braille, the ends of its scale beside it, the ends of its time below."""
    from ..tui.plot import Series, dots, told_apart
    from ..words import is_clock, moment, seconds, unit_word

    columns = max(_NARROWEST, shutil.get_terminal_size().columns - _LABEL - 2)
    series = Series(title, times, numbers)
    span = int(times[0]), int(times[-1])
    low, high = told_apart(*(series.scale or (0.0, 0.0)), _LABEL)
    lines = _LINES if low != high else 1
    print(tr("{title}, {count:,} readings", title=title, count=len(times)))
    for row, cells in enumerate(dots(series, span, columns, lines).tolist()):
        label = high if row == 0 else low if row == lines - 1 else ""
        text = "".join(chr(0x2800 + cell) if cell else " " for cell in cells)
        print(f"{label:>{_LABEL}} {text}".rstrip())
    first, last = (moment(t_ns) if is_clock(t_ns) else f"{seconds(t_ns)} {unit_word('s')}" for t_ns in span)
    print(" " * (_LABEL + 1) + first + " " * max(2, columns - len(first) - len(last)) + last)
