"""A capture on its way to the deframer, with somebody looking on: an export that keeps the raw chunks, Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from captures.chunks import Block, Capture
from captures.line import LineSettings


def passing(
    capture: Capture, *, look: Callable[[Block], None] | None = None, stop: Callable[[], bool] | None = None
) -> Capture:
    """The same capture, each block shown to `look` before it is used; it ends early once `stop` says True.

    What is damaged in it is found at `capture.damage`, not at the result's.
    """
    return Capture(_Passing(capture, look, stop), path=capture.path, format=capture.format)


@dataclass(frozen=True, slots=True)
class _Passing:
    """The source of such a capture."""

    capture: Capture
    look: Callable[[Block], None] | None
    stop: Callable[[], bool] | None

    @property
    def line(self) -> LineSettings:
        return self.capture.line

    @property
    def timed(self) -> bool:
        return self.capture.timed

    def blocks(self, max_bytes: int, note: Callable[[str, str], None]) -> Iterator[Block]:  # noqa: ARG002
        for block in self.capture.blocks(max_bytes):
            if self.stop is not None and self.stop():
                return
            if self.look is not None:
                self.look(block)
            yield block
