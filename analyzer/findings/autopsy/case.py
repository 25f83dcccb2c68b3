"""What an autopsy is given: the damaged bytes, and all that the conversation knows about them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

from dissectors.answers import Expectation, expectation
from dissectors.checks import crc_bytes
from dissectors.lengths import Role, pdu_length
from dissectors.syndromes import needed, registers

OVERHEAD = 3  # unit and CRC around the PDU
MIN_ADU = 4
MAX_ADU = 256  # [2] 2.5.1


@dataclass(frozen=True)
class Case:
    """Damaged bytes: a frame with a wrong CRC, or a stretch of noise that may have been one.

    `role` is the one that the deframer took the frame for, None where nobody knows. `request` is the whole right
    request that waits for its answer (or that this frame was taken to answer), None where none does. All else helps
    where it is known: `known` frames that this bus has sent before (requests recur), the `units` on it, offsets with
    UART `errors`, and `flow_free`: how many bytes this port has given without one 11 or 13 among them, 0 where there
    were some.
    """

    data: bytes
    role: Role | None = None
    request: bytes | None = None
    known: Collection[bytes] = ()
    units: Collection[int] = ()
    errors: tuple[int, ...] = ()
    flow_free: int | None = None

    @cached_property
    def before(self) -> list[int]:
        """The CRC register before each byte and after the last."""
        return registers(self.data)

    @cached_property
    def needed(self) -> list[int]:
        """The CRC register that each place would need for the rest to end right."""
        return needed(self.data)

    @cached_property
    def expected(self) -> Expectation | None:
        """What the answer that is due must look like; None where none is, as after a broadcast."""
        return expectation(self.request) if self.request and len(self.request) >= MIN_ADU and self.request[0] else None

    @cached_property
    def due(self) -> int | None:
        """Length of the answer that is due (not of an exception), where its request tells."""
        if self.expected is None:
            return None
        length = pdu_length(self.expected.header[1:], Role.RESPONSE)
        return None if length is None or length < 0 else length + OVERHEAD

    @cached_property
    def header(self) -> bytes:
        """The first bytes that the answer that is due must have: all of it, where it only echoes its request."""
        if self.expected is None:
            return b""
        header = self.expected.header
        return header + crc_bytes(header) if len(header) + 2 == self.due else header
