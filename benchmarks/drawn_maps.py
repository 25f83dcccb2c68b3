"""Files of register maps that are drawn: a layout, a language, and for each thing that a row says a way to say it.

    python benchmarks/drawn_maps.py [--count N] [--fold NAME] [--wrong] [--show NAME]

The words stand in `maps/pieces.toml`. So a file is read that nobody wrote, and what a reader learns for one layout or
language counts only where it holds for the others. Every second language and every second draw is of the fold
`drawn-fit`, which may be looked at; `drawn` tells.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator

from drawn_layouts import LAYOUTS
from drawn_styles import columns_of, drawn_style, points_of
from map_files import MadeFile


def drawn_file(number: int) -> MadeFile:
    """The file of a draw."""
    style = drawn_style(number)
    points = points_of(style)
    columns = columns_of(style)
    name, text = LAYOUTS[style.layout](style, columns, points)
    rows = [(p.area, p.address, p.name, p.type, p.scale, p.unit, p.access) for p in points]
    fold = ("drawn-fit", "drawn")[number % 2]
    return MadeFile(style.layout, fold, f"d{number}-{style.layout}{name}", text.encode(), rows)


def drawn_files(count: int) -> Iterator[MadeFile]:
    """So many files, the same each time."""
    return map(drawn_file, range(count))


def main(arguments: list[str]) -> int:
    from score_maps import scored

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--fold")
    parser.add_argument("--wrong", action="store_true")
    parser.add_argument("--show", metavar="NAME")
    options = parser.parse_args(arguments)
    right: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for file in drawn_files(options.count):
        if options.show is not None and file.name == options.show:
            print(file.data.decode())
        if options.fold not in (None, file.fold):
            continue
        wrong: Counter[str] = Counter()
        good = scored(file, wrong)
        for key in (file.fold, file.style):
            right[key][0] += good
            right[key][1] += len(file.rows)
        if options.wrong and wrong:
            print(f"{file.name}: {good} of {len(file.rows)}: {dict(wrong.most_common(3))}")
    for fold, (good, rows) in sorted(right.items()):
        print(f"{fold:12} {good} of {rows} rows right: {good / max(1, rows):.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
