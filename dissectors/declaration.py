"""A function of the protocol as one declaration: what its request and its response hold, and how people say it.

Everything else follows from it: predicted lengths, plausibility, what a response must repeat, annotation, summaries.
`request` and `response` are constructs of the data after the function code; parts from `dissectors.parts` and
`dissectors.blocks` carry limits and words, any other construct works too. A vendor's function is declared the same
way, in a file or a package of the user's own:

    from construct import Float32b, Struct
    from dissectors import Function, Number

    TREND = Function(
        0x41, "Read Trend", request=Struct("channel" / Number(1)), response=Struct("level" / Float32b),
        request_words="read the trend of channel {channel}",
    )
"""

from __future__ import annotations

from dataclasses import dataclass
from string import Formatter
from typing import Final

import construct

from .parts import AnyConstruct
from .values import Area

USER_DEFINED: Final = frozenset((*range(65, 73), *range(100, 111)))  # [1] 5
RESERVED: Final = frozenset((9, 10, 13, 14, 41, 42, 90, 91, 125, 126, 127))  # [1] annex A


class DeclarationError(Exception):
    """A declaration that cannot be used; the message names it (file and line, where it has them) and says why."""


@dataclass(frozen=True)
class Function:
    """The declaration of one function code.

    `clause` is where the specification has it, `area` the data that it works on. `echoes` names request fields that a
    response repeats. The words are templates of a summary: `{quantity:coil}` is `1 coil` or `3 coils`, `{name}` the
    field's short text. Of several templates the first that has all its fields is used.
    """

    code: int
    name: str
    request: AnyConstruct
    response: AnyConstruct
    clause: str = ""
    area: Area | None = None
    echoes: tuple[str, ...] = ()
    request_words: str | tuple[str, ...] = ()
    response_words: str | tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.code, int) or not 1 <= self.code <= 127:
            raise DeclarationError(f"function {self.name!r}: the code is {self.code!r}, codes are 1 to 127")
        for side in ("request", "response"):
            if not isinstance(getattr(self, side), construct.Construct):
                raise DeclarationError(f"function {self.code} {self.name!r}: the {side} is not a construct")
            try:
                for template in self.words(side):
                    list(Formatter().parse(template))
            except ValueError as error:
                raise DeclarationError(f"function {self.code} {self.name!r}: {side}_words: {error}") from error

    def words(self, side: str) -> tuple[str, ...]:
        """The templates of a side, `request` or `response`."""
        words = self.request_words if side == "request" else self.response_words
        return (words,) if isinstance(words, str) else words


def class_of(code: int) -> str:
    """The class of a function code that is not declared: user-defined, reserved, unassigned or invalid ([1] 5)."""
    if not 1 <= code <= 127:
        return "invalid"
    if code in USER_DEFINED:
        return "user-defined"
    return "reserved" if code in RESERVED else "unassigned"
