"""What units answer: exceptions, another check value, zeros behind, answers that are cut."""

from __future__ import annotations

from collections.abc import Iterable
from struct import unpack

from dissectors.crc import crc_ok

from .line import SECOND, OtherDevice, OtherPoll
from .sites import OtherSite, other_kind, read
from .spoiling import refuse


@other_kind("missing", "missing-registers", "cannot-serve", "off-by-one", units=(1, 6), shown=False)
def _missing(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    pdu = read(3, site.random.choice((500, 2000, 30000)), site.random.choice((1, 4, 10)))
    site.client.polls.append(OtherPoll(unit.number, pdu, 2))
    refuse(unit, 2, lambda asked, _: asked == pdu)
    return [unit]


@other_kind("too-many", "cannot-serve", "missing-registers", units=(1, 6), shown=False)
def _too_many(site: OtherSite) -> Iterable[OtherDevice]:
    unit, silent = site.one(), site.random.random() < 0.5
    quantities = (site.random.choice((40, 60, 100)), 4, site.random.choice((8, 16)))
    site.client.polls += [OtherPoll(unit.number, read(3, 700 + 10 * i, n), 2) for i, n in enumerate(quantities)]

    def most(pdu: bytes, answer: bytes, _: float) -> bytes | None:
        over = pdu[0] in (3, 4) and unpack(">H", pdu[3:5])[0] > 32
        return answer if not over else None if silent else bytes((pdu[0] | 0x80, 3))

    unit.tampers.append(most)
    return [unit]


@other_kind("busy", "unit-busy", units=(1, 6), shown=False)
def _busy(site: OtherSite) -> Iterable[OtherDevice]:
    unit, period, share = site.one(), site.random.uniform(5, 20) * SECOND, site.random.uniform(0.1, 0.4)
    refuse(unit, 6, lambda _, t: t % period < share * period)
    return [unit]


@other_kind("fails", "unit-fails", units=(1, 6), shown=False)
def _fails(site: OtherSite) -> Iterable[OtherDevice]:
    unit, since = site.one(), site.random.choice((0.0, 0.4))
    refuse(unit, 4, lambda _, __: site.line.share >= since)
    return [unit]


@other_kind("zeros", "null-suffix", units=(1, 6), shown=False)
def _zeros(site: OtherSite) -> Iterable[OtherDevice]:
    unit, tail = site.one(), bytes(site.random.randint(1, 3))
    unit.seals.append(lambda data: data + tail)
    site.client.ears.append(lambda data: data[: -len(tail)] if crc_ok(data[: -len(tail)]) else data)
    return [unit]


@other_kind("exchanged-check", "crc-convention", units=(2, 6))
def _exchanged_check(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    unit.seals.append(lambda data: data[:-2] + data[-1:] + data[-2:-1])
    return [unit]


@other_kind("cut", "cut-at-length", units=(1, 6))
def _cut(site: OtherSite) -> Iterable[OtherDevice]:
    unit, length = site.one(), site.random.choice((32, 48, 64))
    site.client.polls += [OtherPoll(unit.number, read(3, 700, 60), 2), OtherPoll(unit.number, read(3, 0, 4), 2)]
    unit.seals.append(lambda data: data[:length])
    return [unit]
