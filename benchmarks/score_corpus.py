"""Scores the deframer against captures whose truth is known.

    python benchmarks/score_corpus.py [CAPTURE.jsonl ...]

A capture NAME.jsonl has its truth beside it in NAME.truth.jsonl. Without arguments: the shared corpus where it is
beside the project, else captures that the simulator makes (every wire, every tap, three seeds). A line a capture:
frames, missed, false, F1, direction, pairing; then the worst of all.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import captures
from analyzer.core import deframe
from analyzer.tables.schema import Kind

SHARED = Path(__file__).resolve().parents[2] / "shared" / "corpus"


@dataclass(frozen=True, slots=True)
class Score:
    """How well one capture was read; direction and pairing are None where the truth does not say."""

    frames: int
    missed: int
    false: int
    f1: float
    direction: float | None
    pairing: float | None


def predictions(path: Path) -> list[dict[str, object]]:
    """A prediction a frame, as the corpus's scorer takes them."""
    lines = []
    for batch in deframe(captures.open(path)):
        for row in batch.rows[batch.rows.kind != Kind.NOISE]:
            lines.append(
                {
                    "start": row.start,
                    "length": row.length,
                    "direction": Kind(row.kind).name.lower(),
                    "crc_ok": row.check,
                    "request_start": None if row.request < 0 else row.request_start,
                }
            )
    return lines


def score(truth: list[dict[str, object]], found: list[dict[str, object]]) -> Score:
    """Frames count where start and length are right; damaged ones, reported as such, do not count at all."""
    good = {(f["start"], f["length"]): f for f in truth if f["intact"]}
    start_of = {f["id"]: f["start"] for f in good.values()}
    whole = [p for p in found if p["crc_ok"]]
    hits = [(p, good[key]) for p in whole if (key := (p["start"], p["length"])) in good]
    told = [(p, f) for p, f in hits if "dir" in f]
    paired = [(p, f) for p, f in told if f["dir"] == "response" and f.get("pair") in start_of]
    total = len(good) + len(whole)
    return Score(
        len(good),
        len(good) - len(hits),
        len(whole) - len(hits),
        2 * len(hits) / total if total else 1.0,
        sum(p["direction"] == f["dir"] for p, f in told) / len(told) if told else None,
        sum(p["request_start"] == start_of[f["pair"]] for p, f in paired) / len(paired) if paired else None,
    )


def load(path: Path) -> list[dict[str, object]]:
    """The frames of a truth file."""
    lines = [json.loads(line) for line in path.read_text().splitlines() if line.strip()]
    return [line for line in lines if "finding" not in line]


def truth_beside(path: Path) -> Path:
    """The truth of a capture."""
    return path.with_suffix(".truth.jsonl")


def captures_to_score(given: list[Path]) -> Iterator[Path]:
    if given:
        yield from given
    elif SHARED.is_dir():
        yield from (p for p in sorted(SHARED.glob("*/*.jsonl")) if truth_beside(p).is_file())
    else:
        from analyzer.simulation import TAPS, WIRES, Scenario, write

        with tempfile.TemporaryDirectory() as folder:
            for wire in WIRES:
                for tap in TAPS:
                    for seed in range(3):
                        path = Path(folder) / f"{wire}-{tap}-{seed}.jsonl"
                        write(Scenario(wire, tap, seed=seed), path)
                        yield path


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", nargs="*", type=Path, metavar="CAPTURE.jsonl")
    given = parser.parse_args(arguments).captures
    for path in given:
        for needed in (path, truth_beside(path)):
            if not needed.is_file():
                parser.error(f"{needed}: no such file")
    scores = []
    titles = f"{'frames':>6} {'missed':>6} {'false':>6} {'F1':>8} {'direction':>9} {'pairing':>9} {'s':>6}"
    print(f"{'capture':<44} {titles}")
    for path in captures_to_score(given):
        begin = time.perf_counter()
        found = predictions(path)
        seconds = time.perf_counter() - begin
        result = score(load(truth_beside(path)), found)
        scores.append(result)
        rates = " ".join(f"{'-' if v is None else format(v, '.4f'):>9}" for v in (result.direction, result.pairing))
        counts = f"{result.frames:6} {result.missed:6} {result.false:6}"
        print(f"{path.stem:<44} {counts} {result.f1:8.5f} {rates} {seconds:6.2f}")
    if scores:
        print(f"{len(scores)} captures, lowest F1 {min(s.f1 for s in scores):.5f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
