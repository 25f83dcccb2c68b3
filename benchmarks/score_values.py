"""Scores what an analysis tells of values that are harmed: torn, frozen, swapped, scaled, lost, of other registers.

    python benchmarks/score_values.py [--seeds N] [--first SEED] [--taps precise,ftdi16] [--misses] [KIND ...]

Devices are drawn (`value_devices.py`): sixteen kinds of harm (`value_harms.py`), and eleven kinds of buses, well
or odd (`value_oddities.py`), where nothing may be told of values. Harm counts as told where the first cause is one of
its kind's, of the right unit. What was fitted was fitted on seeds below 1000; figures told are of seeds from 1000 on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from random import Random

from ask_devices import Drawn
from ask_line import chunks_of
from score_asks import drawn_buses
from value_devices import drawn_bus, drawn_site
from value_harms import HARMS
from value_oddities import WELL

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import Story, story_of
from analyzer.core import analyse
from captures.chunks import Capture

OF_VALUES = ("value-lost", "values-changed")  # which are notes


@dataclass
class DrawnValues:
    """A bus, and what is so: the unit that is harmed and the causes that say it (none: nothing is wrong)."""

    bus: Drawn
    unit: int | None = None
    causes: tuple[str, ...] = ()
    also: tuple[str, ...] = field(default=())


def drawn_values(kind: str, random: Random) -> DrawnValues:
    """A bus of a kind."""
    if kind in WELL:
        site = drawn_site(random)
        WELL[kind](random, site)
        return DrawnValues(drawn_bus(site))
    site, causes, also = HARMS[kind](random)
    return DrawnValues(drawn_bus(site), site.victim.unit, causes, also)


@dataclass(slots=True)
class ValueTally:
    """The buses of one kind."""

    buses: int = 0
    right: int = 0  # first, of the right unit; of buses that are well: nothing accused
    wrong: int = 0  # others accused
    mute: int = 0
    misses: list[str] = field(default_factory=list)


def story_in(drawn: DrawnValues, tap: str, random: Random) -> Story:
    """What the analysis tells."""
    capture = Capture.of(drawn.bus.header, chunks_of(drawn.bus, tap, random))
    return story_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def score(kind: str, tap: str, seed: int, tally: ValueTally) -> None:
    """One bus."""
    random = Random(f"{kind} {tap} {seed}")
    drawn = drawn_values(kind, random)
    story = story_in(drawn, tap, random)
    told = [cause for cause in story.causes if cause.severity != "note" or cause.cause in OF_VALUES]
    tally.buses += 1
    named = [c.cause in drawn.causes and c.units[:1] == (drawn.unit,) for c in told]
    right = named[:1] == [True] if drawn.causes else not told
    wrong = any(not so and cause.cause not in drawn.also for so, cause in zip(named, told, strict=True))
    tally.right += right
    tally.wrong += wrong
    tally.mute += bool(drawn.causes) and not told and not story.not_explained
    if not right or wrong:
        said = "; ".join(f"{c.cause} {c.units[:2]} {c.confidence:.2f} {c.text[:90]}" for c in told[:3])
        left = "; ".join(each.like for each in story.not_explained[:2])
        tally.misses.append(f"{kind} {tap} {seed}: unit {drawn.unit}: said {said or 'nothing'} {left}")


def _tell(name: str, tallies: Sequence[ValueTally]) -> None:
    buses = sum(tally.buses for tally in tallies) or 1
    right, wrong, mute = (sum(getattr(t, each) for t in tallies) / buses for each in ("right", "wrong", "mute"))
    print(f"{name:18} {buses:4} buses, right {right:.3f}, wrong {wrong:.3f}, mute {mute:.3f}", flush=True)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options = drawn_buses(parser, [*HARMS, *WELL], arguments)
    tallies = {kind: ValueTally() for kind in options.kinds}
    for kind, tally in tallies.items():
        for tap in options.taps.split(","):
            for seed in range(options.first, options.first + options.seeds):
                score(kind, tap, seed, tally)
        _tell(kind, [tally])
        for miss in tally.misses if options.misses else ():
            print(f"    {miss}")
    for name, kinds in (("harmed", HARMS), ("well or odd", WELL)):
        if mine := [tally for kind, tally in tallies.items() if kind in kinds]:
            _tell(name, mine)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
