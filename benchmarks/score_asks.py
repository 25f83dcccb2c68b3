"""Scores the reasons that an analysis gives for requests that fail, and what it would ask instead.

    python benchmarks/score_asks.py [--seeds N] [--first SEED] [--taps precise,ftdi16] [--misses] [KIND ...]

Devices, clients and lists are drawn (`benchmarks/ask_devices.py`): twelve kinds of flaw, silent or refused, on buses of
one to five units, and twelve kinds of buses that are well or odd, where no reason may be given. A reason counts where
the first cause has it and its unit; a correction where the device model answers each of the requests, at least one.
Thresholds were chosen on seeds below 1000; figures told are of seeds from 1000 on.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from random import Random

from ask_devices import FLAWS, ODD, Drawn, flawed, odd
from ask_line import chunks_of

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.core import analyse
from captures.chunks import Capture
from dissectors.crc import crc_ok


@dataclass(slots=True)
class AskTally:
    """The buses of one kind."""

    buses: int = 0
    reasons: int = 0  # first, of the right unit; of odd buses: none given
    served: int = 0
    misses: list[str] = field(default_factory=list)


def causes_in(drawn: Drawn, tap: str, random: Random) -> list[Cause]:
    """What the analysis names."""
    capture = Capture.of(drawn.header, chunks_of(drawn, tap, random))
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def serves(drawn: Drawn, asks: list[str]) -> bool:
    """Whether the device model answers each of these ADUs."""
    for ask in map(bytes.fromhex, asks):
        device = drawn.devices.get(ask[0])
        answer = device.answer(ask[1:-2]) if device is not None and crc_ok(ask) else None
        if answer is None or answer[0] & 0x80:
            return False
    return bool(asks)


def score(kind: str, tap: str, seed: int, tally: AskTally) -> None:
    """One bus."""
    random = Random(f"{kind} {tap} {seed}")
    drawn = flawed(kind, random) if kind in FLAWS else odd(kind, random)
    told = [cause.to_json() for cause in causes_in(drawn, tap, random)]
    tally.buses += 1
    if kind in ODD:
        given = [cause for cause in told if "reason" in cause]
        tally.reasons += not given
        right = not given
    else:
        first = told[0] if told else {}
        right = first.get("reason") in drawn.reasons and first["units"][:1] == [drawn.unit]
        tally.reasons += right
        served = right and serves(drawn, first["ask_instead"])
        tally.served += served
        right = right and served
    if not right:
        said = "; ".join(
            f"{c['cause']} {c['units'][:2]} {c.get('reason', '')} {c.get('ask_instead', '')}" for c in told[:3]
        )
        device = drawn.devices[drawn.unit] if drawn.unit is not None else None
        mine = [pdu.hex() for unit, pdu in drawn.polls if unit == drawn.unit]
        words = "" if device is None else f"{'refused' if device.refuses else 'silent'}, list {' '.join(mine)}"
        tally.misses.append(f"{kind} {tap} {seed}: unit {drawn.unit}, {words}: said {said or 'nothing'}")


def drawn_buses(parser: argparse.ArgumentParser, kinds: Sequence[str], arguments: list[str]) -> argparse.Namespace:
    """Which drawn buses a score is asked for: `kinds` of those there are, `seeds` from `first` on, `taps`."""
    parser.add_argument("kinds", nargs="*", metavar="KIND", default=kinds)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=1000, metavar="SEED", help="the first seed (1000)")
    parser.add_argument("--taps", default="precise,ftdi16")
    parser.add_argument("--misses", action="store_true", help="print each bus that was not told rightly")
    options = parser.parse_args(arguments)
    if strange := sorted({*options.kinds}.difference(kinds)):
        parser.error(f"no such kind: {', '.join(strange)}; there are {', '.join(kinds)}")
    return options


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options = drawn_buses(parser, [*FLAWS, *ODD], arguments)
    tallies: dict[str, AskTally] = defaultdict(AskTally)
    for kind in options.kinds:
        for tap in options.taps.split(","):
            for seed in range(options.first, options.first + options.seeds):
                score(kind, tap, seed, tallies[kind])
        tally = tallies[kind]
        served = f"  {tally.served:3} served" if kind in FLAWS else ""
        print(f"{kind:18} {tally.buses:4} buses {tally.reasons:4} right{served}", flush=True)
        for miss in tally.misses if options.misses else ():
            print(f"    {miss}")
    for name, kinds in (("flawed", FLAWS), ("well or odd", ODD)):
        mine = [tallies[kind] for kind in options.kinds if kind in kinds]
        buses = sum(tally.buses for tally in mine)
        if buses:
            right = sum(tally.reasons for tally in mine)
            more = (
                f", corrected request served {sum(tally.served for tally in mine) / buses:.3f}"
                if kinds is FLAWS
                else ""
            )
            print(f"{name}: {buses} buses, right {right / buses:.3f}{more}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
