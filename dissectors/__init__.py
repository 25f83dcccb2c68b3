"""What bytes mean: check values, envelopes, length rules, annotation, values. Knows nothing of captures or time.

Theory: each function of the protocol is one declaration (`dissectors.functions`); lengths, plausibility and annotation
are walked from it. References: [1] MODBUS Application Protocol Specification V1.1b3, [2] MODBUS over Serial Line V1.02,
[3] MODBUS Messaging on TCP/IP V1.0b.

    from dissectors import Role, annotate, rtu, summary
    frame = rtu(bytes.fromhex("1103006B00037687"))
    summary(frame, Role.REQUEST)            # 'read 3 holding registers from 107 (40108)'
    annotate(frame, Role.REQUEST)           # the field tree

Names are imported when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from .annotation import Context, annotate, summary
    from .blocks import Bits, Items, Octets, Record, Registers, Rest, Text
    from .building import build
    from .crc import crc16, crc_bytes, crc_ok, lrc
    from .declaration import (
        Address,
        ByteCount,
        Code,
        DeclarationError,
        Flags,
        Function,
        Mask,
        Number,
        Output,
        Quantity,
        Register,
        State,
    )
    from .envelopes import Adu, ascii_adu, ascii_frames, rtu, tcp, tcp_frames
    from .fields import Field
    from .length_rules import Role
    from .lengths import pdu_length, plausibility, relations, rule
    from .registry import function_name, load_entry_points, load_file, register
    from .values import floating, harmless, integer, logical, physical, readings, signed

__all__ = [
    "Address",
    "Adu",
    "Bits",
    "ByteCount",
    "Code",
    "Context",
    "DeclarationError",
    "Field",
    "Flags",
    "Function",
    "Items",
    "Mask",
    "Number",
    "Octets",
    "Output",
    "Quantity",
    "Record",
    "Register",
    "Registers",
    "Rest",
    "Role",
    "State",
    "Text",
    "annotate",
    "ascii_adu",
    "ascii_frames",
    "build",
    "crc16",
    "crc_bytes",
    "crc_ok",
    "floating",
    "function_name",
    "harmless",
    "integer",
    "load_entry_points",
    "load_file",
    "logical",
    "lrc",
    "pdu_length",
    "physical",
    "plausibility",
    "readings",
    "register",
    "relations",
    "rtu",
    "rule",
    "signed",
    "summary",
    "tcp",
    "tcp_frames",
]

_HOME: Final = {
    "annotation": ("Context", "annotate", "summary"),
    "blocks": ("Bits", "Items", "Octets", "Record", "Registers", "Rest", "Text"),
    "building": ("build",),
    "crc": ("crc16", "crc_bytes", "crc_ok", "lrc"),
    "declaration": (
        "DeclarationError",
        "Function",
        "Address",
        "ByteCount",
        "Code",
        "Flags",
        "Mask",
        "Number",
        "Output",
        "Quantity",
        "Register",
        "State",
    ),
    "envelopes": ("Adu", "ascii_adu", "ascii_frames", "rtu", "tcp", "tcp_frames"),
    "fields": ("Field",),
    "lengths": ("Role", "pdu_length", "plausibility", "relations", "rule"),
    "registry": ("function_name", "load_entry_points", "load_file", "register"),
    "values": ("floating", "harmless", "integer", "logical", "physical", "readings", "signed"),
}
_MODULES: Final = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> object:
    module = _MODULES.get(name)
    if module is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{module}"), name)
