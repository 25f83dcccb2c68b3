"""The public interface as a notebook uses it: frames, directions, pairs and decoded values of a whole capture.

    python -m workers.columns CAPTURE [--only frames|transactions|findings]

`frames` stops after frames with direction, `transactions` after pairs; `findings` diagnoses in place of decoding.
"""

from __future__ import annotations

import sys

import analyzer


def main(path: str, only: str = "") -> int:
    if only == "findings":
        from analyzer.core import analyse
        from captures import open as open_capture

        print(sum(len(part.findings) for part in analyse(open_capture(path))))
        return 0
    from analyzer.tables.columns import decode
    from analyzer.tables.transactions import Transactions

    transactions = Transactions()
    rows = pairs = values = 0
    for batch in analyzer.open(path).batches():
        rows += len(batch)
        if only != "frames":
            pairs += len(transactions.feed(batch))
        if not only:
            values += len(decode(batch).values)
    pairs += len(transactions.close())
    print(rows, pairs, values)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], *sys.argv[3:]))
