"""Scores what is said of drawn sessions that are no Modbus (`foreign_talks`, `foreign_meters`).

    python benchmarks/score_foreign.py [--sessions N] [--first SEED] [--misses] [KIND ...]

Other protocols: a report is right that has no frame and no cause, and a reading of the pasted session that has no
frame. Meters with the CRC of Modbus: right is what names the meter as no Modbus; and the report advises nothing.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from foreign_meters import METERS  # noqa: E402
from foreign_talks import TALKS, heard, pasted  # noqa: E402

from analyzer import paste  # noqa: E402
from analyzer.paste.model import PastedFrame  # noqa: E402
from analyzer.reports.page import text  # noqa: E402
from analyzer.reports.summary import summarize  # noqa: E402
from captures.errors import HexError  # noqa: E402

_ADVICE = ("wiring", "termination", "connect A to A", "two transmitters", "broadcast-answered")


def wrong(kind: str, seed: int) -> Iterator[str]:
    """What is wrong of what is said of a session."""
    random = Random(f"{kind} {seed}")
    talk = (TALKS[kind] if kind in TALKS else METERS[kind])(random)
    report = summarize(heard(talk, random))
    if report.frames and kind in TALKS:
        yield f"{report.frames} frames"
    yield from (f"cause {cause.cause}" for cause in report.causes)
    if kind in METERS:
        page = " ".join(text(report).split())
        if "not Modbus, but" not in page or kind not in report.not_modbus:
            yield f"report: {report.not_modbus or 'not named'}"
        yield from (f"advice: {word}" for word in _ADVICE if word in page)
    yield from _wrong_in_paste(kind, pasted(talk))


def _wrong_in_paste(kind: str, lines: str) -> Iterator[str]:
    try:
        read = paste.read(lines[:20000].rpartition("\n")[0] or lines)
    except (paste.PasteError, HexError):
        yield "parse: unreadable"
        return
    if kind in METERS and not (read.why.startswith("not Modbus, but") and kind in read.why):
        yield f"parse: {read.why[:60]}"
    if right := [piece for piece in read.pieces if isinstance(piece, PastedFrame) and piece.check_ok]:
        yield f"parse: {len(right)} right frames"
    if shown := [piece for piece in read.pieces if isinstance(piece, PastedFrame) and not piece.check_ok]:
        yield f"parse: {len(shown)} frames, wrong ({read.protocol})"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="of these kinds (all)")
    parser.add_argument("--sessions", type=int, default=20, metavar="N", help="of each kind (20)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed (0)")
    parser.add_argument("--misses", action="store_true", help="say of each session what is wrong")
    given = parser.parse_args(arguments)
    sums: Counter[str] = Counter()
    for kind in given.kinds or (*TALKS, *METERS):
        found = {seed: list(wrong(kind, seed)) for seed in range(given.first, given.first + given.sessions)}
        by_parse = sum(any(each.startswith("parse") for each in faults) for faults in found.values())
        by_report = sum(any(not each.startswith("parse") for each in faults) for faults in found.values())
        sums.update(sessions=len(found), report=len(found) - by_report, parse=len(found) - by_parse)
        print(f"{kind:<16} report {len(found) - by_report:>4}, parse {len(found) - by_parse:>4} of {len(found)}")
        if given.misses:
            print("".join(f"    {seed}: {'; '.join(each)}\n" for seed, each in found.items() if each), end="")
    print(f"report {sums['report']}, parse {sums['parse']} of {sums['sessions']} sessions")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
