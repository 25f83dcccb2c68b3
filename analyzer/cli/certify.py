"""`rtuscope certify`: acceptance of a line."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .commands import DONE, FAILED
from .inputs import add_capture_arguments, add_limit_arguments, chosen_limits, load_functions, open_capture
from .onepage import add_page_arguments, put_out, status_of
from .terminal import Progress, interruptible

if TYPE_CHECKING:
    from captures import Capture

    from ..reports.certificate import AcceptanceLimits, Certificate

EXAMPLE = """\
rtuscope simulate bus.jsonl
rtuscope certify bus.jsonl
rtuscope certify bus.jsonl --html certificate.html
rtuscope certify bus.jsonl --json"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    add_page_arguments(
        parser,
        json="the same claims as JSON",
        html="write one HTML page that prints to A4, with room for signatures",
    )
    parser.add_argument(
        "--limits", metavar="FILE", help="a TOML file with limits instead of the defaults (rtuscope help certificate)"
    )
    parser.add_argument("--check", action="store_true", help="exit status 1 unless the verdict is pass")
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    from ..reports.certificate import default_limits, html, load_limits, markdown

    load_functions(arguments)
    limits = default_limits() if arguments.limits is None else load_limits(arguments.limits)
    capture = open_capture(arguments)
    certificate = put_out(
        arguments, capture, lambda: _certified(arguments, capture, limits), markdown=markdown, html=html
    )
    status = status_of(certificate)
    return FAILED if status == DONE and arguments.check and certificate.verdict != "pass" else status


def _certified(arguments: argparse.Namespace, capture: Capture, limits: AcceptanceLimits) -> Certificate:
    from ..reports.certificate import certify

    progress = Progress(f"certify {arguments.capture}")
    with interruptible() as stop:
        certificate = certify(
            capture,
            limits,
            source=str(arguments.capture),
            options=chosen_limits(arguments),
            progress=progress,
            stop=stop,
        )
    progress.clear()
    return certificate
