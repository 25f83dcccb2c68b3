"""How damaged answers begin: whose bits are lost at their head, or who began before."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import pairwise
from math import log2
from typing import Final

from dissectors.crc import crc16

from .evidence import Evidence
from .rawbytes import beheaded, formats_of
from .signatures import Signature, known_header
from .unitledger import UnitLedger

_MOSTLY: Final = 0.5
_BYTE: Final = 8.0
_CHECKED: Final = 16.0
_BEGINNING: Final = 3  # bytes of garbage that count
_FEWER: Final = 0.6
_CHARACTER_BITS: Final = 12
_LOST_BITS: Final = 24  # more than two characters
_SPREAD: Final = (0.88, 1.12)  # of the delay, from answer to answer
_MISSED: Final = 2.0  # bits against it, where garbage begins otherwise


def begun_before(evidence: Evidence, unit: UnitLedger) -> int:
    """How many damaged answers have their first byte as if it had begun some bits too soon, and all their bytes: another
    transmitter's start was heard before. A driver that is late begins none sooner."""
    found = 0
    for each in evidence.readings(unit):
        header, first = known_header(each.request), each.heard[:1]
        if each.length == each.due and len(header) > 1 and first != header[:1] and each.heard[1:2] == header[1:2]:
            sooner = any(first[0] >> bits == header[0] & 0xFF >> bits for bits in range(1, 8))
            found += sooner and not any(
                beheaded(header, lost, receiver).startswith(first)
                for receiver in formats_of(evidence.ledger.line)
                for lost in range(1, _CHARACTER_BITS)
            )
    return found


def beginnings(readings: Sequence[Signature], most: int) -> dict[bytes, Counter[bytes]]:
    """How often each beginning of so many bytes was heard, by the header that was to be sent."""
    heard: dict[bytes, Counter[bytes]] = defaultdict(Counter)
    for each in readings:
        heard[known_header(each.request)][each.heard[:most]] += 1
    return heard


def out_of_step_bits(evidence: Evidence, unit: UnitLedger) -> float:
    """Bits for garbage that begins as a known header does whose first bits are missing, nearly the same number each
    time: its receiver is out of step from there on."""
    readings = evidence.readings(unit)
    if sum(each.length < _FEWER * each.due for each in readings) > _MOSTLY * len(readings):
        return 0.0  # what is out of step is heard a byte a byte
    heard = beginnings(readings, _BEGINNING)
    best = 0.0
    for receiver in formats_of(evidence.ledger.line):
        for lost in range(2, _LOST_BITS):
            reach = range(round(_SPREAD[0] * lost), round(_SPREAD[1] * lost) + 1)
            price = log2(len(reach))
            bits = -_BYTE
            for header, heads in heard.items():
                garbled = {beheaded(header, bits_lost, receiver)[:_BEGINNING] for bits_lost in reach}
                telling = [g for g in garbled if g and not header.startswith(g)]
                for head, count in heads.items():
                    fits = max((len(g) for g in telling if head.startswith(g)), default=0)
                    bits += count * (_BYTE * fits - price if fits else -_MISSED)
            best = max(best, bits)
    return best


def whole_behind_bits(readings: Sequence[Signature]) -> float:
    """Bits for garbage whose end is whole, though its beginning is not known: two answers to one request, as long and
    not the same, leave the same rest by the check value where all in which they differ is right. A late driver adds no
    byte."""
    alike: dict[tuple[bytes, int], list[bytes]] = defaultdict(list)
    for each in readings:
        if each.length <= each.due and not each.heard.startswith(known_header(each.request)[:1]):
            alike[each.request, each.length].append(each.heard)
    bits = -_BYTE
    for several in alike.values():
        for one, two in pairwise(dict.fromkeys(several)):
            bits += _CHECKED if crc16(one) == crc16(two) else -1
    return bits
