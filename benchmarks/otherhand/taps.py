"""What taps leave out."""

from __future__ import annotations

from collections.abc import Iterable

from .line import OtherDevice
from .sites import OtherSite, other_kind


@other_kind("tap-loses", "tap-loses", units=(1, 10), shown=False)
def _tap_loses(site: OtherSite) -> Iterable[OtherDevice]:
    random, rate = site.random, site.random.choice((0.002, 0.004, 0.008))

    def lossy(octets: list[tuple[float, int]]) -> list[tuple[float, int]]:
        found, skip = list[tuple[float, int]](), 0
        for octet in octets:
            skip = skip - 1 if skip else random.randint(1, 6) if random.random() < rate else 0
            found += [] if skip else [octet]
        return found

    site.line.taps.append(lossy)
    return []


@other_kind("one-direction", "tap-one-direction", units=(1, 10), shown=False)
def _one_direction(site: OtherSite) -> Iterable[OtherDevice]:
    role, line = site.random.choice(("request", "answer")), site.line
    line.finish.append(lambda: line.spells.__setitem__(slice(None), [s for s in line.spells if s.role == role]))
    return []
