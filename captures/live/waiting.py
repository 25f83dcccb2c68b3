"""One wait for several descriptors.

On Linux by epoll, which is told once what to wait for, and tells of a terminal only that more has come: a terminal that
is asked while it is empty waits for the kernel's worker that fills it, which cost as much as the read. Elsewhere by
select.
"""

from __future__ import annotations

import select
import sys
from collections.abc import Collection

if sys.platform == "linux":
    _GONE = select.EPOLLHUP | select.EPOLLERR

    class Waiting:
        """`terminals` are told once each time that more has come, and must be read empty then; `others`, as long as
        there is something; `writable`, as long as there is room."""

        def __init__(self, terminals: Collection[int], others: Collection[int], writable: Collection[int]) -> None:
            self._terminals = frozenset(terminals)
            self._epoll = select.epoll()
            for descriptor in terminals:
                self._epoll.register(descriptor, select.EPOLLIN | select.EPOLLET)
            for descriptor in others:
                self._epoll.register(descriptor, select.EPOLLIN)
            for descriptor in writable:
                self._epoll.register(descriptor, select.EPOLLOUT)

        def ready(self, wait_s: float) -> list[int]:
            """Those with something, or room, as soon as there are any; none after so long."""
            ready = []
            for descriptor, events in self._epoll.poll(wait_s):
                ready.append(descriptor)
                if events & _GONE and descriptor in self._terminals:  # behind what it still has: told until let go of
                    self._epoll.modify(descriptor, select.EPOLLIN)
            return ready

        def close(self) -> None:
            """Wait for nothing any more."""
            self._epoll.close()

else:

    class Waiting:
        """As on Linux; terminals, too, are told as long as there is something."""

        def __init__(self, terminals: Collection[int], others: Collection[int], writable: Collection[int]) -> None:
            self._readable, self._writable = [*terminals, *others], list(writable)

        def ready(self, wait_s: float) -> list[int]:
            readable, writable, _ = select.select(self._readable, self._writable, (), wait_s)
            return [*readable, *writable]

        def close(self) -> None: ...
