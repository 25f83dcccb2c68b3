"""Faults that a twin shows when it is asked to: each as a device or a line has it, and as this program then names it.

A fault is an entry of `FAULTS`: what its value means, and what becomes of the answer. How often it comes stands behind
it: `silence`, `delay=250@10%`, `17:exception=6@1/5`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Final

from dissectors.limits import EXCEPTION, LAST_UNIT

from ..errors import RtuscopeError
from .memory import TwinAnswer

_MS: Final = 1_000_000
_DIGITS: Final = 6  # of a number
_RAREST: Final = 999_999


class FaultError(RtuscopeError):
    """A fault that there is not, in one line."""


@dataclass(frozen=True, slots=True)
class FaultKind:
    """What a fault does. `usual`, `least`, `most`: its value, in `measure`; `of_a_line`: only where frames have a CRC.

    `instead` gives the answer in place of the unit's, which then has not done what was asked; `done` changes the answer
    to what was done, None: it is lost.
    """

    words: str
    usual: int = 0
    least: int = 0
    most: int = 0
    measure: str = ""
    of_a_line: bool = False
    instead: Callable[[bytes, int], bytes] | None = None
    done: Callable[[TwinAnswer, int, Random], TwinAnswer | None] | None = None


def _flipped(adu: bytes, random: Random) -> bytes:
    bit = random.randrange(8, 8 * len(adu))  # not of the unit: the frame stays this one's
    return bytes(octet ^ (1 << bit % 8 if at == bit // 8 else 0) for at, octet in enumerate(adu))


def _other_unit(answer: TwinAnswer, value: int, _: Random) -> TwinAnswer:
    return replace(answer, as_unit=value)


FAULTS: Final[dict[str, FaultKind]] = {
    "silence": FaultKind("the answer is lost; what was asked is done", done=lambda *_: None),
    "delay": FaultKind(
        "the answer comes so much later",
        1000, 1, 600_000, "ms",
        done=lambda answer, ms, _: replace(answer, delay_ns=answer.delay_ns + ms * _MS),
    ),
    "exception": FaultKind(
        "the unit refuses by this exception code, and does nothing",
        4, 1, 255, "code",
        instead=lambda request, code: bytes((request[0] | EXCEPTION, code)),
    ),
    "wrong-unit": FaultKind("the answer is in the name of this unit", 1, 0, LAST_UNIT, "unit", done=_other_unit),
    "duplicate": FaultKind(
        "the answer comes twice", done=lambda answer, *_: replace(answer, spoil=lambda adu: adu + adu)
    ),
    "corruption": FaultKind(
        "a bit of the answer is another",
        of_a_line=True,
        done=lambda answer, _, random: replace(answer, spoil=lambda adu: _flipped(adu, random)),
    ),
    "truncation": FaultKind(
        "so many bytes are missing at the end",
        2, 1, 255, "bytes",
        of_a_line=True,
        done=lambda answer, count, _: replace(answer, spoil=lambda adu: adu[: max(len(adu) - count, 1)]),
    ),
    "stray": FaultKind(
        "so many bytes 00 stand behind the answer, as a driver makes that lets go late",
        1, 1, 255, "bytes",
        of_a_line=True,
        done=lambda answer, count, _: replace(answer, spoil=lambda adu: adu + bytes(count)),
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault as it was asked for: of one unit, or of all (None); each `every`th answer, or by `chance` (0 to 1)."""

    name: str
    value: int
    unit: int | None = None
    every: int = 1
    chance: float | None = None

    @property
    def kind(self) -> FaultKind:
        return FAULTS[self.name]


def fault_of(text: str) -> Fault:
    """`[UNIT:]NAME[=VALUE][@SHARE]`. FaultError says what of it there is not."""
    unit, _, rest = text.rpartition(":")
    named, _, share = rest.partition("@")
    name, _, value = named.partition("=")
    if name not in FAULTS:
        raise FaultError(f"no fault {name!r}: there are {', '.join(FAULTS)}")
    kind = FAULTS[name]
    every, chance = _share(share or "1/1")
    number = _number(value or str(kind.usual), kind.least, kind.most, name)
    return Fault(name, number, _number(unit, 0, LAST_UNIT, "unit") if unit else None, every, chance)


def _number(text: str, least: int, most: int, what: str) -> int:
    fits = text.isascii() and text.isdecimal() and len(text) <= _DIGITS and least <= int(text) <= most
    if not fits:
        raise FaultError(f"{what} takes {least} to {most}, not {text}")
    return int(text)


def _share(text: str) -> tuple[int, float | None]:
    """Each so manyth, or by what chance."""
    if text.startswith("1/"):
        return _number(text[2:], 1, _RAREST, "1/N"), None
    percent = text.removesuffix("%").replace(".", "", 1)
    known = text.endswith("%") and percent.isdecimal() and percent.isascii()
    share = float(text[:-1]) / 100 if known else 0.0
    if not 0 < share <= 1:
        raise FaultError(f"share {text}: a percentage up to 100%, or 1/N")
    return 1, share


class FaultyAnswers:
    """Which answers go wrong, and how; of several faults that are due the first one comes. `shown` counts them."""

    def __init__(self, faults: Sequence[Fault], random: Random | None = None) -> None:
        self._faults, self._random = faults, random or Random()
        self._turns = Counter[Fault]()
        self.shown = Counter[str]()

    def due(self, unit: int) -> Fault | None:
        """The fault of the next answer of a unit; None: it is well."""
        mine = [fault for fault in self._faults if fault.unit in (None, unit)]
        self._turns.update(mine)
        found = next(filter(self._comes, mine), None)
        self.shown.update([] if found is None else [found.name])
        return found

    def _comes(self, fault: Fault) -> bool:
        turn = self._turns[fault]
        return turn % fault.every == 0 if fault.chance is None else self._random.random() < fault.chance

    def spoilt(self, fault: Fault, answer: TwinAnswer) -> TwinAnswer | None:
        """The answer with the fault; None: there is none."""
        done = fault.kind.done
        return answer if done is None else done(answer, fault.value, self._random)
