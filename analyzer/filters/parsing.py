"""From text to tree: the grammar stands in `grammar.lark`, the fields in `fields.py`; here is how the two meet.

Whatever is typed gives a tree or a FilterError with its column, in bounded time and depth.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from lark import Lark, Token
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken, VisitError
from lark.visitors import Transformer_NonRecursive, v_args

from ..languages import tr
from . import FilterError, meant
from .fields import FIELDS, FilterField, by_name, cost
from .kinds import Addresses, Flag, Named
from .literals import Item, Literal, spelled
from .tree import And, Node, Not, Or, Same, Span, Spans, Test, parts, tests

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

LONGEST: Final = 4096  # characters
_DEEPEST: Final = 50  # parentheses
_NESTING: Final = re.compile(r"\"[^\"]*\"|'[^']*'|[()]")
_BRACED: Final = re.compile(r"\"[^\"]*\"|'[^']*'|\{[^{}\"']*\}")
_BETWEEN: Final = re.compile(r"(?<=[^\s,{.])\s(?=\s*[^\s,}.])")
_WORD: Final = re.compile(r"\w{1,30}|\S")

# What can stand somewhere, in the order in which it is told.
_EXPECTED: Final = {
    "NAME": "a field such as unit or exception",
    "NUMBER": "a value",
    "STRING": "a value",
    "WORD": "a value",
    "COMPARED": "a comparison such as ==",
    "IN": "'in'",
    "HOLDS": "'contains'",
    "UNIT": "a unit such as ms",
    "MEASURE": "a unit such as kW",
    "DOTDOT": "a range",
    "COMMA": "a comma",
    "RPAR": "')'",
    "RSQB": "']'",
    "AND": "'and'",
    "OR": "'or'",
    "$END": "the end",
}


@cache
def grammar() -> Lark:
    """The parser."""
    return Lark.open("grammar.lark", rel_to=__file__, parser="lalr", maybe_placeholders=True)


def parsed(text: str, charts: UnitMaps | None = None) -> Node | None:
    """The tree of a filter; None for an empty one, which everything passes; `charts` are the register maps that names
    come from. Raises FilterError."""
    if not text.strip():
        return None
    if len(text) > LONGEST:
        raise FilterError(tr("a filter has at most {most:,} characters", most=LONGEST), LONGEST)
    _check_depth(text)
    try:
        node: Node = _Builder(charts).transform(grammar().parse(_BRACED.sub(_with_commas, text)))
    except UnexpectedInput as error:
        raise _explained(text, error) from None
    except VisitError as error:
        if isinstance(error.orig_exc, FilterError):
            raise error.orig_exc from None
        raise
    return node


def _with_commas(braced: re.Match[str]) -> str:
    """A set as Wireshark writes it, `{3 4}`, with commas in place of blanks: columns stay where they are."""
    return _BETWEEN.sub(",", braced[0]) if braced[0].startswith("{") else braced[0]


def field_named(name: str, column: int) -> FilterField:
    """The field of this name; FilterError where there is none."""
    field = by_name().get(name.lower().replace("-", "_"))
    if field is None:
        near = _as_value(name) or meant(name, by_name())
        raise FilterError(tr("no field {name!r}", name=str(name)) + near, column)
    return field


def _as_value(name: str) -> str:
    """`; write finding == retry` where a name is one of a field's values."""
    for field in FIELDS:
        names = field.kind.names().values() if isinstance(field.kind, Named) else ()
        if spelled(name) in map(spelled, names):
            return tr("; write {field} == {name}", field=field.name, name=name)
    return ""


