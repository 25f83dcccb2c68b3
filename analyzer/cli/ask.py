"""`rtuscope ask`: questions to a lake, ready ones or in SQL."""

from __future__ import annotations

import argparse
from decimal import Decimal
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dissectors.values import harmless

from ..languages import page_words, tr
from .amounts import seconds
from .commands import DONE, UsageError
from .terminal import add_overwrite_argument, put_data, put_json, to_be_overwritten

if TYPE_CHECKING:
    from collections.abc import Iterable

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope batch bus.jsonl -o lake --site plant-1
rtuscope ask lake worst-units
rtuscope ask lake 'SELECT site, name, count(*) FROM frames GROUP BY ALL' --csv"""
_WIDEST: Final = 60  # characters of a cell on a terminal
_PICTURES: Final = (".png", ".svg", ".pdf")
_PIECE: Final = 1 << 16  # characters of CSV that are put out at once
_LINES: Final = 20  # that can be told apart in a picture


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("lake", metavar="LAKE", help="a lake made by rtuscope batch")
    parser.add_argument(
        "question",
        metavar="QUESTION",
        help="SQL on frames, transactions, values, findings, causes, captures, hours; or one of worst-units, "
        "new-causes, drift, register UNIT ADDRESS [AREA], silent, compare SITE SITE, damaged",
    )
    parser.add_argument("words", nargs="*", default=(), metavar="WORD", help="arguments of a ready-made question")
    parser.add_argument("--since", type=seconds, metavar="TIME", help="only the newest 12h, 7d ... in the lake")
    parser.add_argument("--site", metavar="NAME", help="only this site (ready-made questions)")
    parser.add_argument(
        "--limit", type=_limit, metavar="N", help="number of rows, for a ready-made question (20; register: all)"
    )
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="an array of objects")
    shape.add_argument("--csv", action="store_true", help="comma-separated, with a heading")
    shape.add_argument("--plot", metavar="FILE", type=_picture, help="for register: plot over time, .png, .svg or .pdf")
    add_overwrite_argument(parser, "FILE")


def run(arguments: argparse.Namespace) -> int:
    """Answer."""
    from ..fleet.lake import Lake
    from ..fleet.questions import DATES, QUESTIONS, Asked, ready

    if arguments.plot is not None and arguments.question != "register":
        raise UsageError("--plot draws the values of a register: rtuscope ask LAKE register UNIT ADDRESS --plot FILE")
    lake = Lake(arguments.lake)
    if arguments.question in QUESTIONS:
        asked = Asked(tuple(arguments.words), arguments.since, arguments.site, arguments.limit)
        answer = ready(lake, arguments.question, asked)
    elif len(arguments.question.split()) < 2:  # no query is one word
        from ..meant import meant

        if near := meant(arguments.question, QUESTIONS):
            raise UsageError(f"no question {arguments.question!r}: did you mean {near}?")
        raise UsageError(f"no question {arguments.question!r}: choose from {', '.join(QUESTIONS)}, or use SQL")
    elif arguments.words or (arguments.since, arguments.site, arguments.limit) != (None, None, None):
        raise UsageError(
            "extra arguments, --since, --site and --limit are for ready-made questions: put them into the SQL itself"
        )
    else:
        answer = lake.arrow(arguments.question)
    if arguments.plot is not None:
        to_be_overwritten(arguments.plot, overwrite=arguments.overwrite)
        _plot(answer, arguments.plot, f"unit {arguments.words[0]}, address {arguments.words[1]}")
    elif arguments.json:
        put_json(_rows_by_name(answer))
    elif arguments.csv:
        _put_csv(answer)
    else:
        _put_table(answer, DATES if arguments.question in QUESTIONS else ())
    return DONE


def _limit(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) < 19 and int(text)):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of rows (at least 1)")
    return int(text)


def _picture(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in _PICTURES:
        raise argparse.ArgumentTypeError(f"{text!r} must end in {', '.join(_PICTURES)}")
    return path


def _plot(answer: Any, path: Path, title: str) -> None:
    """A line a place and area that the register is known of."""
    import numpy as np
    import pyarrow as pa

    from ..exports.sink import output
    from ..plots import drawn_series

    if not len(answer):
        raise UsageError(f"there is no data on {title} to plot")
    keys = [
        ", ".join(key)
        for key in zip(*(answer.column(name).to_pylist() for name in ("site", "line", "area")), strict=True)
    ]
    times, values = answer.column("t_ns").cast(pa.int64()).to_numpy(), answer.column("raw").to_numpy()
    names, which = np.unique(np.array(keys, object).astype(str), return_inverse=True)
    if len(names) > _LINES:
        raise UsageError(f"{title} exists on {len(names):,} lines or areas: choose with --site or AREA")
    series = {str(name): (times[which == i], values[which == i].astype(np.float64)) for i, name in enumerate(names)}
    picture = drawn_series(path.suffix[1:].lower(), series, title)
    with output(path) as file:
        file.write(picture)


def _rows_by_name(answer: Any) -> list[dict[str, Any]]:
    names = answer.column_names
    return [dict(zip(names, row, strict=True)) for row in _plain_rows(answer, keep=True)]


def _plain_rows(answer: Any, *, keep: bool = False) -> Iterable[list[Any]]:
    """Rows of plain values; without `keep` all of them text. Times as ISO 8601 with all nanoseconds."""
    import pyarrow as pa
    import pyarrow.compute as pc

    columns = []
    for column in answer.columns:
        if pa.types.is_timestamp(column.type):  # without the system's zones: it may have none
            plain = column.cast(pa.timestamp(column.type.unit)).cast(pa.string())
            zone = "Z" if column.type.tz == "UTC" else ""
            column = pc.binary_join_element_wise(pc.replace_substring(plain, " ", "T", max_replacements=1), zone, "")
        elif pa.types.is_temporal(column.type) or pa.types.is_dictionary(column.type):
            column = column.cast(pa.string())
        values = column.to_pylist()
        columns.append([_json(value) if keep else "" if value is None else _cell_text(value) for value in values])
    return (list(row) for row in zip(*columns, strict=True))


def _json(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    if isinstance(value, list):
        return [_json(each) for each in value]
    if isinstance(value, dict):
        return {str(name): _json(each) for name, each in value.items()}
    if isinstance(value, Decimal):  # sums of whole numbers are of that kind
        return int(value) if value == value.to_integral_value() else float(value)
    if isinstance(value, float) and not isfinite(value):  # JSON has none of these
        return None
    return value if isinstance(value, str | int | float | bool) or value is None else str(value)


def _cell_text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    if isinstance(value, bool):
        return str(value).lower()  # as exports have it
    if isinstance(value, list):
        return " ".join(map(_cell_text, value))
    return str(value)


def _put_csv(answer: Any) -> None:
    import csv
    import io

    from ..exports.targets.csv import safe

    writer = csv.writer(made := io.StringIO(), lineterminator="\n")
    writer.writerow(answer.column_names)
    for row in _plain_rows(answer):
        writer.writerow([safe(cell) if _is_text(cell) else cell for cell in row])
        if made.tell() > _PIECE:
            put_data(made.getvalue())
            made.seek(0)
            made.truncate()
    put_data(made.getvalue())


def _is_text(cell: str) -> bool:
    """Whether it is no number: a minus sign at its beginning is none that a spreadsheet would run."""
    try:
        float(cell)
    except ValueError:
        return True
    return False


def _cut_cell(cell: str) -> str:
    return cell if len(cell) <= _WIDEST else cell[: _WIDEST - 1] + "…"


def _put_table(answer: Any, dates: Iterable[str]) -> None:
    """For people; `dates` are columns that mean one: captures without a clock have none."""
    import pyarrow as pa

    from ..words import is_clock

    rows = [[harmless(cell) for cell in row] for row in _plain_rows(answer)]
    if "what" in answer.column_names:
        at = answer.column_names.index("what")
        for row in rows:
            row[at] = page_words(row[at])
    for name in {*dates}.intersection(answer.column_names):
        at = answer.column_names.index(name)
        for row, t_ns in zip(rows, answer.column(name).cast(pa.int64()).to_pylist(), strict=True):
            if t_ns is not None and not is_clock(t_ns):
                row[at] = page_words("no clock")
    rows = [[*map(_cut_cell, row[:-1]), *row[-1:]] for row in rows]  # the last column has nothing beside it
    heads = [harmless(name) for name in answer.column_names]
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    for row in [heads, *rows]:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    if not rows:
        print(tr("(nothing)"))
