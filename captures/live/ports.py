"""The serial ports of this machine, what is known of them, and ports being opened.

Each attempt to open one is in a thread of its own: a gateway that does not answer keeps nobody waiting.
"""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from .settings import PortSettings
from .tap import DeviceTap, PortError, Tap, access_advice, latency_ms, may_listen, programs_by_device, real_device


@dataclass(frozen=True, slots=True)
class PortInfo:
    """A serial port; None for what the system does not tell.

    `link` is a name that stays the same wherever the adapter is plugged in; `used_by` are programs that have it open,
    as far as this user may see them.
    """

    device: str
    description: str | None = None
    usb: str | None = None  # VID:PID in hex
    serial: str | None = None
    manufacturer: str | None = None
    driver: str | None = None
    link: str | None = None
    latency_ms: int | None = None
    allowed: bool = True  # this user may listen to it
    advice: str | None = None  # what to do where not
    used_by: list[str] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """All of it."""
        return asdict(self)


def ports() -> list[PortInfo]:
    """The ports that are there, by name; those of a mainboard only where there is hardware behind them. PortError."""
    links, users = _links(), programs_by_device()
    return sorted((_info(port, links, users) for port in _listed()), key=lambda info: info.device)


def _info(port: Any, links: dict[str, str], users: dict[str, list[str]]) -> PortInfo:
    def known(text: str | None) -> str | None:
        return None if text in (None, "", "n/a") else text

    driver = Path(os.path.realpath(f"/sys/class/tty/{port.name}/device/driver")).name
    return PortInfo(
        device=port.device,
        description=known(port.description),
        usb=None if port.vid is None else f"{port.vid:04x}:{port.pid:04x}",
        serial=known(port.serial_number),
        manufacturer=known(port.manufacturer),
        driver=None if driver == "driver" else driver,
        link=links.get(real_device(port.device)),
        latency_ms=latency_ms(port.device),
        allowed=may_listen(port.device),
        advice=None if may_listen(port.device) else access_advice(port.device),
        used_by=users.get(real_device(port.device), []),
    )


def _links() -> dict[str, str]:
    """Lasting names by device."""
    links: dict[str, str] = {}
    with suppress(OSError):
        for link in sorted(Path("/dev/serial/by-id").iterdir()):
            links.setdefault(real_device(str(link)), str(link))
    return links


@dataclass
class Identity:
    """Which adapter a port was, so that it is found again when it comes back under another name.

    A convenience: where the system cannot list its adapters, a port is only known by its name.
    """

    _usb: tuple[Any, ...] | None = None

    def learn(self, settings: PortSettings) -> None:
        """Remember what is open now."""
        if settings.is_device:
            self._usb = next((usb for device, usb in _usb_adapters() if device == real_device(settings.url)), None)

    def found(self, settings: PortSettings) -> PortSettings:
        """The settings with the name that the adapter has now; as they are where it has none, or its own."""
        if self._usb is None or (os.name == "posix" and Path(settings.url).exists()):
            return settings
        names = [device for device, usb in _usb_adapters() if usb == self._usb]
        return replace(settings, url=names[0]) if len(names) == 1 else settings


def _usb_adapters() -> list[tuple[str, tuple[Any, ...]]]:
    """USB ports by device, with what tells one adapter from another; none where they cannot be listed."""
    with suppress(PortError):
        adapters = [port for port in _listed() if port.vid is not None and port.serial_number]
        return [(real_device(p.device), (p.vid, p.pid, p.serial_number, p.interface)) for p in adapters]
    return []


def _listed() -> list[Any]:
    """pyserial's list of ports, which asks the system by many ways; each can fail in its own: PortError."""
    try:
        from serial.tools import list_ports

        return list(list_ports.comports())
    except Exception as error:
        raise PortError(f"this computer's serial ports cannot be listed: {type(error).__name__}: {error}") from error


def open_tap(settings: PortSettings, *, blocking: bool = False) -> Tap:
    """An open port; PortError says in one line why it can't be. `blocking`: without a descriptor to wait on."""
    if settings.is_device:
        return DeviceTap(settings, blocking=blocking)
    from .gateway import PortServerTap, SocketTap

    kinds = {"socket": SocketTap, "rfc2217": PortServerTap}
    scheme = settings.url.partition("://")[0].lower()
    if scheme not in kinds:
        schemes = ", ".join([*(f"{name}://HOST:PORT" for name in kinds), "tap://HOST"])  # that is no port of a machine
        raise PortError(f"{settings.url}: cannot listen to {scheme}://: use a serial device or {schemes}")
    return kinds[scheme](settings, blocking=blocking)


class Attempts:
    """Attempts that go on; `wake` is called, in any thread, each time that one is over."""

    def __init__(self, wake: Callable[[], object], *, blocking: bool) -> None:
        self._wake = wake
        self._blocking = blocking
        self._over: queue.SimpleQueue[tuple[int, Tap | PortError]] = queue.SimpleQueue()

    def begin(self, number: int, settings: PortSettings, identity: Identity) -> None:
        """Try to open a port, under the name that its adapter has now."""
        threading.Thread(target=self._try, args=(number, settings, identity), daemon=True).start()

    def take_opened(self) -> list[tuple[int, Tap | PortError]]:
        """Those that are over, by the number of their port: a tap, or why there is none."""
        over = []
        while not self._over.empty():
            over.append(self._over.get())
        return over

    def _try(self, number: int, settings: PortSettings, identity: Identity) -> None:
        result: Tap | PortError
        try:
            settings = identity.found(settings)
            result = open_tap(settings, blocking=self._blocking)
            identity.learn(settings)
        except PortError as error:
            result = error
        except Exception as error:  # a driver or library that fails in its own way: the port may come back
            result = PortError(f"{settings.url}: cannot be opened: {type(error).__name__}: {error}")
        self._over.put((number, result))
        self._wake()