class _Builder(Transformer_NonRecursive[Token, Node]):
    """Trees of the grammar to trees of tests; methods are named after the grammar's rules."""

    def __init__(self, charts: UnitMaps | None) -> None:
        super().__init__()
        self._charts = charts

    def start(self, parts: list[Node]) -> Node:
        return parts[0]

    def any(self, parts: list[Any]) -> Node:
        return _under_one_node(Or, parts)

    def all(self, parts: list[Any]) -> Node:
        node = _under_one_node(And, parts)
        return _together(node) if isinstance(node, And) else node

    @v_args(inline=True)
    def negation(self, _sign: Token, part: Node) -> Node:
        return part.part if isinstance(part, Not) else Not(part)

    @v_args(inline=True)
    def inner(self, part: Node) -> Node:
        return part

    @v_args(inline=True)
    def bare(self, name: Token) -> Node:
        return _bare(self._field(name))

    @v_args(inline=True)
    def comparison(self, name: Token, operator: Token, literal: Literal) -> Node:
        return _test(self._field(name), str(operator).lower(), _at(operator), [(literal, None)])

    @v_args(inline=True)
    def membership(self, name: Token, operator: Token, items: list[Item]) -> Node:
        return _test(self._field(name), "==", _at(operator), items)

    @v_args(inline=True)
    def exclusion(self, name: Token, operator: Token, _in: Token, items: list[Item]) -> Node:
        return _test(self._field(name), "!=", _at(operator), items)

    @v_args(inline=True)
    def called(self, name: Token, argument: Token) -> FilterField:
        if name.lower() != "value":
            raise FilterError(tr('only value("NAME") takes a name, not {name!r}', name=str(name)), _at(name))
        from .mapped import named_value

        text = str(argument)[1:-1] if argument.type == "STRING" else str(argument)
        return named_value(text, _at(argument), self._charts)

    @v_args(inline=True)
    def bare_value(self, field: FilterField) -> Node:
        return Test(field)

    @v_args(inline=True)
    def value_comparison(self, field: FilterField, operator: Token, literal: Literal) -> Node:
        return _test(field, str(operator), _at(operator), [(literal, None)])

    @v_args(inline=True)
    def value_membership(self, field: FilterField, operator: Token, items: list[Item]) -> Node:
        return _test(field, "==", _at(operator), items)

    @v_args(inline=True)
    def value_exclusion(self, field: FilterField, operator: Token, _in: Token, items: list[Item]) -> Node:
        return _test(field, "!=", _at(operator), items)

    def _field(self, name: Token) -> FilterField:
        field = field_named(name, _at(name))
        if field.name == "name":
            from .mapped import field_of_names

            return field_of_names(self._charts, _at(name))
        return field

    def items(self, parts: list[Item | None]) -> list[Item]:
        return [item for item in parts if item is not None]

    def item(self, parts: list[Any]) -> Item:
        return parts[0], parts[2] if len(parts) > 2 else None

    def literal(self, parts: list[Token | None]) -> Literal:
        value, unit = parts[0], parts[1] if len(parts) > 1 else None
        assert value is not None
        text = str(value)[1:-1] if value.type == "STRING" else str(value)
        return Literal(value.type.lower(), text, _at(value), str(unit or ""))


def _bare(field: FilterField) -> Test:
    """A field's name alone: a flag is true; of the others, the row has it."""
    return Test(field, Spans((Span(1, 1),)) if isinstance(field.kind, Flag) else None)


def _test(field: FilterField, operator: str, column: int, items: list[Item]) -> Test:
    operator = "==" if operator == "=" else operator
    if operator not in field.kind.operators:
        fit = ", ".join(field.kind.operators)
        raise FilterError(
            tr("{field} takes {fit} and in, not {this}", field=field.name, fit=fit, this=operator), column
        )
    return Test(field, field.kind.wanted("==" if operator == "!=" else operator, items), operator == "!=")


def _under_one_node(join: type[And] | type[Or], parts: Iterable[Node | Token]) -> Node:
    """Parts under one node, those that cost less first; parts that are joined alike become parts of it."""
    flat: list[Node] = []
    for part in parts:
        if not isinstance(part, Token):
            flat += part.parts if isinstance(part, join) else (part,)
    return flat[0] if len(flat) == 1 else join(tuple(sorted(flat, key=cost)))


def _together(node: And) -> Node:
    """Tests of addresses and of values that are joined by `and` speak of the same value."""
    mine = [part for part in node.parts if _of_values(part)]
    kinds = {isinstance(test.field.kind, Addresses) for part in mine for test in tests(part)}
    if len(kinds) < 2:
        return node
    return _under_one_node(And, [*(part for part in node.parts if not _of_values(part)), Same(And(tuple(mine)))])


def _of_values(node: Node) -> bool:
    """Whether every test of a node can be made of a single value."""
    return not isinstance(node, Same) and all(map(_of_values, parts(node))) and all(t.field.each for t in tests(node))


def _check_depth(text: str) -> None:
    """Parentheses are what makes trees deep: double negations go, and what is joined alike becomes flat."""
    depth = 0
    for match in _NESTING.finditer(text):
        depth += {"(": 1, ")": -1}.get(match[0], 0)
        if depth > _DEEPEST:
            raise FilterError(tr("parentheses stand more than {most} deep", most=_DEEPEST), match.start())


def _at(token: Token) -> int:
    return token.start_pos or 0


def _explained(text: str, error: UnexpectedInput) -> FilterError:
    """A syntax error in the words of the language."""
    if isinstance(error, UnexpectedCharacters):
        at, awaited = error.pos_in_stream or 0, error.allowed
        if text[at] in "\"'":
            return FilterError(tr("the quote is not closed"), at)
    else:
        assert isinstance(error, UnexpectedToken)
        at, awaited = (len(text.rstrip()) if error.token.type == "$END" else _at(error.token)), error.accepts
    listed = list(dict.fromkeys(words for name, words in _EXPECTED.items() if name in (awaited or ())))
    listed = [tr(words) for words in listed]
    due = tr(" or ").join([*filter(None, [", ".join(listed[:-1])]), *listed[-1:]])
    word = _WORD.match(text, at)
    if word:
        return FilterError(tr("expected {due}, not {this!r}", due=due, this=word[0]), at)
    return FilterError(tr("expected {due}", due=due), at)
