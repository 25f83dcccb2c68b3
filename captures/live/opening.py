"""Ports being opened, each attempt in a thread of its own: a gateway that does not answer keeps nobody waiting."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

from .gateway import SocketTap
from .ports import Identity
from .rfc2217 import PortServerTap
from .settings import PortSettings
from .tap import DeviceTap, PortError, Tap

_KINDS = {"socket": SocketTap, "rfc2217": PortServerTap}


def open_tap(settings: PortSettings, *, blocking: bool = False) -> Tap:
    """An open port; PortError says in one line why it can't be. `blocking`: without a descriptor to wait on."""
    if settings.is_device:
        return DeviceTap(settings, blocking=blocking)
    scheme = settings.url.partition("://")[0].lower()
    if scheme not in _KINDS:
        schemes = ", ".join(f"{name}://HOST:PORT" for name in _KINDS)
        raise PortError(f"{settings.url}: no way to listen by {scheme}://: there are serial devices and {schemes}")
    return _KINDS[scheme](settings, blocking=blocking)


class Attempts:
    """Attempts that go on; `wake` is called, in any thread, each time that one is over."""

    def __init__(self, wake: Callable[[], object], *, blocking: bool) -> None:
        self._wake = wake
        self._blocking = blocking
        self._over: queue.SimpleQueue[tuple[int, Tap | PortError]] = queue.SimpleQueue()

    def begin(self, number: int, settings: PortSettings, identity: Identity) -> None:
        """Try to open a port, under the name that its adapter has now."""
        threading.Thread(target=self._try, args=(number, settings, identity), daemon=True).start()

    def take(self) -> list[tuple[int, Tap | PortError]]:
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
