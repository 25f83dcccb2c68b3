"""Limits of acceptance: what each claim is held to, and the file by which a site sets its own.

A claim passes where its upper bound is not above `pass`, and fails where its lower bound is above `fail`. The reasons
of the defaults stand in docs/certificate.md.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from ...errors import RtuscopeError
from ...meant import did_you_mean

MS: Final = 1_000_000


class LimitsError(RtuscopeError):
    """A file of limits that cannot be used: where, what, what to do."""


@dataclass(frozen=True, slots=True)
class ClaimLimit:
    """`passes` and `fails`: shares from 0 to 1, times in ns; `quantile`: of which the claim speaks, None for shares."""

    passes: float
    fails: float
    quantile: float | None = None
    timed: bool = False


DEFAULTS: Final[Mapping[str, ClaimLimit]] = {
    "lost": ClaimLimit(0.001, 0.01),
    "damaged": ClaimLimit(0.001, 0.01),
    "exceptions": ClaimLimit(0.01, 0.1),
    "retries": ClaimLimit(0.001, 0.01),
    "response": ClaimLimit(500 * MS, 1000 * MS, 0.99, timed=True),
    "load": ClaimLimit(0.95, 0.99, 0.95),
}
CONFIDENCE: Final = 0.95
_OF_LINE: Final = "load"
_KEYS: Final = {"passes": "pass", "fails": "fail"}
_LAST_UNIT: Final = 255


@dataclass(frozen=True, slots=True)
class AcceptanceLimits:
    """The limits of a line, of single units where they are others, and how sure a bound is."""

    claims: Mapping[str, ClaimLimit]
    units: Mapping[int, Mapping[str, ClaimLimit]]
    confidence: float = CONFIDENCE

    def of(self, claim: str, unit: int | None) -> ClaimLimit:
        """What a claim about a unit, or about the line (None), is held to."""
        own = {} if unit is None else self.units.get(unit, {})
        return own.get(claim) or self.claims[claim]

    def to_json(self) -> dict[str, Any]:
        """As in a file of limits."""
        units = {str(unit): _tables(claims) for unit, claims in self.units.items()}
        return {"confidence": self.confidence, **_tables(self.claims), **({"unit": units} if units else {})}


def _tables(claims: Mapping[str, ClaimLimit]) -> dict[str, dict[str, float]]:
    return {name: _table(limit) for name, limit in claims.items()}


def _table(limit: ClaimLimit) -> dict[str, float]:
    scale, ending = (MS, "_ms") if limit.timed else (1, "")
    table = {f"{key}{ending}": getattr(limit, name) / scale for name, key in _KEYS.items()}
    return table if limit.quantile is None else {**table, "quantile": limit.quantile}


def default_limits() -> AcceptanceLimits:
    """What holds without a file."""
    return AcceptanceLimits(DEFAULTS, {})


def load_limits(path: str | Path) -> AcceptanceLimits:
    """The limits of a TOML file; what it leaves out is as by default. Raises LimitsError and OSError."""
    try:
        document = tomllib.loads(Path(path).read_bytes().decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise LimitsError(f"{path}: is not a TOML file: {error}") from error
    except RecursionError as error:
        raise LimitsError(f"{path}: nested too deeply") from error
    confidence = _number(f"{path}: confidence", document.pop("confidence", CONFIDENCE), 0.5, 0.999999)
    units = document.pop("unit", {})
    claims = {**DEFAULTS, **_claims(str(path), document, DEFAULTS)}
    return AcceptanceLimits(claims, dict(_units(str(path), units, claims)), confidence)


def _units(path: str, units: object, claims: Mapping[str, ClaimLimit]) -> dict[int, dict[str, ClaimLimit]]:
    if not isinstance(units, dict):
        raise LimitsError(f"{path}: unit: must hold a table for each unit, such as [unit.17.lost]")
    made = {}
    for name, tables in units.items():
        where = f"{path}: unit.{name}"
        if not (name.isascii() and name.isdecimal() and int(name) <= _LAST_UNIT) or not isinstance(tables, dict):
            raise LimitsError(f"{where}: a unit must be a number from 0 to {_LAST_UNIT} and hold tables")
        if _OF_LINE in tables:
            raise LimitsError(f"{where}: the load belongs to the line, not to a unit")
        made[int(name)] = _claims(where, tables, claims)
    return made


def _claims(where: str, tables: Mapping[str, Any], bases: Mapping[str, ClaimLimit]) -> dict[str, ClaimLimit]:
    made = {}
    for name, table in tables.items():
        if name not in bases:
            near = did_you_mean(name, bases)
            raise LimitsError(f"{where}: no claim {name!r}{near}: choose from {', '.join(bases)}")
        if not isinstance(table, dict):
            raise LimitsError(f"{where}: {name}: must be a table, such as [{name}]")
        made[name] = _limit(f"{where}: {name}", table, bases[name])
    return made


def _limit(where: str, table: Mapping[str, Any], base: ClaimLimit) -> ClaimLimit:
    scale, most, ending = (MS, 1e6, "_ms") if base.timed else (1, 0.999999, "")
    keys = {f"{key}{ending}": name for name, key in _KEYS.items()}
    if base.quantile is not None:
        keys["quantile"] = "quantile"
    changes: dict[str, Any] = {}
    for key, value in table.items():
        if key not in keys:
            raise LimitsError(f"{where}: no key {key!r}: choose from {', '.join(keys)}")
        if key == "quantile":
            changes["quantile"] = _number(f"{where}: {key}", value, 0.5, 0.9999)
        else:
            changes[keys[key]] = _number(f"{where}: {key}", value, 1e-6, most) * scale
    limit = replace(base, **changes)
    if limit.fails < limit.passes and "fails" not in changes:
        limit = replace(limit, fails=limit.passes)
    if limit.fails < limit.passes:
        raise LimitsError(f"{where}: fail is lower than pass")
    return limit


def _number(where: str, value: object, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise LimitsError(f"{where}: must be a number from {least:g} to {most:g}")
    return float(value)
