"""The clauses of the specifications that findings rest on, by their titles.

[1] MODBUS Application Protocol Specification V1.1b3, [2] MODBUS over Serial Line Specification and Implementation Guide
V1.02.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_TITLES: Final[Mapping[str, str]] = {
    "[1] 4.1": "Protocol description",
    "[1] 5": "Function Code Categories",
    "[1] 6": "Function codes descriptions",
    "[1] 6.1": "01 Read Coils",
    "[1] 6.5": "05 Write Single Coil",
    "[1] 7": "MODBUS Exception Responses",
    "[2] 2.1": "MODBUS Master/Slaves protocol principle",
    "[2] 2.2": "MODBUS Addressing rules",
    "[2] 2.4.1": "Master State diagram",
    "[2] 2.5.1": "RTU Transmission Mode",
    "[2] 2.5.1.1": "MODBUS Message RTU Framing",
    "[2] 2.5.1.2": "CRC Checking",
    "[2] 6.2.2": "CRC Generation",
}


def titled(clause: str) -> str:
    """A clause's number with its title: `[2] 2.5.1.2 (CRC Checking)`."""
    title = _TITLES.get(clause)
    return f"{clause} ({title})" if title else clause
