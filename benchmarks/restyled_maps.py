"""A law of the import of maps: what a table says stays the same where its headings are words that nobody knows and its
columns stand in another order. What only a heading can say (that addresses are hexadecimal, that a factor divides) is
lost with it; all else must be told by what stands in the columns.

    python benchmarks/restyled_maps.py [FOLDER | --drawn N] [--wrong]
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from random import Random
from typing import Final

from drawn_maps import drawn_files
from map_files import MadeFile, made_files, whole_files
from score_maps import scored

from dissectors.maps import MapError
from dissectors.maps.headings import headings_in
from dissectors.maps.importers.builder import ImportedMap
from dissectors.maps.importers.source import MapSource
from dissectors.maps.importers.tables import chart_of
from dissectors.maps.records import record_sheets
from dissectors.maps.sheets import MapSheet, ways_in

_LETTERS: Final = "ᎠᎡᎢᎣᎤᎥᎦᎧᎨᎩᎪᎫᎬᎭᎮᎯᎰᎱᎲᎳᎴᎵᎶᎷᎸᎹᎺᎻᎼᎽᎾᎿ"  # Cherokee: a language without a word in the tables
_MOST: Final = 30_000


def _sheets(file: MadeFile) -> Iterator[MapSheet]:
    source = MapSource(file.name, file.data)
    yield from record_sheets(source)
    try:
        yield from (sheets[0] for sheets in ways_in(source.data, source.text, source.name, _MOST) if len(sheets) == 1)
    except MapError:
        return


def restyled(file: MadeFile, *, is_renamed: bool = True) -> MadeFile | None:
    """The file as CSV with unknown headings and columns in another order; None where it has no table with headings."""
    source = MapSource(file.name, file.data)
    read: list[tuple[ImportedMap, MapSheet]] = []
    for sheet in _sheets(file):
        chart = chart_of(source, sheet)
        if chart is not None and chart.chart.rows:
            read.append((chart, sheet))
    if not read:
        return None
    rows = max(read, key=lambda pair: pair[0].facts)[1].rows
    heads = {*headings_in(rows)}
    if not heads:
        return None
    chance = Random(file.name)
    width = max(map(len, rows))
    order = chance.sample(range(width), width)
    names: dict[str, str] = defaultdict(lambda: "".join(chance.choices(_LETTERS, k=chance.randint(3, 8))))
    text = io.StringIO()
    written = csv.writer(text)
    for at, row in enumerate(rows):
        cells = [names[cell] if is_renamed and at in heads and cell else cell for cell in row]
        written.writerow(_moved(cells, order) if at in heads or sum(map(bool, row)) > 1 else cells)
    return replace(file, name=f"{file.name}.csv", data=text.getvalue().encode())


def _moved(cells: Sequence[str], order: Sequence[int]) -> list[str]:
    return [cells[at] if at < len(cells) else "" for at in order]


def stay_right(files: Iterable[MadeFile], *, wrong: bool = False) -> dict[str, tuple[int, int]]:
    """By folds: the rows that stay right, and those that were, of files whose tables have headings."""
    found: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for file in files:
        before = scored(file, Counter())
        changed = restyled(file)
        if not before or changed is None:
            continue
        why: Counter[str] = Counter()
        after = min(before, scored(changed, why))
        found[file.fold][0] += after
        found[file.fold][1] += before
        if wrong and after < before:
            print(f"{file.name}: {after} of {before}: {dict(why.most_common(3))}")
    return {fold: (after, before) for fold, (after, before) in found.items()}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--drawn", type=int, default=300, help="how many drawn files")
    parser.add_argument("--wrong", action="store_true")
    parser.add_argument("--show", metavar="NAME")
    options = parser.parse_args(arguments)
    files = [*made_files(), *whole_files(), *drawn_files(options.drawn)]
    if options.show is not None:
        shown = next(filter(None, (restyled(file) for file in files if file.name == options.show)))
        print(shown.data.decode())
        return 0
    for fold, (after, before) in stay_right(files, wrong=options.wrong).items():
        print(f"{fold:12} {after} of {before} rows stay right: {after / max(1, before):.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
