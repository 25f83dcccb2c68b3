"""Scores who answers whom on drawn rounds (`pairing_rounds`): right, unsure, wrong; displaced ones by themselves.

    python benchmarks/score_pairing.py [--seeds N] [--first-seed N] [--by habit|moving|tap] [--misses]

An answer is right where its row names the request that it is of, or another one of the same bytes. Seeds from 100,000
on are held out: nothing was fitted on them.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from pairing_rounds import DrawnRound, drawn  # noqa: E402

from analyzer.core import analyse  # noqa: E402
from analyzer.tables.schema import Kind, Rows  # noqa: E402


def judged(made: DrawnRound) -> Counter[tuple[str, str]]:
    """Answers by what was said of them."""
    parts = [part.batch for part in analyse(made.capture)]
    rows = Rows.joined([part.rows for part in parts])
    told = {int(row.start): row for row in rows if row.kind == Kind.RESPONSE}
    adus = {
        int(part.rows.start[i]): part.bytes_of(i) for part in parts for i in range(len(part)) if part.rows.index[i] >= 0
    }
    count: Counter[tuple[str, str]] = Counter()
    seen: set[int] = set()
    for pair in made.pairs:
        again = pair.request in seen
        seen.add(pair.request)
        row = told.get(pair.start)
        displaced = pair.taken_for is not None
        same = displaced and adus.get(pair.taken_for or 0) == adus.get(pair.request)
        kind = "same poll" if same else "displaced" if displaced else "again in a gap" if again else "plain"
        if row is None:
            count[kind, "lost"] += 1
        elif row.unsure:
            count[kind, "unsure"] += 1
        elif row.request_start == pair.request:
            taken = pair.taken_for if pair.taken_for is not None else -1
            count[kind, "right" if row.taken_for_start == taken else "right, taken for another"] += 1
        elif row.request_start >= 0 and adus.get(row.request_start) == adus.get(pair.request):
            count[kind, "right"] += 1
        elif row.request_start < 0:
            count[kind, "none"] += 1
        else:
            count[kind, "wrong"] += 1
    return count


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--by", choices=("habit", "moving", "tap"), default="moving")
    parser.add_argument("--misses", action="store_true", help="name each seed with wrong answers")
    options = parser.parse_args()
    groups: dict[str, Counter[tuple[str, str]]] = {}
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        made = drawn(seed)
        count = judged(made)
        groups.setdefault(getattr(made, options.by), Counter()).update(count)
        if options.misses and sum(n for (_, told), n in count.items() if told in ("wrong", "none")):
            print(seed, made.habit, made.moving, made.tap, dict(count))
    every: Counter[tuple[str, str]] = sum(groups.values(), Counter())
    for name, count in [*sorted(groups.items()), ("all", every)]:
        print(name)
        for kind in ("plain", "displaced", "same poll", "again in a gap"):
            mine = {told: n for (each, told), n in sorted(count.items()) if each == kind}
            total = sum(mine.values())
            if total:
                print(
                    f"  {kind:<15} {total:7}  " + ", ".join(f"{told} {n / total:.4f} ({n})" for told, n in mine.items())
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
