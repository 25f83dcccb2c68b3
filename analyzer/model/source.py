"""Where a view's rows come from: a file, a live tap, a replay. The model does not know which.

A source is asked once for its steps, in a thread of its own; it ends when it has no more, or soon after `stop` says
True. One that is `live` may go on for days: its iterator gives rows as soon as there are some, and may give empty steps
to look at `stop` meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from ..languages import tr
from ..options import Options
from ..outages import Deaf, deaf_times, notes_of

if TYPE_CHECKING:
    from captures import Capture, LineSettings

    from ..core import Analysed


class Grave(str):
    """A notice of something that is lost or broken, not only worth knowing."""

    __slots__ = ()


class ViewSource(Protocol):
    """What `analyzer.tui.run` shows."""

    @property
    def name(self) -> str:
        """What the title says: a file's name, a port."""

    @property
    def line(self) -> LineSettings:
        """Line settings, as far as they are known."""

    @property
    def timed(self) -> bool:
        """Whether times mean anything."""

    @property
    def live(self) -> bool:
        """Whether the view follows the newest row from the start."""

    @property
    def path(self) -> Path | None:
        """The file, which bookmarks are kept beside; None where there is none."""

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
        """Rows in wire order as they come, and what is said of them when it is (`core.Analyzer.latest`).

        Raises what the command line would print in one line.
        """
        ...

    def notices(self) -> Sequence[str]:
        """What the user should know by now: damage of the file, bytes dropped. Each in a line; asked for repeatedly."""
        ...


_FIRST = 1 << 14  # bytes: a first screen is there at once
_LISTED: Final = 2  # times in which a recording heard nothing; the timeline and the report have all


class CaptureSource:
    """A capture, read from its beginning."""

    live = False

    def __init__(self, capture: Capture, name: str, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self.capture = capture
        self.name = name
        self.options = options

    @property
    def line(self) -> LineSettings:
        return self.capture.line

    @property
    def timed(self) -> bool:
        return self.capture.timed

    @property
    def path(self) -> Path | None:
        return self.capture.path

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
        from ..core import as_it_comes, observed

        options = replace(self.options, explain=True)
        return as_it_comes(observed(self.capture, stop=stop), options, outages=self.deaf, first=_FIRST)

    @cached_property
    def deaf(self) -> Sequence[Deaf]:
        """Times in which a recording heard nothing. They are read from the file: not for the thread that draws."""
        return deaf_times(notes_of(self.capture))

    def notices(self) -> Sequence[str]:
        return [*self.capture.notices, *self._unheard(), *self._damage()]

    def _unheard(self) -> Sequence[str]:
        if "deaf" not in self.__dict__ or not self.deaf:  # not read yet, or none
            return ()
        from ..outages import unheard

        lines = [Grave(unheard(time)) for time in self.deaf[:_LISTED]]
        more = len(self.deaf) - len(lines)
        return [*lines, Grave(f"and {more:,} more such times")] if more else lines

    def _damage(self) -> Sequence[str]:
        lines = [Grave(loss) for loss in self.capture.damage[:5]]
        more = self.capture.damage_count - len(lines)
        return [*lines, Grave(f"and {more:,} more such places")] if more > 0 and lines else lines


class Nothing:
    """No capture at all: only the paste prompt, with what was pasted already."""

    timed = False
    live = False
    path = None

    def __init__(self, pasted: str = "") -> None:
        self.pasted = pasted

    @property
    def name(self) -> str:
        return tr("no capture")

    @property
    def line(self) -> LineSettings:
        from captures import LineSettings

        return LineSettings()

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:  # noqa: ARG002 - the protocol's signature
        return iter(())

    def notices(self) -> Sequence[str]:
        return ()
