"""How well certificates hold: coverage of their bounds, and verdicts on drawn lines.

    python benchmarks/score_certificate.py [--lines 1000] [--buses 6] [--seed 1]

Lines are drawn as counts (a true share, a number of exchanges); buses as captures that run through the whole program.
Half of both have one marginal defect: a unit that loses a share between the two limits. Found: the verdict is not pass.

Coverage stands by how many losses are expected, and for lines at which a verdict turns: as many exchanges as a pass
needs, or more, and a share from the pass limit to thrice the fail limit, which is three losses or more.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from random import Random

import captures
from analyzer.reports.certificate import certify, default_limits
from analyzer.reports.certificate.bounds import quantile_ranks, share_bounds, trials_for_share
from analyzer.reports.certificate.claims import FAIL, PASS, Claim
from analyzer.reports.certificate.limits import DEFAULTS
from dissectors.crc import crc_bytes

_CONFIDENCE = 0.95
_LIMIT = DEFAULTS["lost"]
_EXPECTED = (0.1, 1.0, 3.0, 10.0, 50.0, 500.0)
_CHARACTER_NS = 286_458  # 38400 bit/s, 11 bits


def binomial(random: Random, of: int, share: float) -> int:
    """Hits in so many trials, drawn by the distances between them."""
    hits, at = 0, 0
    while share > 0:
        at += 1 + int(math.log(1 - random.random()) / math.log1p(-share))
        if at > of:
            break
        hits += 1
    return hits


def expecting(random: Random, fewest: float, most: float) -> tuple[int, float]:
    """A line of which so many hits are expected: its exchanges, its share."""
    of = round(10 ** random.uniform(3, 5))
    return of, min(_between(random, fewest, most) / of, 0.5)


def at_the_limits(random: Random) -> tuple[int, float]:
    """A line at which a verdict turns."""
    of = round(_between(random, trials_for_share(_LIMIT.passes, _CONFIDENCE), 1e5))
    return of, _between(random, _LIMIT.passes, 3 * _LIMIT.fails)


def _between(random: Random, least: float, most: float) -> float:
    return math.exp(random.uniform(math.log(least), math.log(most)))


def coverage(random: Random, lines: int, draw: Callable[[Random], tuple[int, float]]) -> tuple[float, float]:
    """How often shares lie in their bounds, and quantiles in theirs."""
    shares = ranks = 0
    for _ in range(lines):
        of, share = draw(random)
        low, high = share_bounds(binomial(random, of, share), of, _CONFIDENCE)
        shares += low <= share <= high
        first, last = quantile_ranks(of, 1 - share, _CONFIDENCE)
        below = of - binomial(random, of, share)  # values under the true quantile
        ranks += (first or 0) <= below < (last or of + 1)
    return shares / lines, ranks / lines


def drawn_verdicts(random: Random, lines: int) -> tuple[float, float]:
    """Marginal lines that did not pass, healthy lines that failed: shares of them, by their counts alone."""
    found = failed = 0
    needed = trials_for_share(_LIMIT.passes, _CONFIDENCE)
    for number in range(lines):
        marginal = number % 2 == 1
        of = round(10 ** random.uniform(3.6, 5))
        share = random.uniform(2, 8) * _LIMIT.passes if marginal else random.uniform(0, 0.1) * _LIMIT.passes
        hits = binomial(random, of, share)
        low, high = share_bounds(hits, of, _CONFIDENCE)
        verdict = Claim("lost", 1, _LIMIT, hits / of, low, high, needed, of, hits).verdict
        found += marginal and verdict != PASS
        failed += not marginal and verdict == FAIL
    return found / (lines // 2), failed / (lines - lines // 2)


def write_bus(path: Path, random: Random, polls: int, lossy: float) -> None:
    """Two to four units asked in turn; the last one loses a share of its answers."""
    units = random.sample(range(1, 248), random.randint(2, 4))
    chunks, t_ns = [json.dumps({"format": "serial-chunks", "version": 1, "baud": 38400, "char_bits": 11})], 10**18
    for number in range(polls * len(units)):
        unit = units[number % len(units)]
        asked = bytes((unit, 3, 0, unit, 0, 2))
        answer = bytes((unit, 3, 4)) + random.randbytes(4)
        silent = unit == units[-1] and random.random() < lossy
        for data, pause in ((asked, random.randrange(20, 30)), (b"" if silent else answer, random.randrange(3, 15))):
            if data:
                frame = data + crc_bytes(data)
                t_ns += pause * 1_000_000 + len(frame) * _CHARACTER_NS
                chunks.append(json.dumps({"t_ns": t_ns, "hex": frame.hex()}))
        t_ns += 300_000_000 if silent else 0
    path.write_text("\n".join(chunks) + "\n")


def bus_verdicts(random: Random, buses: int) -> tuple[int, int]:
    """The same of whole captures: marginal ones that did not pass, healthy ones that failed."""
    found = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(buses):
            marginal = number % 2 == 1
            path = Path(folder) / f"{number}.jsonl"
            write_bus(path, random, 4000, random.uniform(2, 8) * _LIMIT.passes if marginal else 0)
            verdict = certify(captures.open(path), default_limits()).verdict
            found += marginal and verdict != PASS
            failed += not marginal and verdict == FAIL
            print(f"bus {number + 1}: {'marginal' if marginal else 'healthy'}: {verdict}")
    return found, failed


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lines", type=int, default=1000)
    parser.add_argument("--buses", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    random = Random(arguments.seed)
    for fewest, most in itertools.pairwise(_EXPECTED):
        shares, ranks = coverage(random, arguments.lines, partial(expecting, fewest=fewest, most=most))
        print(f"{fewest:g} to {most:g} hits expected: shares {shares:.1%}, quantiles {ranks:.1%} in their bounds")
    shares, ranks = coverage(random, arguments.lines, at_the_limits)
    print(f"at the limits: shares {shares:.1%}, quantiles {ranks:.1%} in their bounds")
    found, failed = drawn_verdicts(random, arguments.lines)
    print(f"drawn lines: {found:.1%} of the marginal found, {failed:.1%} of the healthy failed")
    if arguments.buses:
        buses = bus_verdicts(random, arguments.buses)
        marginal = arguments.buses // 2
        print(
            f"buses: {buses[0]} of {marginal} marginal found, {buses[1]} of {arguments.buses - marginal} healthy failed"
        )


if __name__ == "__main__":
    main()
