"""Scores the recognition of devices by their traffic: how often a device that has a shipped map is named, how often
rightly, and how often a stranger is taken for one.

    python benchmarks/score_recognition.py [--polls N] [--seeds N] [--wild SHARE] [--wrong] [--layouts FOLDER]

Devices of the shipped maps stand at their own addresses and say nothing of themselves, as most devices on a bus do; the
strangers are the layouts beside this file, which no shipped map describes, at their own addresses too. With `--telling`
a device also answers function 17 or 43 where its map says with what.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from random import Random

from register_series import LAYOUTS, MadeDevice, made_device

from analyzer.registers.inference import infer
from analyzer.registers.recognition import UnitTexts, recognised
from dissectors.maps import RegisterMap, read_map, shipped_map, shipped_names


def named(device: MadeDevice, chart: RegisterMap | None = None) -> tuple[str, float] | None:
    """The map that a device is taken for, and how sure; `chart` where it says of itself what that map matches."""
    texts = UnitTexts()
    if chart is not None:
        for which, wanted in (("server_id", chart.match.server_id), ("identification", chart.match.identification)):
            if wanted:
                texts.texts[1, which] = " ".join(wanted).encode()
    found = recognised(device.readings, texts, infer(device.readings))
    return (found[0].name, found[0].confidence) if found else None


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--polls", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=9000)
    parser.add_argument(
        "--wild", type=float, default=0.0, metavar="SHARE", help="of values that are not as their names"
    )
    parser.add_argument("--layouts", type=Path, default=LAYOUTS, metavar="FOLDER", help="the strangers")
    parser.add_argument("--wrong", action="store_true", help="print each wrong answer, and each device not named")
    parser.add_argument("--telling", action="store_true", help="devices say of themselves what their maps match")
    options = parser.parse_args(arguments)
    counts: Counter[str] = Counter()
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        for name in shipped_names():
            chart = shipped_map(name)
            device = made_device(
                name, chart, Random(f"recognise {name} {seed}"), options.polls, move=False, wild=options.wild
            )
            said = named(device, chart if options.telling else None)
            what = "silent" if said is None else "right" if said[0] == name else "wrong"
            counts[what] += 1
            if options.wrong and what != "right":
                asked = ", ".join(f"{area} {at}+{count}" for area, at, count, _ in device.truth[:4])
                print(f"{name}: {what} {said or ''}: {len(device.truth)} blocks, {asked}")
        for path in sorted(options.layouts.rglob("*.csv")):
            device = made_device(path.stem, read_map(path), Random(f"stranger {path.stem} {seed}"), options.polls,
                                 move=False, wild=options.wild)  # fmt: skip
            said = named(device)
            counts["strangers"] += 1
            counts["stranger named"] += said is not None
            if options.wrong and said is not None:
                print(f"stranger {path.stem}: {said}")
    known = counts["right"] + counts["wrong"] + counts["silent"]
    right, wrong, silent = (counts[what] / known for what in ("right", "wrong", "silent"))
    of_answers = right / max(right + wrong, 1e-9)
    print(f"{known} devices with a shipped map: right {right:.3f}, wrong {wrong:.3f}, nothing said {silent:.3f};"
          f" of what was said right {of_answers:.3f}")  # fmt: skip
    taken = counts["stranger named"] / max(counts["strangers"], 1)
    print(f"{counts['strangers']} strangers: taken for one {taken:.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
