"""Taps as a session's source: what the reader gives, and the line's settings sought where they are not known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from captures.chunks import Block
from captures.line import DIRECTIONS_NOTE, LineSettings
from captures.live.baud import Search
from captures.live.listening import HOLD_NS, IDLE_NS, QUIET_NS, Listening
from captures.live.settings import PortSettings
from captures.live.wire import Item, PortEvent, Tick

from ..deframing.protocols import Deframer
from ..tables.schema import Kind, Rows

_DOUBT: Final = 400  # bytes of which hardly any makes sense: the settings are doubted
_SENSE: Final = 0.05
_SENSE_OF_TWO: Final = 0.5


class TapSource:
    """One tap, or two of which each hears one direction.

    A device whose `baud` is None has its settings sought by listening: rate, and parity if `free_parity`. What was
    heard while they were sought is given from the first byte that was heard with those found. A port server is listened
    to at its own settings; only where `seek_remote` allows it are they sought, by changing them there.
    """

    waits = False
    lost = 0  # nothing lies between a port here and the reader

    def __init__(
        self,
        ports: Sequence[PortSettings],
        *,
        hold_ns: int = HOLD_NS,
        idle_ns: int = IDLE_NS,
        wait: bool = False,
        free_parity: bool = True,
        blocking: bool = False,
        seek: bool = True,
        seek_remote: bool = False,
    ) -> None:
        self._ports = list(ports)
        self._requested = ports[0]  # what was not given is sought, however often
        self._directions = ["request", "response"]  # of the first port and the second
        self._free_parity = free_parity
        self._tap: str | None = None
        remote = seek_remote and ports[0].is_port_server
        self._seek = seek and ports[0].baud is None and (ports[0].is_device or remote)
        self._search: Search | None = None
        self._line = self._line_now()
        self._judged = self._line  # with these settings were heard, of late,
        self._heard = self._sense = 0  # so many bytes that were analysed, and those of them that are frames
        self._doubt_of: LineSettings | None = None
        self._unheard = 0  # changes of settings that the reader has not made yet
        quiet_ns = min(QUIET_NS, idle_ns)
        self._listening = Listening(
            ports, hold_ns=hold_ns, quiet_ns=quiet_ns, idle_ns=idle_ns, wait=wait, blocking=blocking
        )

    @property
    def more(self) -> bool:
        """See `SessionSource`."""
        return self._listening.more

    @property
    def line(self) -> LineSettings:
        """What is known of the line; another object each time that it is settled."""
        return self._line

    def items(self) -> Iterator[Item]:
        """What the taps give. PortError where one can't be listened to."""
        with self._listening as listening:
            for item in listening.items():
                if isinstance(item, PortEvent):
                    yield item
                    yield from self._opened(item)
                elif self._search is not None and not self._doubted:
                    yield from self._sought(item)
                else:
                    yield item  # recorded even while the settings are doubted
                    if self._doubted:
                        yield from self._swapped(item) if len(self._ports) > 1 else self._doubt(item)

    def judge(self, heard: int, sense: int, line: LineSettings) -> None:
        """Settings that stopped making sense are sought anew.

        The analysis runs behind: what it tells of settings that were left by now is no reason to doubt those that
        followed.
        """
        if line is not self._judged:
            self._judged, self._heard, self._sense = line, 0, 0
        self._heard += heard
        self._sense += sense
        if self._heard > _DOUBT:
            share = _SENSE if len(self._ports) == 1 else _SENSE_OF_TWO
            if self._sense < share * self._heard:
                self._doubt_of = line
            self._heard = self._sense = 0

    def close(self) -> None:
        """End soon."""
        self._listening.close()

    @property
    def _doubted(self) -> bool:
        return self._doubt_of is self._line

    def _line_now(self) -> LineSettings:
        line = self._ports[0].line(self._tap)
        return line if len(self._ports) < 2 else replace(line, notes={DIRECTIONS_NOTE: ",".join(self._directions)})

    def _settled(self, t_ns: int, text: str, **more: object) -> PortEvent:
        """The line is what is known by now, and doubts of what it was are over."""
        self._line = self._line_now()
        return PortEvent(t_ns, 0, "settled", text, more)

    def _opened(self, event: PortEvent) -> Iterator[Item]:
        port = self._ports[event.port]
        if event.kind == "opened" and port.is_port_server:  # its settings are the server's
            self._ports[event.port] = PortSettings.from_json({**event.more["settings"], "url": port.url})
        if event.port:
            return
        if event.kind == "settings":
            self._unheard -= 1
        if event.kind != "opened":
            return
        self._tap = event.more["tap"]
        if self._tap == "pty":  # has no rate, so there is none to find
            self._seek = False
        if self._seek and self._search is None and not event.more["back"]:
            self._line = self._line_now()
            self._begin()
            yield PortEvent(
                event.t_ns, 0, "seeking", f"detecting the line settings, starting with {self._trying()}", {}
            )
        else:
            yield self._settled(event.t_ns, f"listening: {self._words()}")

    def _begin(self) -> None:
        self._search = Search(self._requested, explained, free_parity=self._free_parity)
        self._set(self._search.settings)

    def _sought(self, item: Block | Tick) -> Iterator[Item]:
        """Feed the search; what it heard with the settings that it found is given."""
        search = self._search
        assert search is not None
        if self._unheard:  # these were heard with other settings
            return
        now = item.t_ns if isinstance(item, Tick) else int(item.t_ns[-1])
        if isinstance(item, Block):
            search.feed(item)
        tried = search.step(now)
        if tried is None:
            if isinstance(item, Tick) and not search.heard:  # time passes on a silent line too
                yield item
            return
        if search.found is None:
            self._set(search.settings)
            yield PortEvent(now, 0, "trying", f"{tried}; trying {search.settings}", {})
            return
        self._search = None
        changed = search.found != tried.settings
        self._ports = [replace(search.found, url=port.url) for port in self._ports]
        yield self._settled(now, f"{tried}: listening with {search.found}", settings=search.found.to_json())
        if changed:
            self._set(search.found)
        else:
            yield from search.heard

    def _doubt(self, item: Block | Tick) -> Iterator[Item]:
        """Seek anew as hardly anything makes sense, while what comes is recorded all the same."""
        if not self._seek:
            self._doubt_of = None
            return
        if self._search is None:
            now = item.t_ns if isinstance(item, Tick) else int(item.t_ns[-1])
            self._begin()
            yield PortEvent(now, 0, "seeking", f"{self._words()} no longer fits: detecting the settings again", {})
        else:
            for each in self._sought(item):
                if isinstance(each, PortEvent):
                    yield each

    def _swapped(self, item: Block | Tick) -> Iterator[Item]:
        """Two taps that make no sense are the other way round, most likely."""
        self._directions.reverse()
        now = item.t_ns if isinstance(item, Tick) else int(item.t_ns[-1])
        hears = " and ".join(f"{p.url} hears {d}s" for p, d in zip(self._ports, self._directions, strict=True))
        yield self._settled(now, f"that did not fit; the other way round: {hears}")

    def _set(self, settings: PortSettings) -> None:
        self._unheard += 1
        for number, port in enumerate(self._ports):
            remote = ("baud", "parity", "stop_bits", "data_bits") if port.is_port_server else ()
            self._listening.change(number, replace(settings, url=port.url, remote_changes=remote))

    def _trying(self) -> str:
        return "?" if self._search is None else str(self._search.settings)

    def _words(self) -> str:
        port = self._ports[0]
        if port.baud is not None:
            return (
                f"{port}, as the port server is set" if port.is_port_server and not self._requested.baud else str(port)
            )
        return "the port server's own settings, which it does not report" if port.is_port_server else "no rate to set"


# How much sense bytes make as Modbus: what a search for line settings goes by.


_LONGEST: Final = 256


def explained(blocks: Sequence[Block], settings: PortSettings) -> int:
    """Bytes that are frames with a right check value, when these blocks were heard with these settings.

    Listening began and ended amid a frame, perhaps: what stands before the first frame or after the last one counts as
    explained too, as far as one frame goes, once two frames do.
    """
    block = Block.joined(blocks)
    deframer = Deframer(settings.line())
    batches = [deframer.feed(block), deframer.close()]
    rows = Rows.joined([batch.rows for batch in batches])
    good = np.flatnonzero((rows.kind != Kind.NOISE) & rows.check)
    total = int(rows.length[good].sum())
    if len(good) < 2:
        return 0 if len(good) == 0 else total // 2  # one may be chance
    before = int(rows.length[: good[0]].sum())
    after = int(rows.length[good[-1] + 1 :].sum())
    return total + sum(part for part in (before, after) if part <= _LONGEST)
