"""Units that stay silent: dead, away now and then, or a whole part of the line."""

from __future__ import annotations

import math
from collections.abc import Iterable

from .line import SECOND, OtherDevice
from .sites import OtherSite, other_kind


@other_kind("dead", "dead-unit", "absent-units", "retry-policy", units=(2, 10))
def _dead(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    unit.deaf.append(lambda _, __: True)
    return [unit]


@other_kind("died", "dead-unit", "unit-restarts")
def _died(site: OtherSite) -> Iterable[OtherDevice]:
    unit, since = site.one(), site.random.uniform(0.3, 0.8)
    unit.deaf.append(lambda _, __: site.line.share > since)
    return [unit]


@other_kind("absent", "absent-units", "dead-unit", units=(4, 10))
def _absent(site: OtherSite) -> Iterable[OtherDevice]:
    units = site.random.sample(site.units, site.random.randint(2, 3))
    for unit in units:
        unit.deaf.append(lambda _, __: True)
    return units


@other_kind("restarts", "unit-restarts")
def _restarts(site: OtherSite) -> Iterable[OtherDevice]:
    unit, away = site.one(), site.random.uniform(2, 9) * SECOND
    period, site.client.skips, site.line.requests = away * site.random.uniform(2.5, 7), 0, 1500
    unit.deaf.append(lambda _, t: (t + 0.3 * period * math.sin(t / period)) % period < away)
    return [unit]


@other_kind("segment", "all-silent", units=(4, 9))
def _segment(site: OtherSite) -> Iterable[OtherDevice]:
    units, period = site.random.sample(site.units, 3), site.random.uniform(15, 40) * SECOND
    away, site.client.skips, site.line.requests = site.random.uniform(4, 8) * SECOND, 0, 1300
    for unit in units:
        unit.deaf.append(lambda _, t: t % period < away)
    return units
