"""Our reading of a corpus against its truth, as JSON: shares of frames, directions and pairs that are right.

python -m workers.accuracy CORPUS CAPTURE
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

import analyzer
from analyzer.tables.schema import Kind


def main(corpus: Path, name: str) -> int:
    truth = np.load(corpus / "truth.npz")
    starts = np.cumsum(truth["size"]) - truth["size"]
    rows = analyzer.open(corpus / name).rows()
    rows = rows[rows.kind != Kind.NOISE]
    at = np.minimum(np.searchsorted(starts, rows.start), len(starts) - 1)
    hit = (starts[at] == rows.start) & (truth["size"][at] == rows.length) & rows.check
    at, rows = at[hit], rows[hit]
    response, pair = truth["response"], truth["pair"]
    asked = response[at] & (rows.request_start == starts[pair[at]])
    print(
        json.dumps(
            {
                "frames": float(hit.sum() / len(starts)),
                "false": int((~hit).sum()),
                "direction": float(((rows.kind == Kind.RESPONSE) == response[at]).sum() / len(starts)),
                "pairs": float(asked.sum() / response.sum()),
            }
        )
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2]))
