"""Bytes of another protocol that shares the pair: named and counted, and nobody's fault."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dissectors.foreign import NAMES

from ...languages import counted, phrase
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ..view import DiagnosisStep, where

OTHER: Final = Rule(
    "other-protocol",
    Severity.NOTE,
    About.NOISE,
    when="bytes in no Modbus frame are those of another protocol",
    numbers=("protocol", "bytes"),
    text=lambda numbers: phrase(
        "{bytes} of {protocol}: no Modbus, and no fault",
        bytes=counted(int(numbers["bytes"]), "byte", "bytes"),
        protocol=NAMES[int(numbers["protocol"])],
    ),
    cause="devices of another protocol share the pair with Modbus",
    remedy="leave it, as long as Modbus devices do not take its frames for their own; else give it a pair of its own",
)


@looks_for(OTHER)
def other_protocols(view: DiagnosisStep) -> Iterator[Findings]:
    """Noise that the deframer knows for another protocol's."""
    rows = where(view.rows.foreign)
    if len(rows):
        noise = view.rows[rows]
        yield OTHER.on(noise, noise.foreign, noise.length)
