"""Values that no hypothesis holds: texts, coils and inputs, and floats whose words have their bytes swapped.

Texts are told among registers that never move; coils and inputs by the function that reads them.

Floats of which the bytes within each word are swapped (BADC, DCBA) come from some gateways and bridges. Such a float is
no number as it stands, and a plausible one swapped; by chance hardly any two registers are. It is believed where
several agree, each likelier than what stands there unswapped, and at least twice as many as are floats unswapped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.maps.model import MappedValue, RegisterMap

from ..languages import register_words
from .hypotheses import HYPOTHESES
from .readings import BlockReadings, Words
from .roles import RegisterValue
from .runs import Run

_LEAST_TEXT: Final = 2  # registers
_ODD_WORDS: Final = 6  # one of so many may be unlike a name's
_UNUSUAL: Final = frozenset("!\"$%'*;<=>?@[\\]^`{|}~")  # in names, models, serial numbers and versions
_TENTHS: Final = frozenset(("33", "ff"))  # 3333, 6666: how the float of a number with one decimal often ends
_HEADS: Final = frozenset(">?@ABCDEFG")  # 3E to 47: how the floats of 0.13 to 65,536 begin


def texts_in(run: Run) -> list[tuple[int, int]]:
    """Stretches of registers that never moved and hold printable characters, the end of the text filled up."""
    still = [(-1, False, False)] * run.length
    for at in range(run.length):
        if not run.moved[at]:
            block, columns = run.source_of(at, 1, 0)
            high, low = divmod(int(block.last[columns[0]]), 256)
            letters = all(0x20 <= byte < 0x7F for byte in (high, low))
            ending = 0x20 <= high < 0x7F and low == 0
            still[at] = (high, letters, ending)
    texts, at = [], 0
    while at < run.length:
        end = at
        while end < run.length and still[end][1]:
            end += 1
        if end - at >= _LEAST_TEXT and _wordlike(run, at, end):
            end += end < run.length and still[end][2]
            texts.append((at, end))
        at = max(end, at + 1)
    return texts


def _wordlike(run: Run, begin: int, end: int) -> bool:
    data = "".join(_letters(run, begin, end))
    words = [data[at : at + 2] for at in range(0, len(data), 2)]
    beside = zip(["", *words], words, [*words[1:], ""], strict=False)
    halves = sum(word in _TENTHS and not _HEADS.isdisjoint((left[:1], right[:1])) for left, word, right in beside)
    unusual = sum(not _UNUSUAL.isdisjoint(word) for word in words)
    if (halves + unusual) * _ODD_WORDS > len(words):  # 0.9 and 0.8 are `?fff?L`, 15.2 is `As33`
        return False
    return len(data) >= 6 or (data.isalnum() and not data.isdigit() and len(data) >= 4 and data.isascii())


def _letters(run: Run, begin: int, end: int) -> Iterator[str]:
    for at in range(begin, end):
        block, columns = run.source_of(at, 1, 0)
        word = int(block.last[columns[0]])
        yield from (chr(byte) for byte in (word >> 8, word & 0xFF) if 0x20 <= byte < 0x7F)


def text_value(run: Run, begin: int, end: int, row: MappedValue | None) -> RegisterValue:
    block, _ = run.source_of(begin, 1, 0)
    text = "".join(_letters(run, begin, end)).rstrip()
    return RegisterValue(
        unit=run.unit,
        area=run.area,
        address=run.address + begin,
        words=end - begin,
        kind="text",
        signed=False,
        order=None,
        role=None,
        confidence=1.0 if row is not None else 0.9,
        bits=3.0,
        why=register_words("as the map has it" if row is not None else "printable characters that never moved"),
        readings=block.count,
        changes=0,
        minimum=None,
        maximum=None,
        last=text,
        name=row.name if row is not None else None,
        unit_of_measure=row.unit if row is not None else None,
    )


def bit_values(blocks: list[BlockReadings], chart: RegisterMap | None) -> Iterator[RegisterValue]:
    """Coils and inputs: what they are is said by the function that reads them."""
    best: dict[tuple[str, int], tuple[BlockReadings, int]] = {}
    for block in blocks:
        if block.area in ("coil", "discrete"):
            for column in range(block.quantity):
                key = (block.area, block.address + column)
                if key not in best or block.count > best[key][0].count:
                    best[key] = (block, column)
    written = {(b.area, a) for b in blocks if b.written for a in range(b.address, b.address + b.quantity)}
    for (area, address), (block, column) in best.items():
        row = chart.at(area, address) if chart is not None else None
        moved = bool(block.changes[column])
        yield RegisterValue(
            unit=block.unit,
            area=block.area,
            address=address,
            words=1,
            kind="bits",
            signed=False,
            order=None,
            role="setpoint" if (area, address) in written else "status" if moved else None,
            confidence=1.0,
            bits=10.0,
            why=register_words("a bit by its function code"),
            readings=block.count,
            changes=int(block.changes[column]),
            minimum=int(block.least[column]),
            maximum=int(block.greatest[column]),
            last=int(block.last[column]),
            name=row.name if row is not None else None,
            scale=row.scale if row is not None else None,
            unit_of_measure=row.unit if row is not None else None,
        )


_SURE: Final = 0.9
_LIKELY: Final = 0.7  # swapped, which a second one must confirm
_LEAST: Final = 3  # floats of a unit that agree
_MORE: Final = 2  # times as many as are sure as they stand
_ORDERS: Final = {"ABCD": "BADC", "CDAB": "DCBA"}
_USUAL: Final = (1e-4, 1e7)
Inferring = Callable[[Sequence[BlockReadings]], list[RegisterValue]]


def swapped_floats(
    blocks: Sequence[BlockReadings], values: Sequence[RegisterValue], inferred: Inferring
) -> list[RegisterValue]:
    """The byte-swapped floats of one unit, of which `values` is what it says as it stands; `inferred` reads blocks."""
    plain = sum(value.kind == "float" and value.changes > 0 and value.confidence >= _SURE for value in values)
    registers = [block for block in blocks if block.area in ("input", "holding") and block.quantity > 1]
    if sum(map(_candidates, registers)) < max(_LEAST, _MORE * plain):
        return []
    swapped = register_words("the bytes of its words are swapped")
    stands = {
        (value.area, value.address + n): value.confidence
        for value in values
        if value.changes
        for n in range(value.words)
    }
    floats = [
        replace(value, order=_ORDERS[value.order or "ABCD"], why=f"{value.why}; {swapped}")
        for value in inferred([_swapped(block) for block in registers])
        if value.kind == "float"
        and value.words == 2
        and value.changes
        and value.confidence >= _LIKELY
        and value.confidence > min(stands.get((value.area, value.address + n), 1.0) for n in range(value.words))
    ]
    return floats if len(floats) >= max(_LEAST, _MORE * plain) else []


def exclude(run: Run, address: int, words: int) -> None:
    """No other value than single registers stands in these."""
    begin, end = address - run.address, address - run.address + words
    if begin < 0 or end > run.length:
        return
    for number, hypothesis in enumerate(HYPOTHESES):
        if hypothesis.words > 1:
            run.fits[max(0, begin - hypothesis.words + 1) : end, number] = False


def _candidates(block: BlockReadings) -> int:
    """Pairs that moved and are plausible floats swapped, though not as they stand."""
    words = block.series[0]
    moved = (words != words[0]).any(axis=0)
    count = 0
    for first, second in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
        plain = _plausible(words[:, first], words[:, second])
        turned = words.byteswap()
        count += int((_plausible(turned[:, first], turned[:, second]) & ~plain & (moved[:-1] | moved[1:])).sum())
    return count


def _plausible(high: Words, low: Words) -> NDArray[np.bool_]:
    value = (high.astype(np.uint32) << 16 | low).view(np.float32)
    size = np.abs(np.nan_to_num(value, nan=np.inf))
    plausible: NDArray[np.bool_] = (((size >= _USUAL[0]) & (size <= _USUAL[1])) | (size == 0)).all(axis=0) & (
        size != 0
    ).any(axis=0)
    return plausible


def _swapped(block: BlockReadings) -> BlockReadings:
    """The same readings with the bytes of each word swapped; extremes are of the readings that are kept."""
    made = BlockReadings(block.unit, block.area, block.address, block.quantity, block.written, block.most)
    rows = np.concatenate([*block.first, block.apart]).byteswap()
    made.add(rows, np.full(len(rows), block.first_ns))
    made.first = [part.byteswap() for part in block.first]
    made.apart, made.times, made.stride = block.apart.byteswap(), block.times, block.stride
    made.count, made.changes, made.last = block.count, block.changes, block.last.byteswap()
    made.first_ns, made.last_ns = block.first_ns, block.last_ns
    return made
