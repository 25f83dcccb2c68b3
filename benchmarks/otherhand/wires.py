"""What the line does to bytes: noise, bad drops, no bias, drivers, echoes, reflections, another rate."""

from __future__ import annotations

from collections.abc import Iterable

from .line import SECOND, OtherDevice
from .sites import OtherSite, other_kind
from .spoiling import hurt, noise, sometimes, strays


@other_kind("noise", "interference", units=(1, 10))
def _noisy(site: OtherSite) -> Iterable[OtherDevice]:
    noise(site, site.random.choice((0.0004, 0.001, 0.003)))
    strays(site, 0.3)
    return []


@other_kind("noise-in-spells", "hours", "interference", units=(1, 10))
def _noisy_in_spells(site: OtherSite) -> Iterable[OtherDevice]:
    period, site.line.requests = site.random.uniform(15, 40) * SECOND, 1200
    share = site.random.uniform(0.15, 0.35)
    noise(site, site.random.choice((0.003, 0.01)), lambda t: t % period < share * period)
    strays(site, 0.5, lambda t: t % period < share * period)
    return []


@other_kind("bad-drop", "bad-drop")
def _bad_drop(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share = site.one(), site.random.choice((0.05, 0.12, 0.3, 0.5))
    unit.seals.append(sometimes(site.random, share, lambda data: hurt(site.random, data)))
    return [unit]


@other_kind("bad-drop-both-ways", "bad-drop")
def _bad_drop_both_ways(site: OtherSite) -> Iterable[OtherDevice]:
    (unit,), lost = _bad_drop(site), site.random.uniform(0.02, 0.3)
    unit.deaf.append(lambda _, __: site.random.random() < lost)
    return [unit]


@other_kind("floats", "bias", units=(1, 10), shown=False)
def _floats(site: OtherSite) -> Iterable[OtherDevice]:
    strays(site, site.random.choice((1, 3, 6)))
    return []


@other_kind("driver-late", "driver-enabled-late")
def _driver_late(site: OtherSite) -> Iterable[OtherDevice]:
    random, unit, share, lost = (
        site.random,
        site.one(),
        site.random.choice((0.3, 0.7, 1)),
        site.random.choice((1, 1, 2)),
    )

    def beheaded(data: bytes) -> bytes:
        mangled = bytes((random.choice((0xFF, 0xFE, 0xFC, data[0] | 0xF0)),)) + data[1:]
        return data[lost:] if random.random() < 0.6 else mangled

    unit.seals.append(sometimes(random, share, beheaded))
    return [unit]


@other_kind("driver-early", "driver-released-early")
def _driver_early(site: OtherSite) -> Iterable[OtherDevice]:
    random, unit, share = site.random, site.one(), site.random.choice((0.3, 0.7, 1))

    def let_go(data: bytes) -> bytes:
        last = bytes((data[-1] | random.choice((0x80, 0xC0, 0xF0)),))
        return data[:-1] + (b"" if random.random() < 0.5 else last)

    unit.seals.append(sometimes(random, share, let_go))
    return [unit]


@other_kind("echo", "local-echo", units=(1, 6), shown=False)
def _echo(site: OtherSite) -> Iterable[OtherDevice]:
    site.line.echoes = True
    for unit in site.units:
        unit.delay_ns = max(unit.delay_ns, 12 * site.line.char_ns + 2 * site.line.rest_ns)
    return []


@other_kind("reflections", "termination", units=(3, 9))
def _reflections(site: OtherSite) -> Iterable[OtherDevice]:
    random, units = site.random, site.units[-max(2, len(site.units) // 3) :]

    def bent(data: bytes) -> bytes:
        at = random.randrange(len(data))
        return data[:at] + bytes((data[at] ^ 1 << random.choice((0, 0, 0, 1)),)) + data[at + 1 :]

    for unit in units:
        unit.seals.append(sometimes(random, random.uniform(0.08, 0.3), bent))
    return units


@other_kind("half-rate", "unit-line-settings", units=(2, 6))
def _half_rate(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    unit.seals.append(_at_half_rate)
    return [unit]


def _at_half_rate(data: bytes) -> bytes:
    bits = [bit for byte in data for bit in (0, *(byte >> i & 1 for i in range(8)), 1) for _ in (0, 1)] + [1] * 24
    found, at = bytearray(), 0
    while at < len(bits) - 10:
        if not bits[at]:
            found.append(sum(bits[at + 1 + i] << i for i in range(8)))
            at += 9
        at += 1
    return bytes(found)


# Without a word.
