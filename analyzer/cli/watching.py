"""A session shown on a terminal or written to a pipe: what `sniff` and `replay` have in common."""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Protocol

from ..terminal_text import terminal_text
from .amounts import seconds
from .commands import DONE, NO_FRAME, UsageError
from .inputs import add_columns_arguments, add_map_argument, chosen_charts
from .terminal import coloured, hung_up, places, put, put_bytes, put_data, say_in_place, tell_user, told_to_end

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps
    from dissectors.maps.model import RegisterMap

    from ..causes.reasoning import CauseRevision
    from ..live.conditions import Condition
    from ..live.lines import ShownRow
    from ..live.session import Session, SessionStep
    from ..registers.watch import RevisedRegisters, Revision
    from ..tables.findings import Finding

_PERIOD_S: Final = 0.25
_COUNTS: Final = 2  # of a duration: from the start, and from the first thing that came
_GRACE_S: Final = 1.2  # from a signal to end to the end
_SILENT: Final = frozenset({"settings"})  # events that are not told
_GOES_WELL: Final = _SILENT | {"opened", "settled", "seeking", "trying"}  # not where each line is shown as an error


def add_view_arguments(parser: argparse.ArgumentParser, *, format_flag: bool = False) -> None:
    """What is shown, and when to stop. `format_flag`: --format is what the view writes, not what a capture is."""
    view = parser.add_argument_group("the view")
    if format_flag:
        view.add_argument(
            "--format",
            dest="view_format",
            choices=("text", "jsonl", "influx", "pcapng"),
            help="format of standard output: text, or for other programs (wireshark -k -i - reads pcapng)",
        )
    view.add_argument(
        "--json",
        dest="view_format",
        action="store_const",
        const="jsonl",
        help="one JSON object per line, as rtuscope export writes them",
    )
    view.add_argument(
        "--influx", dest="view_format", action="store_const", const="influx", help="InfluxDB's line protocol"
    )
    view.add_argument("--noise", action="store_true", help="with --json and pcapng: also bytes outside frames")
    view.add_argument("-Y", "--filter", metavar="FILTER", help="show only matching frames, such as 'unit == 17'")
    add_columns_arguments(view, "shown")
    add_duration_argument(view)
    view.add_argument("--until", metavar="FILTER", help="stop after a matching frame: 'finding == \"no-response\"'")
    view.add_argument(
        "--trigger", metavar="FILTER", help="show (and record) only what is around matching frames; see --before"
    )
    view.add_argument("--before", type=seconds, default=10.0, metavar="TIME", help="time before a trigger (10s)")
    view.add_argument("--after", type=seconds, default=10.0, metavar="TIME", help="time after a trigger (10s)")
    add_map_argument(view)
    view.add_argument(
        "--infer", action="store_true", help="infer register types as data arrives, and show values accordingly"
    )
    view.add_argument("--tui", action="store_true", help="show it in the terminal interface")


class _ViewLines(Protocol):
    """What makes lines, or packets, of rows."""

    def of(self, shown: ShownRow) -> Any: ...

    def bus(self, finding: Finding) -> Any: ...

    def use_charts(self, charts: Mapping[int, RegisterMap]) -> None: ...

    def register(self, revision: Revision) -> Any: ...


