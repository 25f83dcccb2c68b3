"""The calls of `import rtuscope` that stand beside `open`: paste, build, listen, registers.

Each is one call over what the packages do in parts; errors leave as RtuscopeError.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import tzinfo
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal

from .errors import under_base

if TYPE_CHECKING:
    from .analysis import Analysis
    from .live.session import Session
    from .paste.model import Paste
    from .registers.roles import RegisterValue


def parse(
    text: str,
    *,
    envelope: Literal["auto", "rtu", "ascii", "tcp", "pdu"] = "auto",
    role: Literal["auto", "request", "response"] = "auto",
    zone: tzinfo | None = None,
) -> Paste:
    """Pasted bytes, read as `rtuscope parse` does: `frames()`, `to_json()`. RtuscopeError where there are none.

    `zone` is that of times of day in the text (None: this machine's).
    """
    from .paste import read

    with under_base():
        return read(text, envelope, role, zone)


def build(
    function: int | str,
    *,
    unit: int,
    role: Literal["request", "response"] = "request",
    envelope: Literal["rtu", "ascii", "tcp"] = "rtu",
    transaction: int = 0,
    **fields: Any,
) -> bytes:
    """A whole frame: see `dissectors.build`. RtuscopeError says which field is missing or does not fit."""
    from dissectors.building import build as built

    with under_base():
        return built(function, unit=unit, role=role, envelope=envelope, transaction=transaction, **fields)


def listen(
    port: str,
    *,
    baud: int | None = None,
    parity: Literal["N", "E", "O", "M", "S"] = "N",
    stop_bits: float = 1,
    data_bits: int = 8,
) -> Session:
    """A session on a tap, for `with`: `steps()` gives frames and findings as they come. Nothing is ever sent.

    `port` is a device, `COM3` or an address (`socket://`, `rfc2217://`); without `baud` the settings are sought by
    listening. `steps` raises RtuscopeError where the port cannot be listened to.
    """
    from captures.live.settings import PortSettings

    from .live import Session, TapSource

    with under_base():
        return Session(TapSource([PortSettings(port, baud, parity, stop_bits, data_bits)], free_parity=baud is None))


def registers(
    capture: str | PathLike[str] | Analysis, *, units: Sequence[int] | None = None, maps: Sequence[str] = ()
) -> list[RegisterValue]:
    """What the registers of a capture mean, as `rtuscope registers` has it: by unit, area and address.

    `maps` are `MAP` or `MAP@UNIT`, which decide for their registers.
    """
    from .analysis import Analysis, open
    from .registers.inference import infer
    from .registers.readings import RegisterReadings

    bus = capture if isinstance(capture, Analysis) else open(capture)
    bus = bus.with_maps(*maps) if maps else bus
    readings = RegisterReadings()
    for batch in bus.batches():
        readings.feed(batch)
    heard = {block.unit for block in readings}
    charts = bus.maps.of(heard) if bus.maps else {}
    with under_base():
        return infer(readings, units=units, charts=charts)
