"""Whether this user may listen to a device, who has it open already, and what to do about either."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

# Groups that distributions made for serial ports. To be in another, as root or disk, gives rights over the machine.
_GROUPS: Final = frozenset({"dialout", "uucp", "plugdev", "serial"})
_RULE: Final = "give it to group dialout by a udev rule (docs/live.md, `A device that may not be opened`)"


def real_device(device: str) -> str:
    """The device that a name leads to. On Windows the name itself: to ask where it leads would open the port."""
    return device.upper() if os.name == "nt" else os.path.realpath(device)


def may_listen(device: str) -> bool:
    """Whether this user may open it for reading; where that is not told by a file's mode, it is taken to be so."""
    return os.name == "nt" or os.access(device, os.R_OK)


def access_advice(device: str) -> str:
    """What someone does who may not open a device."""
    if not sys.platform.startswith("linux"):
        return "ask whoever administers this computer"
    group = _serial_group(device)
    if group is None:
        return f"no group that is for serial ports may read it; {_RULE}"
    return f"`sudo usermod -aG {group} $USER`, then log in again"


def _serial_group(device: str) -> str | None:
    """The group to be in, if there is one that is for serial ports and may read the device."""
    try:
        group, mode = Path(device).group(), Path(device).stat().st_mode
    except (OSError, KeyError, NotImplementedError):
        return None
    return group if group in _GROUPS and mode & stat.S_IRGRP else None


def programs_using(device: str) -> list[str]:
    """Other programs that have this device open, as far as /proc shows them to this user: `name (process)`."""
    return programs_by_device().get(real_device(device), [])


def programs_by_device() -> dict[str, list[str]]:
    """Other programs that have terminal devices open, by device."""
    users: dict[str, list[str]] = {}
    for process, device in _open_devices():
        with suppress(OSError):
            who = f"{(process / 'comm').read_text().strip()} ({process.name})"
            programs = users.setdefault(device, [])
            if who not in programs:
                programs.append(who)
    return users


def _open_devices() -> Iterator[tuple[Path, str]]:
    if not sys.platform.startswith("linux"):
        return
    own = str(os.getpid())
    with suppress(OSError):
        for process in Path("/proc").glob("[0-9]*"):
            if process.name == own:
                continue
            with suppress(OSError):
                for descriptor in (process / "fd").iterdir():
                    with suppress(OSError):
                        target = os.readlink(descriptor)  # noqa: PTH115 - a string is wanted
                        if target.startswith(("/dev/tty", "/dev/pts/")):
                            yield process, target