class Watch:
    """Shows steps as they come. `stop` ends the session."""

    def __init__(
        self,
        arguments: argparse.Namespace,
        session: Session,
        *,
        extra: Callable[[], str] = str,
        fire: Callable[[int], None] | None = None,
        out: BinaryIO | None = None,
    ) -> None:
        """`extra`: more words for the status line; `fire` is told the time of each trigger; `out` takes what is shown
        in place of standard output (Wireshark's pipe, which calls all that is told beside it an error)."""
        from ..causes.reasoning import RunningStory
        from ..live.conditions import TriggerWindow
        from ..live.lines import Recent
        from ..live.status import LineStatus

        self._arguments, self._session, self._extra, self._fire = arguments, session, extra, fire
        charts = chosen_charts(arguments)
        self._lines = _view(arguments, session, charts)
        self._out = out
        self._registers: RevisedRegisters | None = None
        if arguments.infer:
            from ..registers.watch import RevisedRegisters

            self._registers = RevisedRegisters(charts)
        self.status = LineStatus(session.line)
        self._recent = Recent()
        self._tell_cause: Callable[[CauseRevision], Any] | None = getattr(self._lines, "cause", None)
        self._tell_begin: Callable[[int], None] = getattr(self._lines, "begins", lambda _: None)
        self._story = RunningStory(session.line, aside=not session.waits)
        self._filter, self._until = _condition(arguments, "filter", charts), _condition(arguments, "until", charts)
        self._trigger = _condition(arguments, "trigger", charts)
        self._window: TriggerWindow[Any] = TriggerWindow(int(arguments.before * 1e9), int(arguments.after * 1e9))
        self._shown = 0
        self._over = False
        self._status_shown = places(sys.stderr)
        self._next_status = 0.0
        self._words = ""  # of the status line

    def run(self, begun: Callable[[], None]) -> int:
        """Show the session to its end, `begun` with its first step; the exit status."""
        from ..live.lines import of_the_bus
        from ..live.streams import LivePackets

        if isinstance(self._lines, LivePackets):
            self._write([self._lines.begin()])
        silent = _SILENT if self._out is None else _GOES_WELL
        for step in self._session.steps():
            begun()
            if self._over:
                continue  # what the session still gives while it ends
            self.status.line = self._session.line
            self.status.feed(step)
            for event in step.events:
                if event.kind not in silent and event.text:
                    tell_user(event.text)
            self._begin(step)
            out: list[Any] = []
            for shown in self._recent.feed(step):
                out += self._row(shown, step)
                if self._over:
                    break
            out += [self._lines.bus(finding) for finding in of_the_bus(step)]
            if self._tell_cause is not None and not self._over:
                causes = self._story.feed(step.batch, step.analysed.transactions, self._session.line)
                out += map(self._tell_cause, causes)
            out += self._revised(step)
            self._write(out)
        if self._tell_cause is not None and not self._over:  # who ends it by a condition has what he waited for
            self._write([*map(self._tell_cause, self._story.close())])
        self._clear()
        if self._status_shown:
            print("  ".join(self.status.parts(self._extra())), file=sys.stderr)
        if self.status.frames:
            return DONE
        if self._out is None:
            tell_user(
                f"no Modbus frame in {self.status.bytes:,} bytes received"
                if self.status.bytes
                else "nothing was received"
            )
        return NO_FRAME

    def _begin(self, step: SessionStep) -> None:
        """The lines are told when rows begin, shown or not."""
        if len(step.batch):
            self._tell_begin(int(step.batch.rows.t_start_ns[0]))

    def _revised(self, step: SessionStep) -> list[Any]:
        """What registers mean, where that is told for the first time or otherwise; frames are read so from here on."""
        revisions = self._registers.feed(step.batch) if self._registers is not None else []
        if not revisions or self._registers is None:
            return []
        self._lines.use_charts(self._registers.charts)
        return [line for revision in revisions if (line := self._lines.register(revision))]

    def _row(self, shown: ShownRow, step: SessionStep) -> list[Any]:
        """What is shown of a row, if it is to be shown; with it, perhaps, what was before a trigger."""
        line = self._session.line
        wanted = self._filter is None or self._filter.holds(shown, step, line)
        parts = [part for part in ([self._lines.of(shown)] if wanted else []) if part]
        if self._trigger is not None:
            parts = self._triggered(parts, shown, fired=self._trigger.holds(shown, step, line))
        if self._until is not None and self._until.holds(shown, step, line):
            self._end()
        self._shown += bool(parts) and not shown.late and shown.values.index >= 0
        if self._shown >= self._arguments.count:
            self._end()
        return parts

    def _triggered(self, parts: list[Any], shown: ShownRow, *, fired: bool) -> list[Any]:
        t_ns = shown.values.t_end_ns
        before = self._window.fire(t_ns) if fired else []
        if fired and self._fire is not None:
            self._fire(t_ns)
        for part in parts:
            before += self._window.offer(t_ns, part)
        return before

    def _end(self) -> None:
        self._over = True
        self._session.stop()

    def _write(self, parts: list[Any]) -> None:
        if parts:
            self._clear()
            self._put(parts)
        if self._status_shown:
            now = time.monotonic()
            if new := now >= self._next_status:
                self._next_status = now + _PERIOD_S
                self._words = self.status.fitted(self._extra(), shutil.get_terminal_size().columns - 1)
            if new or parts:
                say_in_place(self._words)

        if self._out is not None and hung_up(self._out):
            raise BrokenPipeError

    def _put(self, parts: list[Any]) -> None:
        if isinstance(parts[0], str):
            (put if self._arguments.view_format == "text" else put_data)(terminal_text(*parts))
        else:
            put_bytes(b"".join(parts), self._out or sys.stdout.buffer)

    def _clear(self) -> None:
        if self._status_shown:
            say_in_place("")


