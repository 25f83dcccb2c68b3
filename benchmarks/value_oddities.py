"""Buses whose values surprise, and are right: eleven kinds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from typing import Final

from value_devices import SHORT, Channel, ValueSite, read_pdu


def _night(random: Random, site: ValueSite) -> None:
    """The plant is off for a while: what it measures is 0, its counters stand, and it goes on."""
    off = 0.3 * site.long_s, random.choice((0.6, 2.0)) * site.long_s
    for device in site.devices[: random.randint(1, len(site.devices))]:
        for each in device.channels:
            if each.kind in ("measured", "float", "signed"):
                each.words = lambda t, w=each.words, n=each.width: [0] * n if off[0] <= t < off[1] else w(t)  # type: ignore[misc]
            if "counter" in each.kind:
                each.words = lambda t, w=each.words: w(min(t, off[0]) + max(t - off[1], 0))  # type: ignore[misc]


def _batches(random: Random, site: ValueSite) -> None:
    """Counters of a batch begin at 0 with each batch, at regular times or when somebody presses a button."""
    every = random.uniform(0.15, 0.4) * site.long_s
    for device in site.devices:
        for each in device.channels:
            if each.kind == "counter" and each.value is not None:
                each.words = lambda t, v=each.value: list(divmod(int(v(t) - v(t // every * every)), SHORT))  # type: ignore[misc]


def _loads(random: Random, site: ValueSite) -> None:
    """Loads are switched: what is measured steps by large factors."""
    every = random.uniform(0.1, 0.3) * site.long_s
    for device in site.devices:
        for each in device.channels:
            if each.kind == "measured" and each.value is not None:
                by = random.choice((3, 8, 10, 12, 20))
                each.words = lambda t, v=each.value, by=by: [round(v(t) * (by if int(t / every) % 2 else 1)) % SHORT]  # type: ignore[misc]


def _clock(random: Random, site: ValueSite) -> None:
    """Registers of a clock, seconds since 1970 among them, which is set once."""
    device, at = site.victim, site.since()
    by, begin = random.choice((-3600, 3600, -37, 912)), 1_700_000_000 + random.randrange(10**7)

    def clock(t: float) -> list[int]:
        now = int(begin + t + (by if t >= at else 0))
        return [*divmod(now, SHORT), now // 3600 % 24, now // 60 % 60, now % 60]

    device.channels.append(Channel("clock", 5, clock))
    first = device.base + device.place(len(device.channels) - 1)
    for area in device.areas:
        device.areas[area] = [(device.base, first + 5)]
    site.polls.append((device.unit, read_pdu(site.function, first, 5)))


def _saturated(_: Random, site: ValueSite) -> None:
    """Tanks that are full, valves that are open: values stand at the end of their range for long."""
    for device in site.devices:
        for each in device.channels:
            if each.kind == "measured" and each.value is not None:
                each.words = lambda t, v=each.value: [min(max(round(abs(v(t)) * 3), 0), round(abs(v(0)) * 3) + 1)]  # type: ignore[misc]


def _limit(random: Random, site: ValueSite) -> None:
    """A measured value runs into the end of its range and stays there: nothing proves that it is wrong."""
    since, most = site.since(), random.choice((4095, 20000, 32000, 27648))
    for each in site.victim.channels:
        if each.kind == "measured":
            each.words = lambda t, words=each.words: [most] if t >= since else words(t)  # type: ignore[misc]
            return


def _slow_measure(random: Random, site: ValueSite) -> None:
    """Units that measure every half minute or so; in between all stands still."""
    every = random.uniform(8, 40)
    for device in site.devices:
        words = device.words
        device.words = lambda t, words=words: words(t // every * every)  # type: ignore[method-assign, misc]


def _makes(random: Random, site: ValueSite) -> None:
    """Devices of other makes at the same addresses, words the other way round."""
    for device in site.devices[1:]:
        random.shuffle(device.channels)
        device.swaps = not device.swaps


def _switched(random: Random, site: ValueSite) -> None:
    """A bit mask that is all ones at times, and inputs that nothing is connected to."""
    for device in site.devices:
        every = random.uniform(5, 60)
        for each in device.channels:
            if each.kind == "state":
                each.words = lambda t, every=every: [0xFFFF if int(t / every) % 3 == 0 else 0]  # type: ignore[misc]
            if each.kind == "setting":
                code = random.choice((0x7FFF, 0x8000, 0xFFFF))
                each.words = lambda _, code=code: [code]  # type: ignore[misc]


def _restarted(_: Random, site: ValueSite) -> None:
    """A unit restarts once, its hour counter of the day begins anew; meanwhile it is silent."""
    device, at = site.victim, site.since()
    device.is_down = lambda t: at <= t < at + 4
    for each in device.channels:
        if each.kind == "short counter" and each.value is not None:
            each.words = lambda t, w=each.words, v=each.value: w(t) if t < at else [int(v(t - at))]  # type: ignore[misc]


WELL: Final[Mapping[str, Callable[[Random, ValueSite], None]]] = {
    "plain": lambda _random, _site: None, "night": _night, "batches": _batches, "loads": _loads, "clock": _clock,
    "saturated": _saturated, "limit": _limit, "slow-measure": _slow_measure, "makes": _makes, "switched": _switched,
    "restarted": _restarted,
}  # fmt: skip
