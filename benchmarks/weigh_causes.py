"""Lists what every judge of causes makes of a capture, the heaviest first: why one is told and another is not.

    python benchmarks/weigh_causes.py FILE [--most N]

A line is a suspicion: its bits, its cause, the units, and what it would explain. The first is told; what it explains is
taken from the others, and they are weighed anew.
"""

from __future__ import annotations

import argparse
import sys

from analyzer.causes.evidence import Evidence
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import weigh
from analyzer.core import analyse
from captures import open as open_capture


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("file", metavar="FILE", help="a capture")
    parser.add_argument("--most", type=int, default=12, metavar="N", help="suspicions to list (12)")
    options = parser.parse_args(arguments)
    capture = open_capture(options.file)
    parts = ((part.batch, part.transactions) for part in analyse(capture))
    evidence = Evidence(ledger_of(parts, capture.line))
    suspicions = weigh(evidence)
    if not suspicions:
        verdict = evidence.verdict
        print(f"no judge suspects anything; times may be wrong by {verdict.wait_ns:.3g} ns, fine: {verdict.fine}")
    for weighed in suspicions[: options.most]:
        found = weighed.suspicion
        explains = ", ".join(sorted(f"{symptom.value} of {unit or 'the bus'}" for symptom, unit in found.explains))
        print(f"{found.bits:9.1f} bits  {weighed.suspect.cause:24} units {found.units}  {explains}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
