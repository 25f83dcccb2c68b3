"""`rtuscope check`: rules asserted on a capture."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Final

from dissectors.values import harmless

from ..languages import page_words
from ..terminal_text import painted, terminal_text
from .commands import DONE, FAILED, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    add_map_argument,
    chosen_charts,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .terminal import Progress, add_overwrite_argument, coloured, interruptible, put_json, tell_user, to_be_overwritten

if TYPE_CHECKING:
    from captures import Capture

    from ..checks import Check, Results

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
        help="a rule that must hold (see --list); repeatable",
    )
    parser.add_argument(
        "--rules", metavar="FILE", action="append", default=[], help="a TOML file of rules (rtuscope help checks)"
    )
    parser.add_argument("--list", action=_List, nargs=0, help="list the rules with examples, and exit")
    parser.add_argument("--junit", metavar="FILE", help="write the results as JUnit XML")
    add_overwrite_argument(parser, "the file of --junit")
    parser.add_argument("--json", action="store_true", help="the results as JSON")
    add_map_argument(parser)
    add_limit_arguments(parser)


class _List(argparse.Action):
    """--list: needs no capture, as --help does not."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from ..checks.model import forms
        from ..languages import retold

        for form in forms():
            for example in form.examples:
                print(example)
            print(f"    {retold(form.help, 'help')}")
        parser.exit()


def run(arguments: argparse.Namespace) -> int:
    """Say what became of each rule."""
    from ..checks import run as run_checks
    from ..checks.junit import write

    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = open_capture(arguments)
    if arguments.junit is not None:
        to_be_overwritten(arguments.junit, overwrite=arguments.overwrite, source=capture.path)
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
        put_json(results.to_json(), indent=2)
    else:
        _show(results)
    if results.partial:
        tell_user("interrupted; only the part read so far was checked")
        return INTERRUPTED
    if not results.frames:
        tell_user(f"{source}: no Modbus frame found")
        return NO_FRAME
    return DONE if results.passed else FAILED


def _checks(arguments: argparse.Namespace, capture: Capture) -> list[Check]:
    from ..checks import CheckError, compile_check, load_rules

    charts = chosen_charts(arguments)
    checks = []
    for text in arguments.rule:
        try:
            checks.append(compile_check(text, capture.line, charts=charts))
        except CheckError as error:
            raise UsageError(f"--rule {text!r}: {error}") from error
    for path in arguments.rules:
        checks += load_rules(path, capture.line, charts)
    if not checks:
        if not arguments.json:
            print(page_words("no rules given (--rule, --rules): checking {rule}", rule=repr(_DEFAULT)))
        checks.append(compile_check(_DEFAULT, capture.line))
    return checks


def _show(results: Results) -> None:
    colour = coloured(sys.stdout)
    for outcome in results.outcomes:
        rule = outcome.name if outcome.name == outcome.check else f"{outcome.name} ({outcome.check})"
        word = painted(outcome.word, _COLOURS[outcome.word] if colour else "")
        print(terminal_text(word, harmless(f" {rule}: {outcome.measured}")))
        for spot in outcome.places_told:
            print(harmless(f"     {spot}"))
