"""`rtuscope demo`: what this tool makes of the bundled sample capture."""

from __future__ import annotations

import argparse

from .report import show

SAMPLE = "troubled.jsonl"
EXAMPLE = "rtuscope demo"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--json", action="store_true", help="the same facts as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Report on the sample."""
    import captures
    from captures import samples

    return show(captures.open(samples.path(SAMPLE)), SAMPLE, as_json=arguments.json)
