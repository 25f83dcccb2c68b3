"""Texts among registers that never move, and coils and inputs: what needs no inference."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dissectors.maps.model import MappedValue, RegisterMap

from .readings import BlockReadings
from .runs import Run
from .values import RegisterValue

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
        why="as the map has it" if row is not None else "printable characters that never moved",
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
            why="a bit by its function code",
            readings=block.count,
            changes=int(block.changes[column]),
            minimum=int(block.least[column]),
            maximum=int(block.greatest[column]),
            last=int(block.last[column]),
            name=row.name if row is not None else None,
            scale=row.scale if row is not None else None,
            unit_of_measure=row.unit if row is not None else None,
        )
