"""What maps and relations add to the inference of registers, measured on devices whose maps are known.

    python benchmarks/score_beyond.py [--polls N] [--seeds N] [--share S]

Of each device a share of its map is given (as where a manual tells of some values, or a user of one), and the other
values that moved are scored with and without it. Answers that a relation supports (sums, U x I) are scored apart.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from random import Random

from register_series import MadeDevice, layouts, made_device

from analyzer.registers.inference import infer
from analyzer.registers.roles import RegisterValue
from dissectors.maps import RegisterMap
from dissectors.maps.model import MapArea, MappedValue


def right_values(values: list[RegisterValue], rows: list[tuple[MapArea, MappedValue]]) -> list[bool]:
    """Of each row whether it was read right: registers, integer or float, word order."""
    answers = {(value.area, value.address): value for value in values}
    return [(area, row.address) in answers and _same(answers[area, row.address], row) for area, row in rows]


def _same(value: RegisterValue, row: MappedValue) -> bool:
    shape = (value.words, value.kind == "float") == (row.length, row.is_float)
    return shape and (row.length == 1 or value.order == row.order)


def moved_rows(device: MadeDevice) -> list[tuple[MapArea, MappedValue]]:
    found = {}
    for area, address, quantity, rows in device.truth:
        block = next(b for b in device.readings if (b.area, b.address, b.quantity) == (area, address, quantity))
        words = block.series[0]
        moved = (words != words[0]).any(axis=0)
        for row in rows:
            if row.type != "text" and moved[row.address - address : row.end - address].any():
                found[area, row.address] = (area, row)
    return list(found.values())


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--polls", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first-seed", type=int, default=6000)
    parser.add_argument("--share", type=float, default=0.3, help="of the values that moved, those that are told")
    options = parser.parse_args(arguments)
    counts: Counter[str] = Counter()
    for name, chart in layouts().items():
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            random = Random(f"beyond {name} {seed}")
            device = made_device(name, chart, random, options.polls)
            rows = moved_rows(device)
            told = [pair for pair in rows if random.random() < options.share]
            rest = [pair for pair in rows if pair not in told]
            alone = infer(device.readings)
            taught = infer(device.readings, charts={1: replace(RegisterMap("", ()), rows=tuple(r for _, r in told))})
            counts["rest"] += len(rest)
            counts["alone"] += sum(right_values(alone, rest))
            counts["taught"] += sum(right_values(taught, rest))
            one = [pair for pair in rest if pair[1].length == 2 and not pair[1].is_float]
            counts["pairs"] += len(one)
            counts["pairs alone"] += sum(right_values(alone, one))
            counts["pairs taught"] += sum(right_values(taught, one))
            truth = {(area, row.address): row for area, row in rows}
            for value in alone:
                row = truth.get((value.area, value.address))
                if value.changes and value.kind in ("int", "float"):
                    related = "related" if value.related else "unrelated"
                    counts[related] += 1
                    counts[f"{related} right"] += row is not None and _same(value, row)
    print(f"{counts['rest']} values beside a map that has {options.share:.0%}: right {_share(counts, 'alone', 'rest')}"
          f" without it, {_share(counts, 'taught', 'rest')} with it; integers of 32 bits"
          f" {_share(counts, 'pairs alone', 'pairs')}, {_share(counts, 'pairs taught', 'pairs')}")  # fmt: skip
    print(f"answers that a relation supports: {counts['related']}, right {_share(counts, 'related right', 'related')};"
          f" others: {counts['unrelated']}, right {_share(counts, 'unrelated right', 'unrelated')}")  # fmt: skip
    return 0


def _share(counts: Counter[str], part: str, whole: str) -> str:
    return f"{counts[part] / max(counts[whole], 1):.3f}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