def _view(arguments: argparse.Namespace, session: Session, charts: UnitMaps) -> _ViewLines:
    """What makes of rows what is shown."""
    if arguments.fields:
        from ..live.chosenlines import ChosenLines

        if arguments.view_format not in (None, "text", "jsonl"):
            raise UsageError("--fields works with text and --json")
        return ChosenLines(arguments.fields, text=arguments.view_format != "jsonl", noise=arguments.noise)
    match arguments.view_format:
        case "jsonl":
            from ..live.lines import LiveJsonLines

            return LiveJsonLines(noise=arguments.noise, charts=charts)
        case "influx":
            from ..live.streams import InfluxLines

            return InfluxLines(charts=charts)
        case "pcapng":
            from ..live.streams import LivePackets

            return LivePackets(session, noise=arguments.noise)
    from ..live.lines import TextLines

    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    return TextLines(colour=coloured(sys.stdout), width=width, charts=charts)


def _condition(arguments: argparse.Namespace, name: str, charts: UnitMaps) -> Condition | None:
    text: str | None = getattr(arguments, name)
    if text is None:
        return None
    from ..filters import FilterError
    from ..live.conditions import Condition

    try:
        return Condition(text, charts)
    except FilterError as error:
        raise UsageError(f"--{name}: {error}") from error


def add_duration_argument(parser: argparse._ActionsContainer) -> None:
    """When to stop: what `ended_from_outside` takes."""
    parser.add_argument("--duration", type=seconds, metavar="TIME", help="stop after this time: 90s, 15min, 12h")


@contextmanager
def ended_from_outside(
    stop: Callable[[], None], duration_s: float | None = None, *, abandon: Callable[[], None] | None = None
) -> Iterator[Callable[[], None]]:
    """SIGINT, SIGTERM and SIGHUP call `stop`; a second SIGINT ends at once. So does the end of `duration_s`, by this
    machine's steady clock, whether anything comes or not; what is given is called when the first thing has come, from
    which on it counts.

    Where the end has not come 1.2 s after a signal, another thread calls `abandon`: output that nobody takes, or an
    analysis that is far behind, must not keep a process that was told to end.
    """
    requested, ended = threading.Event(), threading.Event()

    def handler(number: int, _frame: object) -> None:
        if requested.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop()
        requested.set()

    def watch() -> None:
        requested.wait()
        if not ended.wait(_GRACE_S) and abandon is not None:
            abandon()

    before = {}
    with suppress(ValueError):  # not the main thread: signals are another's business
        before = {number: signal.signal(number, handler) for number in (signal.SIGINT, *told_to_end())}
    threading.Thread(target=watch, daemon=True).start()
    timers: list[threading.Timer] = []

    def count() -> None:
        if duration_s is None or len(timers) == _COUNTS:
            return
        for timer in timers:
            timer.cancel()
        timers.append(threading.Timer(min(duration_s, threading.TIMEOUT_MAX), stop))
        timers[-1].daemon = True
        timers[-1].start()

    count()
    try:
        yield count
    finally:
        for timer in timers:
            timer.cancel()
        for number, old in before.items():
            signal.signal(number, old)
        ended.set()
        requested.set()
