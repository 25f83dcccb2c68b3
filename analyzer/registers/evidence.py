"""What the readings of a block say for each hypothesis at each register, as codes into small tables of log odds.

The heart is the description length: how many bits a series of readings takes when its changes are written down as those
of 16-bit words, or as those of one wider number. A wide number is known by its low word, whose changes look like chance
alone and are small once the high word stands before it. Where one word never moved there is nothing to compare; what it
holds (0, FFFF, a small number) and the shape of the moving one then say how often such a pair was one value.

Codes are small whole numbers: the tables that they index are learnt (`weights.json`), everything here is counting.

What the rest of a device says is counted too: how many of its values are of which family. The file of the tables is
made by `benchmarks/fit_registers.py` from the open layouts beside it and the maps that are shipped; it says where they
come from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .counting import NONE, SIZES, Codes, Counting
from .hypotheses import FAMILIES, FAMILY_OF, HYPOTHESES, IMPOSSIBLE
from .readings import Words

_PORTION: Final = 1024  # registers that are counted at once


@dataclass(frozen=True, slots=True, eq=False)
class BlockEvidence:
    """The codes of one block: `codes[h]` of hypothesis h by table, an entry a register where it would begin; `moved`
    which registers moved; `absurd[h]` where hypothesis h cannot stand."""

    codes: list[Codes]
    moved: NDArray[np.bool_]
    absurd: list[NDArray[np.bool_]]


def block_evidence(series: Sequence[tuple[Words, int]]) -> list[BlockEvidence]:
    """The evidence of blocks: of each its readings (rows) of neighbouring registers (columns), and the row behind which
    time goes back once. Blocks of as many readings are counted together."""
    groups: dict[tuple[int, int], list[int]] = {}
    for number, (words, beginning) in enumerate(series):
        groups.setdefault((len(words), beginning), []).append(number)
    by_number: dict[int, BlockEvidence] = {}
    for (_, beginning), members in groups.items():
        for part in _portions(members, [series[number][0].shape[1] for number in members]):
            counting = Counting([series[number][0] for number in part], beginning)
            by_number.update(zip(part, (BlockEvidence(*mine) for mine in counting.blocks()), strict=True))
    return [by_number[number] for number in range(len(series))]


def _portions(members: Sequence[int], sizes: Sequence[int]) -> Iterator[list[int]]:
    """Blocks in portions of so many registers that the processor's memory holds them."""
    part: list[int] = []
    room = _PORTION
    for number, size in zip(members, sizes, strict=True):
        if part and size > room:
            yield part
            part, room = [], _PORTION
        part.append(number)
        room -= size
    if part:
        yield part


Floats = NDArray[np.float64]
_SHARE_EDGES = np.array([0.01, 0.04, 0.1, 0.25, 0.5, 0.75, 0.92])
_ZERO_EDGES: Final = np.array([0.05, 0.15, 0.35, 0.6, 0.85])
DEVICE_ORDERS: Final = ("ABCD", "CDAB")
ZERO_CODES: Final = (len(_ZERO_EDGES) + 1) ** 2
_WAY_EDGES: Final = np.array([0.2, 0.45, 0.7, 0.9])
_GRADES: Final = len(_WAY_EDGES) + 2
WAY_CODES: Final = 2 * _GRADES**2
_SHY = 0.3  # values that a device is taken to have beside those that were found


def device_counts(posterior: Floats, moved: NDArray[np.bool_]) -> Floats:
    """Expected values of a run: by hypothesis, of all segments and (second row) of those of which a word moved."""
    return np.stack((posterior.sum(axis=0), (posterior * moved).sum(axis=0)))


def zero_counts(words: Ints, moved: NDArray[np.bool_]) -> Ints:
    """Of a run: registers that stand at zero, those before a moving one, those behind one; registers that moved."""
    zero = ~moved & (words == 0)
    before, behind = zero[:-1] & moved[1:], zero[1:] & moved[:-1]
    return np.array([zero.sum(), before.sum(), behind.sum(), moved.sum()])


