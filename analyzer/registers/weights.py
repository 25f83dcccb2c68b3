"""The learnt tables: log odds by what was counted, with where they come from (`weights.json`).

The file is made by `benchmarks/fit_registers.py` from the open layouts beside it and the maps that are shipped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .chain import IMPOSSIBLE
from .counting import SIZES, Codes
from .device import DEVICE_ORDERS, WAY_CODES, ZERO_CODES
from .hypotheses import FAMILIES, FAMILY_OF, HYPOTHESES

Floats = NDArray[np.float64]
_ORDERS: Final = 3  # of two neighbours: one has no order, the same, different ones
NEIGHBOURS: Final = len(FAMILIES) ** 2 * _ORDERS
SHARES: Final[Mapping[str, int]] = {
    "device family": 5 * 8, "device family moved": 5 * 8, "device zeros": ZERO_CODES,
    "device zeros by way": WAY_CODES,
}  # fmt: skip
"""Tables of the second pass: what the device's other values are."""
TABLES: Final[Mapping[str, int]] = {
    **SIZES, **SHARES, "neighbours": NEIGHBOURS, "begin": 5, "end": 5,
    "device order": 2, "value order": 2 * len(FAMILIES),
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Log odds by table for each pass, and the temperature that makes the second one's shares true."""

    passes: tuple[Mapping[str, Floats], Mapping[str, Floats]]
    temperature: float
    provenance: Mapping[str, Any]

    def chain(self, which: int) -> tuple[Floats, Floats, Floats]:
        """Transitions (H, H), begin and end (H) of a pass."""
        tables = self.passes[which]
        return tables["neighbours"][neighbour_codes()], tables["begin"][FAMILY_OF], tables["end"][FAMILY_OF]

    def orders(self, which: int) -> tuple[Floats, Floats]:
        """Log odds of a device's word order (2), and under each those of a value of every hypothesis (2, H)."""
        tables = self.passes[which]
        return tables["device order"], tables["value order"][order_codes()]

    def scores(self, which: int, codes: Sequence[Codes], longest: int) -> Floats:
        """Log odds (T, H) of every segment of a run."""
        tables = self.passes[which]
        found = np.full((longest, len(HYPOTHESES)), IMPOSSIBLE)
        for number, by_table in enumerate(codes):
            if by_table:
                found[: len(next(iter(by_table.values()))), number] = sum(
                    np.where(code >= 0, tables[name][code], 0.0) for name, code in by_table.items()
                )
        return found


@lru_cache(maxsize=1)
def neighbour_codes() -> NDArray[np.int64]:
    """The entry of `neighbours` for each pair of hypotheses (H, H)."""
    count = len(HYPOTHESES)
    codes = np.zeros((count, count), np.int64)
    for one, left in enumerate(HYPOTHESES):
        for second, right in enumerate(HYPOTHESES):
            orders = 0 if left.order is None or right.order is None else 1 if left.order == right.order else 2
            codes[one, second] = (FAMILY_OF[one] * len(FAMILIES) + FAMILY_OF[second]) * _ORDERS + orders
    return codes


@lru_cache(maxsize=1)
def order_codes() -> NDArray[np.int64]:
    """The entry of `value order` for a device of each order and each hypothesis (2, H): of a family, as the device has
    it or (second half) against it."""
    against = [[hypothesis.order not in (None, order) for hypothesis in HYPOTHESES] for order in DEVICE_ORDERS]
    codes: NDArray[np.int64] = FAMILY_OF[None, :] + len(FAMILIES) * np.array(against)
    return codes


@lru_cache(maxsize=1)
def shipped_weights() -> Weights:
    """The tables that come with this package."""
    import orjson

    content = orjson.loads((files(__package__) / "weights.json").read_bytes())
    passes = [{name: np.array(values) for name, values in tables.items()} for tables in content["passes"]]
    return Weights((passes[0], passes[1]), content["temperature"], content["provenance"])
