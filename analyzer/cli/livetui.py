"""`--tui` of what shows a live line: what goes with it, and the interface on a session."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from .commands import UsageError
from .inputs import chosen_charts
from .terminal import endable

if TYPE_CHECKING:
    from captures.recording.recorder import Recorder

    from ..live.session import Session


def check_interface(arguments: argparse.Namespace) -> None:
    """UsageError where --tui is given and there is no terminal, or beside it what only lines know: left out of account,
    a --duration would be a recording that is not what was asked for."""
    if not arguments.tui:
        return
    from .open import needs_a_terminal

    chosen = {
        "--format": arguments.view_format not in (None, "text"),
        "--until": arguments.until is not None,
        "--count": arguments.count < sys.maxsize,
        "--fields": bool(arguments.fields),
        "--duration": arguments.duration is not None,
        "--filter": arguments.filter is not None,
        "--infer": arguments.infer,
        "--noise": arguments.noise,
    }
    for name, given in chosen.items():
        if given:
            raise UsageError(f"{name} is for output by line and does not work with --tui: leave one of them out")
    needs_a_terminal("--tui", "leave it out")


@endable()  # by a signal before the interface heeds them
def show_interface(
    arguments: argparse.Namespace,
    session: Session,
    name: str,
    recorder: Recorder | None = None,
    fire: Callable[[int], None] | None = None,
) -> int:
    """A session in the terminal interface, watched for what --trigger says; `fire` is told the time of each.

    Where a defect ends it, what is recorded by then is told with that.
    """
    from ..filters import FilterError
    from ..live.conditions import LiveTrigger
    from ..tui.live import LiveSource, show_live
    from ..tui.viewer import InterfaceError

    charts = chosen_charts(arguments)
    watched_for = partial(LiveTrigger, rest_ns=int(arguments.after * 1e9), hit=fire or bool)
    source = LiveSource(session, name, recorder, watched_for)
    try:
        source.watch(arguments.trigger or "", charts)
    except FilterError as error:
        raise UsageError(f"--trigger: {error}") from error
    try:
        return show_live(source, charts)
    except InterfaceError as error:
        if recorder is None:
            raise
        raise InterfaceError(f"{error}; the recording ended with it: {recorder.result}") from error
