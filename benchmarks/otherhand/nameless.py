"""Faults that have no word."""

from __future__ import annotations

from collections.abc import Iterable

from dissectors.crc import crc_ok

from .line import SECOND, OtherDevice, OtherPoll, adu
from .sites import OtherSite, other_kind, read, writes
from .spoiling import refuse, sometimes


@other_kind("ignores-the-same", also=("cannot-serve",), units=(1, 6))
def _ignores_the_same(site: OtherSite) -> Iterable[OtherDevice]:
    unit, last = site.one(), [b""]
    at = next(i for i, poll in enumerate(site.client.polls) if poll.unit == unit.number)
    site.client.polls.insert(at + 1, OtherPoll(unit.number, site.client.polls[at].pdu))
    site.client.retries = site.random.choice((1, 2))

    def same(data: bytes, _: float) -> bool:
        again = data[0] == unit.number and data == last[0]
        last[0] = b"" if again else data
        return again

    unit.deaf.append(same)
    return [unit]


@other_kind("weak-ear", also=("unit-restarts", "bad-drop"))
def _weak_ear(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share = site.one(), site.random.choice((0.05, 0.15, 0.4))
    unit.deaf.append(lambda _, __: site.random.random() < share)
    return [unit]


@other_kind("weak-ears", also=("interference", "termination", "bad-drop"), units=(3, 8))
def _weak_ears(site: OtherSite) -> Iterable[OtherDevice]:
    units, share = site.some(2), site.random.uniform(0.05, 0.3)
    for unit in units:
        unit.deaf.append(lambda _, __: site.random.random() < share)
    return units


@other_kind("wrong-check", also=("bad-drop", "same-damage", "unit-line-settings"), units=(2, 6))
def _wrong_check(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share = site.one(), site.random.uniform(0.05, 0.4)
    unit.seals.append(sometimes(site.random, share, lambda data: data[:-1] + bytes((data[-1] ^ 0x5A,))))
    return [unit]


@other_kind("deaf-after-write", also=("unit-restarts",), units=(2, 6))
def _deaf_after_write(site: OtherSite) -> Iterable[OtherDevice]:
    unit, last, long = site.one(), [-SECOND * 99], site.random.uniform(0.3, 1.5) * SECOND
    site.client.polls.append(OtherPoll(unit.number, writes(site.random, 901), site.random.choice((3, 6))))

    def storing(data: bytes, now: float) -> bool:
        deaf = now - last[0] < long
        last[0] = now if data[:2] == bytes((unit.number, 6)) and not deaf else last[0]
        return deaf

    unit.deaf.append(storing)
    return [unit]


@other_kind("client-deaf", also=("timeout-too-short",), units=(2, 6))
def _client_deaf(site: OtherSite) -> Iterable[OtherDevice]:
    share = site.random.uniform(0.05, 0.4)
    site.client.ears.append(sometimes(site.random, share, lambda _: b""))
    return []


@other_kind("stale", also=("duplicate-address", "values-under-wrong-registers", "same-damage"), units=(2, 6))
def _stale(site: OtherSite) -> Iterable[OtherDevice]:
    unit, before, share = site.one(), [b""], site.random.uniform(0.05, 0.3)
    site.client.polls += [OtherPoll(unit.number, read(3, 500, 3)), OtherPoll(unit.number, read(3, 520, 9))]

    def old(_: bytes, answer: bytes, __: float) -> bytes:
        kept, before[0] = before[0], answer
        return kept if kept and site.random.random() < share else answer

    unit.tampers.append(old)
    return [unit]


@other_kind("tail", also=("same-damage", "null-suffix", "driver-held", "bias"), units=(2, 6), shown=False)
def _tail(site: OtherSite) -> Iterable[OtherDevice]:
    random, unit, share = site.random, site.one(), site.random.uniform(0.1, 0.8)
    unit.seals.append(sometimes(random, share, lambda data: data + random.randbytes(random.randint(1, 5))))
    site.client.ears.append(_whole_part)
    return [unit]


def _whole_part(data: bytes) -> bytes:
    """The first part of it with a right check value, from any byte of the beginning on."""
    parts = (data[a:b] for a in range(9) for b in range(a + 5, len(data) + 1))
    return next((part for part in parts if crc_ok(part)), data)


@other_kind("lead", also=("driver-enabled-late", "same-damage"), units=(2, 6), shown=False)
def _lead(site: OtherSite) -> Iterable[OtherDevice]:
    unit, byte, share = site.one(), bytes((site.random.choice((0, 0x80, 0xFF)),)), site.random.choice((0.5, 1))
    unit.seals.append(sometimes(site.random, share, lambda data: byte + data))
    site.client.ears.append(_whole_part)
    return [unit]


@other_kind("refuses-by-chance", also=("unit-busy", "unit-fails"), units=(1, 6), shown=False)
def _refuses_by_chance(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share, code = site.one(), site.random.uniform(0.05, 0.3), site.random.choice((1, 2, 3, 4, 11))
    refuse(unit, code, lambda _, __: site.random.random() < share)
    return [unit]


@other_kind("silent-behind-one", units=(3, 6))
def _silent_behind_one(site: OtherSite) -> Iterable[OtherDevice]:
    unit, other, share = *site.random.sample(site.units, 2), site.random.uniform(0.6, 1)

    def behind(_: bytes, now: float) -> bool:
        answers = [each for each in site.line.spells[-6:] if each.role == "answer" and each.end < now]
        return bool(answers) and answers[-1].sender is other and site.random.random() < share

    unit.deaf.append(behind)
    return [unit]


@other_kind("signs-as-another", also=("same-damage",), units=(2, 6))
def _signs_as_another(site: OtherSite) -> Iterable[OtherDevice]:
    unit, other = site.random.sample(site.units, 2)
    unit.seals.append(sometimes(site.random, site.random.choice((0.3, 1)), lambda data: adu(other.number, data[1:-2])))
    return [unit]


# All is well.
