"""What to simulate: a wire, a tap and perhaps a defect by name, how long, and the seed that fixes every draw."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Scenario:
    """A bus to simulate.

    `wire` and `tap` name entries of `WIRES` and `TAPS`; `transactions` counts requests, repeated ones included;
    `baud` (bit/s) and `units` (how many servers) are drawn where None; `char_bits` as in `captures.LineSettings`.
    `defect` is the code of a finding: a healthy bus with that one thing wrong, again and again, on the wire `clean`.
    """

    wire: str
    tap: str
    transactions: int = 400
    seed: int = 0
    baud: int | None = None
    char_bits: int = 11
    units: int | None = None
    defect: str | None = None
