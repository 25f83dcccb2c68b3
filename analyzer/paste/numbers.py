"""Registers that belong together: pairs that look like floats, and every way to read pairs and fours.

A frame does not say what its registers hold. A pair that is a float of everyday size in one of the two usual orders is
worth a hint; all readings are given where asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from dissectors.fields import Field
from dissectors.values import Order, floating, readings

from ..languages import tr

_USUAL: Final[tuple[Order, ...]] = ("ABCD", "CDAB")
_SMALLEST: Final = 1e-3
_LARGEST: Final = 1e7
_REGISTER: Final = "register"


def likely_floats(fields: Sequence[Field]) -> dict[int, str]:
    """For the first register of each pair that looks like a float, by position: what to say."""
    if not fields or any(field.name != _REGISTER or not isinstance(field.value, int) for field in fields):
        return {}
    values = [int(field.value or 0) for field in fields]
    texts = {}
    for i in range(0, len(values) - 1, 2):
        pair = values[i : i + 2]
        hints = [f"{order} {floating(pair, order):.7g}" for order in _USUAL if _everyday(floating(pair, order))]
        if hints and all(pair):
            texts[i] = tr("with the next as float: {readings}", readings=tr(" or ").join(hints))
    return texts


def _everyday(number: float) -> bool:
    return _SMALLEST <= abs(number) <= _LARGEST


def every_reading(field: Field) -> Iterator[str]:
    """Lines with all readings of the pairs and fours among a field's registers."""
    registers = [child for child in field.fields if child.name == _REGISTER and isinstance(child.value, int)]
    values = [int(child.value or 0) for child in registers]
    for size in (2, 4):
        if len(values) < size:
            continue
        yield ""
        kinds = ("u", "s", "f")
        yield f"  {tr('registers'):<15}{tr('order'):<7}" + "".join(
            f"{f'{kind}{16 * size}':>{26 if size == 4 else 18}}" for kind in kinds
        )
        for i in range(0, len(values) - size + 1, size):
            names = [_name(registers[k], k) for k in (i, i + size - 1)]
            by_order: dict[str, list[str]] = {}
            for reading in readings(values[i : i + size]):
                if reading.order is not None:
                    by_order.setdefault(reading.order, []).append(reading.text)
            for k, (order, texts) in enumerate(by_order.items()):
                where = f"{names[0]}-{names[1]}" if not k else ""
                yield f"  {where:<15}{order:<7}" + "".join(f"{text:>{26 if size == 4 else 18}}" for text in texts)


def _name(register: Field, position: int) -> str:
    """Its logical address, or its place where that is not known."""
    return register.text.partition(":")[0] if register.address is not None else f"#{position}"
