"""`rtuscope check`: rules asserted on a capture."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Final

from .app import DONE, FAILED, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .terminal import Progress, coloured, interruptible

if TYPE_CHECKING:
    from analyzer.checks import Check, Results
    from captures import Capture

EXAMPLE = """\
rtuscope simulate bus.jsonl
rtuscope check bus.jsonl
rtuscope check bus.jsonl --rule 'no crc errors' --rule 'every poll answered'
rtuscope check bus.jsonl --rule 'at least 100 frames' --junit results.xml"""
_DEFAULT: Final = "no findings of severity error"
_COLOURS: Final = {"PASS": "32", "WARN": "33", "FAIL": "31"}


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument(
        "--rule",
        metavar="RULE",
        action="append",
        default=[],
        help="a rule that must hold (--list says which there are); may be given again",
    )
    parser.add_argument(
        "--rules", metavar="FILE", action="append", default=[], help="a TOML file of rules (docs/check.md)"
    )
    parser.add_argument("--list", action=_List, nargs=0, help="say what rules there are, with examples, and exit")
    parser.add_argument("--junit", metavar="FILE", help="write the results as JUnit XML")
    parser.add_argument("--json", action="store_true", help="the results as JSON")
    add_limit_arguments(parser)


class _List(argparse.Action):
    """--list: needs no capture, as --help does not."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from analyzer.checks.forms import forms

        for form in forms():
            for example in form.examples:
                print(example)
            print(f"    {form.help}")
        parser.exit()


def run(arguments: argparse.Namespace) -> int:
    """Say what became of each rule."""
    from analyzer.checks import run as run_checks
    from analyzer.checks.junit import write

    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = open_capture(arguments)
    checks = _checks(arguments, capture)
    source = str(arguments.capture)
    progress = Progress(f"check {source}")
    with interruptible() as stop:
        results = run_checks(capture, checks, source=source, options=limits, progress=progress, stop=stop)
    progress.clear()
    tell_damage(source, capture)
    if arguments.junit is not None and not results.partial:
        write(results, arguments.junit, source=capture.path)
    if arguments.json:
        import json

        print(json.dumps(results.to_json(), indent=2))
    else:
        _show(results)
    if results.partial:
        print("rtuscope: stopped by Ctrl-C; what was seen until then was judged", file=sys.stderr)
        return INTERRUPTED
    if not results.frames:
        print(f"rtuscope: {source}: no Modbus frame found", file=sys.stderr)
        return NO_FRAME
    return DONE if results.passed else FAILED


def _checks(arguments: argparse.Namespace, capture: Capture) -> list[Check]:
    from analyzer.checks import CheckError, compile_check, load_rules

    checks = []
    for text in arguments.rule:
        try:
            checks.append(compile_check(text, capture.line))
        except CheckError as error:
            raise UsageError(f"--rule {text!r}: {error}") from error
    for path in arguments.rules:
        checks += load_rules(path, capture.line)
    if not checks:
        if not arguments.json:
            print(f"no rules given (--rule, --rules): {_DEFAULT!r} is asserted")
        checks.append(compile_check(_DEFAULT, capture.line))
    return checks


def _show(results: Results) -> None:
    from dissectors.text import harmless

    colour = coloured(sys.stdout)
    for outcome in results.outcomes:
        word = f"\x1b[{_COLOURS[outcome.word]}m{outcome.word}\x1b[0m" if colour else outcome.word
        rule = outcome.name if outcome.name == outcome.check else f"{outcome.name} ({outcome.check})"
        print(f"{word} {harmless(rule)}: {outcome.measured}")
        for place in outcome.places:
            print(f"     {place.words}")
