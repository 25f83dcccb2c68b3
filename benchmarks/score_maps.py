"""Scores the import of register maps: how many rows, of which all that the file shows is read rightly.

    python benchmarks/score_maps.py [--fold NAME] [--wrong] [--rows FILE]

Made-up makers in folds (`map_files.py`): `fit` and `held` may be looked at when words are added, `new` has languages
and layouts of which nothing speaks; `late` tells the score. Whole files, written by hand, are `fresh-fit`, `fresh`,
`unseen`, `later`, `wide`, `aside` and `hands` (`maps/whole.toml`). `tests` are the oddities of the tests and the other
programs' files. `drawn_maps.py` has files that are drawn, `restyled_maps.py` what stays right below unknown headings in
another order. `--rows FILE` writes every row read, a line each, so that two versions can be compared row by row.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from map_files import MadeFile, made_files, whole_files

from dissectors.maps import MapError
from dissectors.maps.importers import import_maps

_TESTS: Final = Path(__file__).parents[1] / "tests"
_CELLS: Final = ("area", "address", "name", "type", "scale", "unit", "access")


def read_rows(name: str, data: bytes) -> list[tuple[Any, ...]]:
    """What an import reads of a file; nothing where it refuses."""
    try:
        charts = import_maps(name, data)
    except MapError:
        return []
    return [
        (row.area, row.address, row.name, row.type, row.scale, row.unit, row.access)
        for one in charts
        for row in one.chart.rows
    ]


def scored(file: MadeFile, wrong: Counter[str]) -> int:
    """How many of a file's rows are read rightly; what is wrong of the others is counted."""
    found = {row[:2]: row for row in read_rows(file.name, file.data)}
    right = 0
    for row in file.rows:
        read = found.get(row[:2])
        bad = ["missing"] if read is None else [
            f"{cell}: {is_read!r}, not {is_shown!r}"
            for cell, is_read, is_shown in zip(_CELLS, read, row, strict=True)
            if is_read != is_shown and not (cell == "access" and not is_shown)
        ]  # fmt: skip
        right += not bad
        wrong.update(bad[:2])
    return right


def test_files() -> Iterator[tuple[str, str, bytes, list[str]]]:
    """(fold, name, content, expected rows) of the oddities that the tests have."""
    sys.path[:0] = [str(_TESTS), str(_TESTS / "support")]
    for module, table in (("test_maps_tables", "TABLES"), ("test_maps_odd_files", "FILES")):
        for oddity, (name, data, expected, _) in getattr(importlib.import_module(module), table).items():
            yield oddity, name, data, expected


def texts_of(name: str, data: bytes) -> list[str]:
    """The rows of a file, a text each, as the tests write them."""
    from oddmaps import row_texts

    try:
        return [text for one in import_maps(name, data) for text in row_texts(one)]
    except MapError as error:
        return [f"refused: {error}"]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--fold",
        choices=(
            *("fit", "held", "new", "late", "fresh-fit", "fresh", "unseen", "later", "wide", "aside"),
            *("hands-fit", "hands", "tests"),
        ),
    )
    parser.add_argument("--wrong", action="store_true", help="print what is wrong in each file")
    parser.add_argument("--rows", type=Path, metavar="FILE", help="write every row that is read")
    options = parser.parse_args(arguments)
    right: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    lines: list[str] = []
    for file in (*made_files(), *whole_files()):
        if options.fold not in (None, file.fold):
            continue
        wrong: Counter[str] = Counter()
        good = scored(file, wrong)
        right[file.fold][0] += good
        right[file.fold][1] += len(file.rows)
        lines += [json.dumps([file.name, *row], ensure_ascii=False) for row in read_rows(file.name, file.data)]
        if options.wrong and wrong:
            print(f"{file.name}: {good} of {len(file.rows)}: {dict(wrong.most_common(3))}")
    for oddity, name, data, expected in test_files() if options.fold in (None, "tests") else ():
        texts = texts_of(name, data)
        good = sum(text in texts for text in expected)
        right["tests"][0] += good
        right["tests"][1] += len(expected)
        lines += [json.dumps([oddity, text], ensure_ascii=False) for text in texts]
        if options.wrong and good < len(expected):
            print(f"{oddity}: {[text for text in expected if text not in texts]} read as {texts}")
    for fold, (good, rows) in right.items():
        print(f"{fold:6} {good} of {rows} rows right: {good / max(1, rows):.3f}")
    if options.rows is not None:
        options.rows.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
