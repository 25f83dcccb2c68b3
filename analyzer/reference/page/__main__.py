"""`python -m analyzer.reference.page OUT`: the page for the browser, as a folder to be served."""

from __future__ import annotations

import argparse
import sys

from .building import PageError, build


def main() -> int:
    """Build it; a line on standard error where that cannot be."""
    parser = argparse.ArgumentParser(prog="python -m analyzer.reference.page", description=__doc__)
    parser.add_argument("out", metavar="OUT", help="the folder to make; it must not be there yet")
    parser.add_argument(
        "--pyodide", metavar="FOLDER", help="npm's package pyodide, put beside the page (as OUT/pyodide)"
    )
    arguments = parser.parse_args()
    try:
        octets = build(arguments.out, arguments.pyodide)
    except PageError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2
    print(f"{arguments.out}: {octets / 1e6:.1f} MB, Pyodide apart")
    return 0


if __name__ == "__main__":
    sys.exit(main())
