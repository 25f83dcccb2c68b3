"""The values of frames whose registers have no fixed place, without the words of an annotation.

A list of counted groups leaves its registers where its counts put them, so each frame is read by its declaration; what
is said of every part of it is left out, which is most of the work. Values are those that annotation gives, of a cut
frame too.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any, Final, cast

import construct

from .blocks import Bits, Registers
from .declaration import AnyConstruct, AnySubconstruct, Short
from .length_rules import field_names, rebuilt

_FOUND: Final = "found"
_TRIALS: Final = (construct.GreedyRange, construct.Select, construct.Peek)  # what they read may be taken back

Lister = Callable[[bytes], list[int]]


@lru_cache(maxsize=256)
def lister(declaration: AnyConstruct) -> Lister | None:
    """What gives the registers in the bytes behind a function code, in wire order; None where only annotation can."""
    names: set[str] = set()
    plain = True

    def listing(part: AnyConstruct) -> AnyConstruct | None:
        nonlocal plain
        plain = plain and not isinstance(part, (*_TRIALS, Bits))
        if not isinstance(part, Registers):
            return None
        names.add(part.each)
        return _Listed(part)

    listed = rebuilt(declaration, listing)
    if not plain or names.intersection(field_names(declaration)):
        return None

    def values(data: bytes) -> list[int]:
        found: list[int] = []
        with suppress(Exception):  # of a frame that is cut, of any kind by a user's declaration: what was read counts
            listed.parse_stream(io.BytesIO(data), **{_FOUND: found})
        return found

    return values


class _Listed(AnySubconstruct):
    """Registers that are noted as they are read."""

    def _parse(self, stream: Any, context: Any, path: str) -> Any:
        found: list[int] = context["_params"][_FOUND]
        try:
            value: list[int] = self.subcon._parsereport(stream, context, path)
        except Short as short:
            found += cast(Sequence[int], short.value or ())
            raise
        found += value
        return value
