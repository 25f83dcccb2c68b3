"""Stretches of bytes that overlap, which numpy has as items of a type `V<n>`."""

from __future__ import annotations

from typing import Any


class ByteWindows:
    """All stretches of so many bytes of an array, which `captures.ragged` moves about."""

    def __init__(self, data: Any, width: int) -> None:
        self._memory, self._width = data.memory, width

    def __getitem__(self, begins: Any) -> list[bytes]:
        return [self._memory[at : at + self._width].tobytes() for at in begins.memory.tolist()]

    def __setitem__(self, begins: Any, stretches: list[bytes]) -> None:
        for at, stretch in zip(begins.memory.tolist(), stretches, strict=True):
            self._memory[at : at + self._width] = stretch
