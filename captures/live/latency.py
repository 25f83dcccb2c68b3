"""Adapters made prompt: a byte told when it comes, not when a buffer is full or a timer runs out.

The kernel's low-latency flag does it for most drivers; FTDI's have a timer besides, 16 ms by default, in sysfs.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

PROMPT_MS: Final = 1


def latency_timer(device: str) -> Path | None:
    """The file with the latency timer (ms) of an FTDI adapter; None where there is none."""
    path = Path("/sys/bus/usb-serial/devices") / Path(os.path.realpath(device)).name / "latency_timer"
    return path if path.exists() else None


def latency_ms(device: str) -> int | None:
    """The latency timer of an adapter, ms; None where it has none."""
    path = latency_timer(device)
    try:
        return None if path is None else int(path.read_text())
    except (OSError, ValueError):
        return None


def make_prompt(port: Any, device: str) -> list[str]:
    """Ask the driver of an open port to be prompt; what could not be done, with the command that would."""
    with suppress(AttributeError, NotImplementedError, ValueError, OSError):  # not this driver, or not this system
        port.set_low_latency_mode(True)
    path = latency_timer(device)
    if path is None or (latency_ms(device) or 0) <= PROMPT_MS:
        return []
    try:
        path.write_text(f"{PROMPT_MS}\n")
    except OSError:
        return [
            f"{device}: the adapter holds bytes back for {latency_ms(device)} ms, so that silences cannot be told: "
            f"`echo {PROMPT_MS} | sudo tee {path}`"
        ]
    return []
