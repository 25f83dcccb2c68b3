"""Scores the inference of registers on devices whose maps are known.

    python benchmarks/score_registers.py [--polls N] [--seeds N] [--layouts FOLDER] [--family F] [--misses]
        [--sisters N] [--another] [--physics] [--habits] [--strangers] [--spoilt]

Devices are made from the layouts (shipped maps and `layouts/`, or the maps of another folder), moved to other
addresses, polled as masters do. A value counts where a word of it moved; it is right where registers, integer or float,
and word order are. `--physics` takes the devices of `register_makers` instead, `--habits` a hundred times `--seeds` of
makers that are drawn (`register_habits`), `--strangers` as many of unrelated registers. `--spoilt` counts instead what
is claimed of readings that carry no type: shuffled, constant and short ones (`register_strangers`). What the tables
were fitted on is in their provenance: figures for those families flatter; `fit_registers.py --folds N` gives figures of
families held out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from random import Random

from register_habits import habit_devices
from register_makers import physical_device, physical_layouts
from register_scores import Tally, tallied
from register_series import MadeDevice, family, layouts, made_device
from register_strangers import SPOILT, spoilt, strangers

from analyzer.registers.evidence import shipped_weights
from analyzer.registers.inference import infer
from analyzer.registers.mixed import UNSURE_AT_MOST
from dissectors.maps import RegisterMap, read_map


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--polls", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=5000)
    parser.add_argument("--layouts", type=Path, metavar="FOLDER", help="maps of your own instead")
    parser.add_argument("--sisters", type=int, default=0, help="units beside each device that have its layout")
    parser.add_argument("--another", action="store_true", help="series of another hand")
    parser.add_argument("--physics", action="store_true", help="layouts and series of a third hand instead")
    parser.add_argument("--habits", action="store_true", help="devices of makers that are drawn instead")
    parser.add_argument("--strangers", action="store_true", help="devices of unrelated registers instead")
    parser.add_argument("--spoilt", action="store_true", help="types claimed of shuffled, constant, few readings")
    parser.add_argument("--family", help="only layouts of this maker")
    parser.add_argument("--by-layout", action="store_true", help="a line a layout")
    parser.add_argument("--misses", action="store_true", help="print each miss")
    options = parser.parse_args(arguments)
    charts = layouts()
    if options.layouts is not None:
        charts = {path.stem: read_map(path) for path in sorted(options.layouts.glob("*.*"))}
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    drawn = range(100 * options.first_seed, 100 * (options.first_seed + options.seeds))  # far behind those fitted
    made: dict[str, Iterable[MadeDevice]] = {
        name: _devices(name, chart, seeds, options)
        for name, chart in charts.items()
        if options.family in (None, family(chart))
    }
    if options.physics:
        made = {
            layout.name: map(partial(physical_device, layout, polls=options.polls), seeds)
            for layout in physical_layouts().values()
        }
    if options.habits:
        made = {"habits": habit_devices(drawn, options.polls)}
    if options.strangers:
        made = {"strangers": strangers(drawn, options.polls)}
    if options.spoilt:
        for kind in SPOILT:
            values = [value for device in spoilt(kind, drawn, options.polls) for value in infer(device.readings)]
            above = [value for value in values if value.confidence > UNSURE_AT_MOST]
            print(f"{kind}: {len(values)} values, {len(above)} types above {UNSURE_AT_MOST:.0%}")
        return 0
    weights, everything = shipped_weights(), Tally()
    for name, members in made.items():
        tally = Tally()
        for device in members:
            tallied(device, weights, tally)
            tallied(device, weights, everything)
        if options.by_layout and tally.due["all"]:
            print(f"{name:<26} {tally}")
        if options.misses:
            print(*tally.misses, sep="\n")
    if not everything.due["all"]:
        print("no value moved", file=sys.stderr)
        return 1
    print(f"all layouts: {everything}\n{everything.calibration()}")
    return 0


def _devices(name: str, chart: RegisterMap, seeds: range, options: argparse.Namespace) -> Iterator[MadeDevice]:
    for seed in seeds:
        more = {"another": float(options.another), "sisters": options.sisters}
        yield made_device(name, chart, Random(f"{name} {seed}"), options.polls, **more)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