def zero_codes(zeros: Ints, words: Ints, moved: NDArray[np.bool_], order: str) -> Ints:
    """Of each two registers, one that stands at zero and one that moves as the low word of this order: how many of the
    device's zeros stand so, and of how many of its moving registers. NONE elsewhere."""
    zero = ~moved & (words == 0)
    pair = zero[:-1] & moved[1:] if order == "ABCD" else zero[1:] & moved[:-1]
    so = zeros[1 if order == "ABCD" else 2] - 1
    of_zeros = int(np.digitize((so + 0.5) / max(zeros[0], 1), _ZERO_EDGES))
    of_moving = int(np.digitize((so + 0.5) / max(zeros[3], 1), _ZERO_EDGES))
    return np.where(pair, of_zeros * (len(_ZERO_EDGES) + 1) + of_moving, NONE)


def way_counts(words: Ints, moved: NDArray[np.bool_], counts_up: NDArray[np.bool_]) -> Ints:
    """Of a run (2, 2, 2), by word order: of registers that move to and fro, and of those that count up, how many have
    a zero where their high word would stand, and how many there are."""
    zero = ~moved & (words == 0)
    counts = np.zeros((2, 2, 2), np.int64)
    for way, mine in enumerate((moved & ~counts_up, moved & counts_up)):
        counts[:, way, 1] = mine.sum()
        counts[0, way, 0] = (zero[:-1] & mine[1:]).sum()
        counts[1, way, 0] = (zero[1:] & mine[:-1]).sum()
    return counts


def way_codes(counts: Ints, words: Ints, moved: NDArray[np.bool_], counts_up: NDArray[np.bool_], order: str) -> Ints:
    """Of each two registers, one that stands at zero and one that moves as the low word of this order: in which way it
    moves, how many of the device's others that move so stand beside a zero, and how many of those that do not. NONE
    elsewhere."""
    zero = ~moved & (words == 0)
    high, low = (slice(-1), slice(1, None)) if order == "ABCD" else (slice(1, None), slice(-1))
    pair = zero[high] & moved[low]
    mine = counts[DEVICE_ORDERS.index(order)]
    codes = [(way * _GRADES + _grade(*(mine[way] - 1))) * _GRADES + _grade(*mine[1 - way]) for way in range(2)]
    return np.where(pair, np.where(counts_up[low], codes[1], codes[0]), NONE)


def _grade(beside: int, count: int) -> int:
    """0 of none, then from hardly any to nearly all."""
    return 0 if count < 1 else 1 + int(np.digitize((beside + 0.5) / (count + 1), _WAY_EDGES))


def device_codes(
    counts: Floats,
    own: Floats,
    moved: NDArray[np.bool_],
    fits: NDArray[np.bool_],
    zeros: Sequence[Ints],
    by_way: Sequence[Ints],
) -> list[Codes]:
    """Codes of the second pass for a run (T, H): `counts` of the whole device, less what each segment itself gave;
    `zeros` and `by_way` of pairs in either order (`zero_codes`, `way_codes`).

    `own` (T, H) is the posterior of the first pass: a value must not vouch for itself.
    """
    moving = counts[1]
    found: list[Codes] = []
    families = np.array([counts[0][family == FAMILY_OF].sum() for family in range(len(FAMILIES))])
    families_moving = np.array([moving[family == FAMILY_OF].sum() for family in range(len(FAMILIES))])
    for number, hypothesis in enumerate(HYPOTHESES):
        if not fits[:, number].any():
            found.append({})
            continue
        mine = own[:, number]
        family = int(FAMILY_OF[number])
        share = (families[family] - mine + 0.02) / (families.sum() - mine + _SHY)
        mine_moving = mine * moved[:, number]
        share_moving = (families_moving[family] - mine_moving + 0.02) / (families_moving.sum() - mine_moving + _SHY)
        codes: dict[str, Ints] = {
            "device family": family * 8 + np.digitize(share, _SHARE_EDGES),
            "device family moved": family * 8 + np.digitize(share_moving, _SHARE_EDGES),
        }
        if hypothesis.family == "i32":
            codes["device zeros"] = padded(zeros[hypothesis.order == "CDAB"], len(own))
            codes["device zeros by way"] = padded(by_way[hypothesis.order == "CDAB"], len(own))
        found.append(codes)
    return found


def padded(codes: Ints, length: int) -> Ints:
    filled = np.full(length, NONE, np.int64)
    filled[: len(codes)] = codes
    return filled


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
