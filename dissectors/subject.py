"""What one frame speaks of: an address, a quantity and values, by its function's declaration (`layout.contents`).

For who reads a frame at a time. Whole captures are read by arrays, which give the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

from .fields import Field
from .layout import NumberRef, ValueRun, contents, values_listed
from .length_rules import Role

_WORD: Final = 2  # bytes of a register


class Subject(NamedTuple):
    """What a frame speaks of.

    `address` is the zero-based physical address, of a response what it answers; `quantity` how many. Either is None
    where there is none, or a cut frame does not reach it. Registers are unsigned numbers, coils and inputs 0 or 1; of
    a cut block the whole values that are there are given. An exception has the address and quantity of its request.
    """

    address: int | None
    quantity: int | None
    values: tuple[int, ...]


NOTHING: Final = Subject(None, None, ())


class SpokenPdu(NamedTuple):
    """A PDU and that of its request, both with the function code first; `asked` is empty where none is known."""

    own: bytes
    asked: bytes

    def number(self, reference: NumberRef | None, width: int = _WORD) -> int | None:
        """The number that stands there; None where there is none."""
        if reference is None:
            return None
        data = self.asked if reference.asked else self.own
        end = reference.offset + width
        return int.from_bytes(data[reference.offset : end], "big") if end <= len(data) else None


def subject(
    function: int, role: Role, exception: int | None, pdu: SpokenPdu, fields: Callable[[], Iterable[Field]]
) -> Subject:
    """What a frame speaks of; `function` is without the exception bit, `fields` gives the annotation of the frame."""
    declared = contents()
    content = declared.get((function, role))
    if content is None:
        return NOTHING
    if exception and role is Role.RESPONSE:
        return _refused(pdu, declared[function, Role.REQUEST].address, declared[function, Role.REQUEST].quantity)
    values: tuple[int, ...] = ()
    if content.held is not None:
        values = _held(content.held, pdu)
    elif content.listed:
        values = tuple(values_listed(fields(), content.listed))
    counted = len(values) if content.held is not None or content.listed else None
    quantity = counted if content.quantity is None else pdu.number(content.quantity)
    return Subject(pdu.number(content.address), quantity, values)


def _refused(pdu: SpokenPdu, address: NumberRef | None, quantity: NumberRef | None) -> Subject:
    """What the request of an exception speaks of."""
    asked = SpokenPdu(pdu.asked, b"")
    return Subject(asked.number(address), asked.number(quantity), ())


def _held(run: ValueRun, pdu: SpokenPdu) -> tuple[int, ...]:
    """The values that are there."""
    data = pdu.own[run.offset :]
    if run.count is None:
        octets = _WORD if len(data) >= _WORD else 0
    else:
        counted = pdu.number(NumberRef(run.count.offset), run.count.width)
        octets = min(max((-1 if counted is None else counted) * run.count.scale - run.less, 0), len(data))
    if run.bits and run.count is not None:
        values = tuple(data[bit >> 3] >> (bit & 7) & 1 for bit in range(8 * octets))
    else:
        numbers = (int.from_bytes(data[at : at + _WORD], "big") for at in range(0, octets - 1, _WORD))
        values = tuple(int(number > 0) for number in numbers) if run.bits else tuple(numbers)
    wanted = None if run.quantity is None else pdu.number(run.quantity)
    return values if wanted is None else values[:wanted]
