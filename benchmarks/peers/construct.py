"""The construct library alone: a request and a response of the register reads, declared as its documentation would.

python -m peers.construct CORPUS [compiled]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from measuring import Job, python

from . import frames, missing
from . import version as installed

_READS = (3, 4)


def absent() -> str | None:
    return missing("construct")


def version() -> str:
    return installed("construct")


JOBS = [
    Job("columns", "construct, 03, 04 only", lambda corpus, _: python("peers.construct", corpus)),
    Job("columns", "construct compiled, 03, 04 only", lambda corpus, _: python("peers.construct", corpus, "compiled")),
]
ACCURACY: list[Any] = []


def main(corpus: Path, compiled: str = "") -> int:
    import construct as c

    request = c.Struct(
        "unit" / c.Byte, "function" / c.Byte, "address" / c.Int16ub, "quantity" / c.Int16ub, "crc" / c.Int16ul
    )
    response = c.Struct(
        "unit" / c.Byte, "function" / c.Byte, "count" / c.Byte, "registers" / c.Array(c.this.count // 2, c.Int16ub),
        "crc" / c.Int16ul,
    )  # fmt: skip
    readers = [declared.compile().parse if compiled else declared.parse for declared in (request, response)]
    for some in frames(corpus):
        for frame, is_response in some:
            if frame[1] in _READS:
                readers[is_response](frame)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *sys.argv[2:]))
