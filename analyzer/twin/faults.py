"""Faults that a twin shows when it is asked to: each as a device or a line has it, and as this program then names it.

A fault is an entry of `FAULTS`: what its value means, and what becomes of the answer. How often it comes stands behind
it: `silence`, `delay=250@10%`, `17:exception=6@1/5`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Final

from dissectors.limits import EXCEPTION, LAST_UNIT

from ..errors import RtuscopeError
from .memory import TwinAnswer

_MS: Final = 1_000_000
_TEXT: Final = re.compile(r"(?:(\d{1,3}):)?([a-z-]+)(?:=(\d{1,6}))?(?:@(?:(\d{1,3}(?:\.\d{1,3})?)%|1/(\d{1,6})))?")


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
    found = _TEXT.fullmatch(text)
    if found is None:
        raise FaultError(f"{text!r} is no fault such as silence, delay=250@10% or 17:exception=6@1/5")
    unit, name, value, share, every = found.groups()
    if name not in FAULTS:
        raise FaultError(f"no fault {name!r}: there are {', '.join(FAULTS)}")
    kind = FAULTS[name]
    if value is not None and not kind.least <= int(value) <= kind.most:
        takes = f"takes {kind.least} to {kind.most} ({kind.measure})" if kind.measure else "takes no value"
        raise FaultError(f"{name} {takes}, not {value}")
    if unit is not None and int(unit) > LAST_UNIT:
        raise FaultError(f"{unit} is no unit from 0 to {LAST_UNIT}")
    if (share is not None and not 0 < float(share) <= 100) or every == "0":
        raise FaultError(f"{text!r}: a share is a percentage up to 100 %, or 1/N")
    return Fault(
        name,
        kind.usual if value is None else int(value),
        None if unit is None else int(unit),
        1 if every is None else int(every),
        None if share is None else float(share) / 100,
    )


class FaultyAnswers:
    """Which answers go wrong, and how; of several faults that are due the first one comes. `shown` counts them."""

    def __init__(self, faults: Sequence[Fault], random: Random | None = None) -> None:
        self._faults, self._random = faults, random or Random()
        self._turns = Counter[int]()
        self.shown = Counter[str]()

    def due(self, unit: int) -> Fault | None:
        """The fault of the next answer of a unit; None: it is well."""
        found = None
        for number, fault in enumerate(self._faults):
            if fault.unit in (None, unit):
                self._turns[number] += 1
                if found is None and self._comes(fault, self._turns[number]):
                    found = fault
        if found is not None:
            self.shown[found.name] += 1
        return found

    def _comes(self, fault: Fault, turn: int) -> bool:
        return turn % fault.every == 0 if fault.chance is None else self._random.random() < fault.chance

    def spoilt(self, fault: Fault, answer: TwinAnswer) -> TwinAnswer | None:
        """The answer with the fault; None: there is none."""
        done = fault.kind.done
        return answer if done is None else done(answer, fault.value, self._random)
