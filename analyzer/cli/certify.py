"""`rtuscope certify`: acceptance of a line."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .commands import DONE, FAILED, INTERRUPTED, NO_FRAME
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .terminal import Progress, add_overwrite_argument, interruptible, put_json, tell, to_be_overwritten

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
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="the same claims as JSON")
    shape.add_argument("--html", metavar="FILE", help="write one HTML page that prints to A4, with room for signatures")
    add_overwrite_argument(parser, "FILE")
    parser.add_argument(
        "--limits", metavar="FILE", help="a TOML file of limits in place of the defaults (rtuscope help certificate)"
    )
    parser.add_argument("--check", action="store_true", help="exit status 1 unless the verdict is pass")
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    from ..reports.certificate import default_limits, load_limits, markdown

    load_functions(arguments)
    limits = default_limits() if arguments.limits is None else load_limits(arguments.limits)
    capture = open_capture(arguments)
    if arguments.html is not None:
        to_be_overwritten(arguments.html, overwrite=arguments.overwrite, source=capture.path)
        certificate = _write_page(arguments, capture, limits)
    else:
        certificate = _certified(arguments, capture, limits)
        if arguments.json:
            put_json(certificate.to_json(), indent=2)
        else:
            sys.stdout.write(markdown(certificate))
    tell_damage(arguments.capture, capture)
    return _status(certificate, check=arguments.check)


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


def _write_page(arguments: argparse.Namespace, capture: Capture, limits: AcceptanceLimits) -> Certificate:
    from ..exports.sink import output
    from ..reports.certificate import html

    with output(arguments.html, source=capture.path) as file:  # an unusable name is told before the work
        certificate = _certified(arguments, capture, limits)
        file.write(html(certificate).encode())
    if certificate.report.partial:
        tell("stopped by Ctrl-C; the page covers what was read until then")
    return certificate


def _status(certificate: Certificate, *, check: bool) -> int:
    if certificate.report.partial:
        return INTERRUPTED
    if not certificate.report.frames:
        tell(f"{certificate.report.source}: no Modbus frame found")
        return NO_FRAME
    return FAILED if check and certificate.verdict != "pass" else DONE
