"""Limits of an ADU: what every floor above asks when it says how long a frame may be and whose address a unit may have.

[1] 4.1, [2] 2.2 and 2.5.1, [3] 3.1.3. Knows no bytes: check values stand in `crc`, envelopes in `envelopes`.
"""

from __future__ import annotations

from typing import Final

CRC_SIZE: Final = 2  # bytes of the check value ([2] 2.5.1.2)
OVERHEAD: Final = 1 + CRC_SIZE  # bytes of an RTU ADU besides its PDU: unit and check value
MIN_ADU: Final = 1 + OVERHEAD  # bytes: unit, function code, check value
MAX_ADU: Final = 256  # bytes ([2] 2.5.1); what a count predicts may exceed it, the wire may not
MAX_PDU: Final = MAX_ADU - OVERHEAD  # bytes ([1] 4.1)
BROADCAST: Final = 0  # the unit that every server hears and none answers ([2] 2.2)
LAST_UNIT: Final = 247  # the last address that a server may have; 248 to 255 are reserved ([2] 2.2)
EXCEPTION: Final = 0x80  # set in the function code of an exception response ([1] 7)
EXCEPTION_ADU: Final = MIN_ADU + 1  # bytes of an exception response: its code besides
