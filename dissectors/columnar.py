"""A declaration read over many PDUs at once, in arrays: where each ends, and where its named parts lie.

Nothing is stated here: a declaration is walked once, for steps that move the cursors of all PDUs over one part each.
There are steps for what the specification's functions are made of: numbers, counted blocks, lists of them and
alternatives. A declaration with any other part has none, and only reading its PDUs one by one tells.

Everything is as reading one by one has it: a name is looked up in the innermost struct, and a cut PDU is read as far as
it goes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from typing import Any, Final

import construct
import numpy as np
from numpy.typing import NDArray

from .blocks import Bits, Counted, Items, Registers, Rest, Variant
from .declaration import AnyConstruct, Number
from .length_rules import field_names, path_name, rebuilt

Octets = NDArray[np.uint8]
Places = NDArray[np.intp]
Runs = tuple[Places, Places, Places]
Ends = Callable[[Octets, Places, Places], Places]
_NO_PLACES: Final = np.zeros(0, np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """A part where many PDUs have it: `pdu` which of them (ascending), where its bytes begin, how many there are.

    `inner`: parts in it, in order; of a list those of all first elements, then those of all second ones.
    """

    name: str | None
    part: AnyConstruct
    pdu: Places
    at: Places
    sizes: Places
    inner: tuple[Spot, ...] = ()

    def among(self, pdus: NDArray[np.bool_]) -> Spot:
        """The same of PDUs among these, a mask of all."""
        which = pdus[self.pdu]
        if which.all():
            return self
        within = [spot.among(pdus) for spot in self.inner]
        inner = tuple(spot for spot in within if len(spot.pdu))
        return Spot(self.name, self.part, self.pdu[which], self.at[which], self.sizes[which], inner)

    def leaves(self) -> Iterator[Spot]:
        """Itself, or the parts in it that have none in them."""
        if not self.inner:
            yield self
        for spot in self.inner:
            yield from spot.leaves()


@dataclass(slots=True, eq=False)
class Cursors:
    """Where reading is in each of n PDUs. `right` (n): all so far was there and broke no hard check.

    `plain` (n): no list or block is without an element, and each list ends where its count says. `spots`: what was
    read, of all parts of the same reading.
    """

    data: Octets
    pdu: Places
    at: Places
    end: Places
    right: NDArray[np.bool_]
    plain: NDArray[np.bool_]
    spots: list[Spot] = field(default_factory=list)

    @classmethod
    def begun(cls, data: Octets, at: Places, end: Places) -> Cursors:
        """At the first byte of each."""
        return cls(data, np.arange(len(at)), at.copy(), end, *np.ones((2, len(at)), np.bool_))

    def part(self, some: Places) -> Cursors:
        """Some of them, by place, to be read alone."""
        places = self.pdu[some], self.at[some], self.end[some]
        return Cursors(self.data, *places, self.right[some], self.plain[some], self.spots)

    def put_back(self, some: Places, read: Cursors) -> None:
        """What reading them alone came to."""
        self.at[some], self.right[some], self.plain[some] = read.at, read.right, read.plain

    def note(self, name: str | None, part: AnyConstruct, begins: Places, inner: Iterable[Spot] = ()) -> None:
        """A part was read, from there to where the cursors are."""
        self.spots.append(Spot(name, part, self.pdu, begins, self.at - begins, tuple(inner)))

    @contextmanager
    def within(self, name: str | None, part: AnyConstruct) -> Iterator[None]:
        """What is read meanwhile is in a part of that name; without a name it stands beside what is read before."""
        if name is None:
            yield
            return
        begins, outer = self.at.copy(), self.spots
        self.spots = []
        yield
        inner, self.spots = self.spots, outer
        self.note(name, part, begins, inner)

    def number(self, width: int) -> Places:
        """A number of 1 or 2 bytes of each, which stands there if it is still `right` behind it."""
        self.right &= self.at + width <= self.end
        place = np.where(self.right, self.at, 0)
        value = self.data.take(place).astype(np.intp)
        if width > 1:
            value = value << 8 | self.data.take(np.where(self.right, place + 1, 0))
        self.at += self.right * width
        return value

    def octets(self, wanted: Places) -> tuple[Places, Places]:
        """So many bytes of each: where they begin, and how many are there."""
        begins = self.at.copy()
        there = np.where(self.right, np.clip(self.end - begins, 0, np.maximum(wanted, 0)), 0)
        self.right &= there >= wanted
        self.at += there
        return begins, there


Scope = dict[str, Places]  # the numbers of one struct by name, each of all PDUs
Step = Callable[[Cursors, Scope], Places | None]


class _NoStepsError(Exception):
    """A part that nothing here reads."""


def _reader(declaration: AnyConstruct, *, strict: bool) -> Callable[[Octets, Places, Places], Cursors] | None:
    """What reads PDUs to where their cursors stand then; None for a declaration that has no steps."""
    try:
        step = _step(declaration, set(), strict)
    except _NoStepsError:
        return None

    def read(data: Octets, at: Places, end: Places) -> Cursors:
        cursors = Cursors.begun(data, at, end)
        if len(at):
            step(cursors, {})
        return cursors

    return read


@lru_cache(maxsize=256)
def pdu_ends(declaration: AnyConstruct) -> Ends | None:
    """What finds where PDUs end, from (bytes, where each begins behind its function code, where its bytes end at most).

    -1: it is cut, breaks a hard check, or nothing says where it ends. None for a declaration that has no steps.
    """
    read = _reader(declaration, strict=True)
    if read is None:
        return None

    def ends(data: Octets, at: Places, end: Places) -> Places:
        cursors = read(data, at, end)
        return np.where(cursors.right, cursors.at, -1)

    return ends


@lru_cache(maxsize=256)
def register_runs(declaration: AnyConstruct) -> Callable[[Octets, Places, Places], Runs] | None:
    """What finds the registers of PDUs, from the same: runs of them in wire order, PDU by PDU, as in `Cursors`.

    None where only annotation can: for a declaration that has no steps, or in which other fields have the same name.
    """
    names: set[str] = set()

    def note(part: AnyConstruct) -> None:
        if isinstance(part, Registers):
            names.add(part.each)

    rebuilt(declaration, note)
    if names.intersection(field_names(declaration)):
        return None
    read = _reader(declaration, strict=False)
    if read is None:
        return None

    def runs(data: Octets, at: Places, end: Places) -> Runs:
        pieces = [(_NO_PLACES,) * 3]
        for spot in chain.from_iterable(spot.leaves() for spot in read(data, at, end).spots):
            if isinstance(spot.part, Registers) and len(some := np.flatnonzero(spot.sizes > 1)):
                pieces.append((spot.pdu[some], spot.at[some], spot.sizes[some] // 2))
        pdu, begins, counts = (np.concatenate(column) for column in zip(*pieces, strict=True))
        order = np.lexsort((begins, pdu))
        return pdu[order], begins[order], counts[order]

    return runs


@lru_cache(maxsize=256)
def spots(declaration: AnyConstruct) -> Callable[[Octets, Places, Places], tuple[NDArray[np.bool_], list[Spot]]] | None:
    """What finds the parts of PDUs, from the same: a mask of those that are whole and plain, and the parts of these.

    Such a PDU is read to its end, and none of its lists and blocks of registers is without an element or breaks its
    count. None for a declaration that has no steps.
    """
    read = _reader(declaration, strict=False)
    if read is None:
        return None

    def found(data: Octets, at: Places, end: Places) -> tuple[NDArray[np.bool_], list[Spot]]:
        cursors = read(data, at, end)
        whole = cursors.right & cursors.plain & (cursors.at == end)
        if not whole.all():
            cursors = read(data, at[whole], end[whole])
        return whole, cursors.spots

    return found


def _step(con: AnyConstruct, scope: set[str], strict: bool, name: str | None = None) -> Step:
    """What reads a part; `scope`: the numbers before it in its struct. `strict` holds numbers to their hard checks.

    Raises _NoStepsError.
    """
    while isinstance(con, construct.Renamed):
        name, con = name or con.name, con.subcon
    name = None if strict else name  # who asks for ends alone needs no parts
    if con is construct.Pass:
        return lambda cursors, scope: None  # noqa: ARG005
    if isinstance(con, construct.Struct):
        return _struct(con, strict, name)
    if isinstance(con, construct.Switch):
        return _switch(con, scope, strict, name)
    for kind, make in ((Number, _number), (Counted, _counted), (Items, _items), (Rest, _rest)):
        if isinstance(con, kind) and type(con)._parse is kind._parse:  # a user's own may read otherwise
            return make(con, scope, strict, name)
    raise _NoStepsError


def _struct(con: Any, strict: bool, name: str | None) -> Step:
    own: set[str] = set()
    steps: list[tuple[str | None, Step]] = []
    if type(con)._parse is not construct.Struct._parse:
        raise _NoStepsError
    for part in con.subcons:
        steps.append((part.name, _step(part, own, strict)))
        inner = part
        while isinstance(inner, construct.Renamed):
            inner = inner.subcon
        own.discard(part.name)
        if part.name and isinstance(inner, Number):
            own.add(part.name)

    def read(cursors: Cursors, _scope: Scope) -> None:
        numbers: Scope = {}
        with cursors.within(name, con):
            for each, step in steps:
                value = step(cursors, numbers)
                if each is not None and value is not None:
                    numbers[each] = value

    return read


def _number(con: Any, scope: set[str], strict: bool, name: str | None) -> Step:  # noqa: ARG001
    hard = [check for check in con.checks if not check.soft] if strict else []
    width: int = con.width

    def read(cursors: Cursors, _scope: Scope) -> Places:
        begins = cursors.at if strict else cursors.at.copy()
        value = cursors.number(width)
        for check in hard:
            cursors.right &= check.fits(value)
        if not strict:
            cursors.note(name, con, begins)
        return value

    return read


def _counted(con: Any, scope: set[str], strict: bool, name: str | None) -> Step:
    count, scale, less = con.count, con.scale, con.less
    registers = isinstance(con, Registers)
    if count not in scope or (not strict and isinstance(con, Bits)):
        raise _NoStepsError
    if registers and not strict and type(con).decoded is not Registers.decoded:
        raise _NoStepsError

    def read(cursors: Cursors, scope: Scope) -> None:
        begins, there = cursors.octets(scope[count] * scale - less)
        if not strict:
            if registers:
                cursors.plain &= (there > 0) & (there & 1 == 0)
            cursors.note(name, con, begins)

    return read


def _items(con: Any, scope: set[str], strict: bool, name: str | None) -> Step:
    count = con.octets if con.number is None else con.number
    element = _step(con.subcon, scope, strict)
    if count not in scope:
        raise _NoStepsError

    def read(cursors: Cursors, scope: Scope) -> None:
        left = scope[count].copy() if con.number is not None else cursors.at + scope[count]
        cursors.plain &= left > (0 if con.number is not None else cursors.at)
        with cursors.within(name, con):
            while len(some := np.flatnonzero((left > (0 if con.number is not None else cursors.at)) & cursors.right)):
                part = cursors.part(some)
                element(part, {key: numbers[some] for key, numbers in scope.items()})
                if con.number is not None:
                    left[some] -= 1
                else:
                    left[some[part.at == cursors.at[some]]] = 0  # an element of no bytes would go on for ever
                cursors.put_back(some, part)
        if con.number is None:
            cursors.plain &= cursors.at == left

    return read


def _switch(con: Any, scope: set[str], strict: bool, name: str | None) -> Step:
    key = path_name(con.keyfunc)
    if key not in scope or type(con)._parse is not construct.Switch._parse:
        raise _NoStepsError
    inner = None if isinstance(con, Variant) else name
    steps = {value: _step(case, scope, strict, inner) for value, case in con.cases.items()}
    otherwise = _step(con.default, scope, strict, inner)

    def read(cursors: Cursors, scope: Scope) -> None:
        values = scope[key]
        for value in np.unique(values[cursors.right]).tolist():
            some = np.flatnonzero(cursors.right & (values == value))
            part = cursors.part(some)
            steps.get(value, otherwise)(part, {key: numbers[some] for key, numbers in scope.items()})
            cursors.put_back(some, part)

    return read


def _rest(con: Any, scope: set[str], strict: bool, name: str | None) -> Step:  # noqa: ARG001
    usual: int = con.usual

    def read(cursors: Cursors, _scope: Scope) -> None:
        if strict:  # nothing says where it ends
            cursors.right[:] = False
            return
        begins, _ = cursors.octets(np.maximum(cursors.end - cursors.at, usual))
        cursors.note(name, con, begins)

    return read
