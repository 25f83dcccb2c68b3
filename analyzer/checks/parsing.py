"""From text to rules: a line, whose grammar is put together from the forms, or a TOML file of them.

Any line gives a rule or a CheckError. A file has a `[[rule]]` each, with `check`, and if wanted `name` and `severity`
(error or warning).
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from captures.line import LineSettings

from ..errors import RtuscopeError
from ..filters import FilterError
from ..meant import did_you_mean
from . import CheckError
from .model import CHARTS, TERMINALS, WORDS_OF_TERMINALS, Check, forms

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

LONGEST: Final = 4096  # characters
_WORD: Final = re.compile(r"[\w-]{1,30}|\S")


def compile_check(
    text: str,
    line: LineSettings | None = None,
    *,
    name: str = "",
    severity: str = "error",
    charts: UnitMaps | None = None,
) -> Check:
    """A rule from its text, for a line of these settings, with names from these register maps. Raises CheckError."""
    if len(text) > LONGEST:
        raise CheckError(f"a rule has at most {LONGEST:,} characters", LONGEST)
    try:
        tree = grammar().parse(text)
    except UnexpectedInput as error:
        raise _explained(text, error) from None
    form = forms()[int(str(tree.data).removeprefix("form_"))]
    token = CHARTS.set(charts)
    try:
        start = form.make(line or LineSettings(), *map(_terminals, tree.children))
    except CheckError:
        raise
    except FilterError as error:  # of the parts that the display filter reads
        raise CheckError(error.message, error.column) from None
    finally:
        CHARTS.reset(token)
    return Check(text.strip(), start, name, severity)


@cache
def grammar() -> Lark:
    rules = "".join(f"form_{number}: {form.grammar}\n" for number, form in enumerate(forms()))
    start = "?start: " + " | ".join(f"form_{number}" for number in range(len(forms())))
    return Lark(f"{start}\n{rules}{TERMINALS}", parser="lalr", maybe_placeholders=True)


def _terminals(child: Any) -> Any:
    """A terminal, or those of a list."""
    return list(child.children) if isinstance(child, Tree) else child


def at(token: Token) -> int:
    """The column of a terminal."""
    return token.start_pos or 0


def _explained(text: str, error: UnexpectedInput) -> CheckError:
    """A syntax error in the words of the language."""
    awaited: Iterable[str]
    if isinstance(error, UnexpectedCharacters):
        position, awaited = error.pos_in_stream or 0, error.allowed or ()
    else:
        assert isinstance(error, UnexpectedToken)
        position = len(text.rstrip()) if error.token.type == "$END" else at(error.token)
        awaited = error.accepts or error.expected
    literal = {terminal.name: terminal.pattern for terminal in grammar().terminals}
    names = ("$END" if name == "<END-OF-FILE>" else name for name in awaited if name != "WS")
    listed = sorted(dict.fromkeys(WORDS_OF_TERMINALS.get(name) or f"'{literal[name].value}'" for name in names))
    expected = " or ".join([*filter(None, [", ".join(listed[:-1])]), *listed[-1:]])
    word = _WORD.match(text, position)
    if not word:
        return CheckError(f"expected {expected}", position)
    near = did_you_mean(word[0], (name.strip("'") for name in listed if name.startswith("'")))
    return CheckError(f"expected {expected}, not {word[0]!r}{near}", position)


_KEYS: Final = ("name", "check", "severity")
_SEVERITIES: Final = ("error", "warning")


class RulesFileError(RtuscopeError):
    """A file of rules that cannot be used: which file, which rule, what to do."""


def load_rules(path: str | Path, line: LineSettings | None = None, charts: UnitMaps | None = None) -> list[Check]:
    """The rules of a file, for a line of these settings, with names from register maps.

    Raises RulesFileError and OSError.
    """
    try:
        document = tomllib.loads(Path(path).read_bytes().decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RulesFileError(f"{path}: is not a TOML file: {error}") from error
    except RecursionError as error:
        raise RulesFileError(f"{path}: nested too deeply") from error
    rules = document.get("rule")
    if set(document) != {"rule"} or not isinstance(rules, list) or not all(isinstance(rule, dict) for rule in rules):
        raise RulesFileError(f'{path}: may contain only [[rule]] tables, each with check = "no crc errors"')
    return [_rule(f"{path}: rule {number}", rule, line, charts) for number, rule in enumerate(rules, 1)]


def _rule(where: str, rule: dict[str, Any], line: LineSettings | None, charts: UnitMaps | None) -> Check:
    for key, value in rule.items():
        if key not in _KEYS:
            raise RulesFileError(f"{where}: no key {key!r}: choose from {', '.join(_KEYS)}")
        if not isinstance(value, str):
            raise RulesFileError(f"{where}: {key} must be text in quotes")
    if "check" not in rule:
        raise RulesFileError(f'{where}: needs check = "..."')
    severity = rule.get("severity", "error")
    if severity not in _SEVERITIES:
        raise RulesFileError(f"{where}: severity is error or warning, not {severity!r}")
    try:
        return compile_check(rule["check"], line, name=rule.get("name", ""), severity=severity, charts=charts)
    except CheckError as error:
        raise RulesFileError(f"{where}: {rule['check']!r}: {error}") from error
