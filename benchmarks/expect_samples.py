"""Writes what is expected of each bundled sample beside it: NAME.expect.jsonl, a line a frame.

    python benchmarks/expect_samples.py

Run it after a change that is meant to read the samples differently, and read the difference before it is committed.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import analyzer
from captures import samples


def expected(path: Path) -> list[str]:
    """A line a frame: where it is, what it is, what it says."""
    lines = []
    for frame in analyzer.open(path).frames():
        line = frame.to_json(fields=False)
        kept = ("index", "start", "length", "direction", "unit", "function", "exception", "crc_ok", "request_start")
        lines.append(json.dumps({**{key: line[key] for key in kept}, "summary": frame.summary()}))
    return lines


def beside(path: Path) -> Path:
    """The file of expectations of a sample."""
    return path.with_name(f"{path.name.split('.')[0]}.expect.jsonl")


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for name in samples.names():
        path = samples.path(name)
        beside(path).write_text("\n".join(expected(path)) + "\n")
        print(f"{beside(path).name}: written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
