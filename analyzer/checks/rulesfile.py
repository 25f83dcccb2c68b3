"""Rules in a TOML file: a `[[rule]]` each, with `check`, and if wanted `name` and `severity` (error or warning)."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from captures.line import LineSettings

from .errors import CheckError
from .model import Check
from .parsing import compile_check

if TYPE_CHECKING:
    from dissectors.maps.units import UnitMaps

_KEYS: Final = ("name", "check", "severity")
_SEVERITIES: Final = ("error", "warning")


class RulesFileError(Exception):
    """A file of rules that cannot be used: which file, which rule, what to do."""


def load_rules(path: str | Path, line: LineSettings | None = None, charts: UnitMaps | None = None) -> list[Check]:
    """The rules of a file, for a line of these settings, with names from register maps.

    Raises RulesFileError and OSError.
    """
    try:
        document = tomllib.loads(Path(path).read_bytes().decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RulesFileError(f"{path}: is no TOML: {error}") from error
    except RecursionError as error:
        raise RulesFileError(f"{path}: nested too deeply") from error
    rules = document.get("rule")
    if set(document) != {"rule"} or not isinstance(rules, list) or not all(isinstance(rule, dict) for rule in rules):
        raise RulesFileError(f'{path}: holds [[rule]] tables alone, each with check = "no crc errors"')
    return [_rule(f"{path}: rule {number}", rule, line, charts) for number, rule in enumerate(rules, 1)]


def _rule(where: str, rule: dict[str, Any], line: LineSettings | None, charts: UnitMaps | None) -> Check:
    for key, value in rule.items():
        if key not in _KEYS:
            raise RulesFileError(f"{where}: no key {key!r}; there are {', '.join(_KEYS)}")
        if not isinstance(value, str):
            raise RulesFileError(f"{where}: {key} is a text in quotes")
    if "check" not in rule:
        raise RulesFileError(f'{where}: needs check = "..."')
    severity = rule.get("severity", "error")
    if severity not in _SEVERITIES:
        raise RulesFileError(f"{where}: severity is error or warning, not {severity!r}")
    try:
        return compile_check(rule["check"], line, name=rule.get("name", ""), severity=severity, charts=charts)
    except CheckError as error:
        raise RulesFileError(f"{where}: {rule['check']!r}: {error}") from error
