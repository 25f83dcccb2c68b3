"""Payloads made to fool a CRC scan: register values that hold a right CRC where no frame ends.

The running CRC of any prefix can be steered by two bytes of payload, so a response can look complete too early; and
registers may well hold frames of other units, alone or as a request with its answer (gateways and loggers keep such).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from random import Random

from dissectors.crc import crc_bytes

_HEAD = 3  # unit, function, byte count
_REQUEST_LENGTH = 8  # of the commonest requests: a prefix of that length is the most tempting
_ADDRESSES = 100
_MOST_ASKED = 18


def hostile(random: Random, unit: int, answer: bytes, units: Sequence[int]) -> bytes:
    """A response PDU to a register read, as long as the PDU `answer`, with a payload that fools; merely random bytes
    where the trick drawn needs more of them. `units` are those on the bus."""
    head = bytes((unit,)) + answer[:2]
    payload = random.randbytes(len(answer) - 2)
    trick = random.randrange(4)
    if trick == 0 and len(payload) > _REQUEST_LENGTH - _HEAD:
        payload = _complete_at(_REQUEST_LENGTH, head, payload)
    elif trick == 1 and len(payload) >= 4:
        # Where the prefix ends with the payload, the frame's own CRC is 0000.
        payload = _complete_at(random.randint(_HEAD + 2, _HEAD + len(payload)), head, payload)
    elif trick == 2:
        payload = _holding(_request(random, random.choice(units)), random, payload)
    elif trick == 3:
        payload = _holding(_exchange(random, random.choice(units)), random, payload)
    return answer[:2] + payload


def _complete_at(length: int, head: bytes, payload: bytes) -> bytes:
    """`payload` with the two bytes that make the frame's first `length` bytes end in their own CRC."""
    at = length - _HEAD - 2
    return payload[:at] + crc_bytes(head + payload[:at]) + payload[at + 2 :]


def _holding(frames: bytes, random: Random, payload: bytes) -> bytes:
    """`payload` with whole frames somewhere in it, where they fit."""
    if len(frames) > len(payload):
        return payload
    at = random.randint(0, len(payload) - len(frames))
    return payload[:at] + frames + payload[at + len(frames) :]


def _request(random: Random, unit: int) -> bytes:
    address, quantity = random.randrange(_ADDRESSES), random.randint(1, _MOST_ASKED)
    return _closed(struct.pack(">BBHH", unit, random.choice((1, 3, 4)), address, quantity))


def _exchange(random: Random, unit: int) -> bytes:
    request = struct.pack(">BBHH", unit, 3, random.randrange(_ADDRESSES), 1)
    return _closed(request) + _closed(bytes((unit, 3, 2)) + random.randbytes(2))


def _closed(body: bytes) -> bytes:
    return body + crc_bytes(body)
