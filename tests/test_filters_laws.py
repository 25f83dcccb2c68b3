"""The display filter against a slow reference: any expression over any rows; any text gives a filter or an error."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from buses import whole
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import SMALL, batches

import captures
from analyzer.filters import BatchTable, Filter, FilterError, check, compile_filter, complete
from analyzer.filters.fields import FIELDS
from analyzer.filters.kinds import Flag
from analyzer.simulation import Scenario, write
from analyzer.tables.batch import Batch
from analyzer.tables.columns import AreaCode, Decoded, decode
from analyzer.tables.findings import Severity
from analyzer.tables.schema import NO_GAP, Direction, Kind, Protocol
from captures import samples
from captures.line import LineSettings
from dissectors.functions import exception_name, function_name

FLAGS = {each.name for each in FIELDS if isinstance(each.kind, Flag)}
CHAR_NS = 10e9 / 19200  # of the captures below
OPERATORS: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip


@dataclass(frozen=True)
class One:
    """A row as the reference sees it: plain Python values, lists for what there may be several of."""

    values: dict[str, list[Any]]
    each: list[dict[str, list[Any]]]  # single values with their addresses


@dataclass(frozen=True)
class Seen:
    """A capture: the table that is filtered, and its rows for the reference."""

    table: BatchTable
    rows: list[One]


def seen(capture: captures.Capture) -> Seen:
    analysed = whole(capture)
    batch, settled = analysed.batch, analysed.transactions
    told = {int(index): settled[i : i + 1] for i, index in enumerate(settled.request)}
    late = set(settled.response[settled.late].tolist())
    decoded = decode(batch)
    table = BatchTable(batch, capture.line, transactions=settled)
    return Seen(table, [one(batch, decoded, row, told, late) for row in range(len(batch))])


def one(batch: Batch, decoded: Decoded, row: int, told: dict[int, Any], late: set[int]) -> One:
    fields = batch.rows.row(row)
    found = [each.code for each in batch.findings_of(row)]
    values: dict[str, list[Any]] = {
        "time": [int(fields.t_start_ns - batch.rows.t_start_ns[0])],
        "length": [int(fields.length)],
        "start": [int(fields.start)],
        "port": [int(fields.port)],
        "noise": [fields.kind == Kind.NOISE],
        "request": [fields.kind == Kind.REQUEST],
        "response": [fields.kind == Kind.RESPONSE],
        "gap": [int(fields.gap_before_ns)] if fields.gap_before_ns != NO_GAP else [],
        "gap_inside": [int(fields.gap_most_ns)] if fields.gap_most_ns != NO_GAP else [],
        "uart_errors": [int(fields.errors)] if fields.errors else [],
        "finding": found,
        "severity": [each.severity for each in batch.findings_of(row)],
        "hex": [batch.bytes_of(row)],
        "broadcast": [fields.kind == Kind.REQUEST and fields.unit == 0],
        "retry": [False],
        "unanswered": [False],
        "late": [False],
        "displaced": [int(batch.rows.taken_for_start[row]) >= 0],
        "unsure": [bool(batch.rows.unsure[row])],
    }
    if fields.kind == Kind.NOISE:
        return One(values, [])
    frame = batch.frame(row)
    line = frame.to_json(fields=False)
    for name in ("unit", "function", "direction", "crc_ok", "index", "protocol"):
        values[name] = [line[name]]
    values["hex"] = [bytes.fromhex(line["hex"])]
    values["confidence"] = [frame.confidence]
    values["response_time"] = [line["response_time_ns"]] if line["response_time_ns"] is not None else []
    values["exception"] = [line["exception"]] if line["exception"] else []
    values["text"] = [frame.summary().casefold()]
    transaction = told.get(frame.index)
    values["retry"] = [transaction is not None and bool(transaction.retry[0])]
    values["unanswered"] = [transaction is not None and bool(transaction.status[0] == 2)]
    values["late"] = [frame.index in late]
    first, count = int(decoded.address[row]), max(int(decoded.quantity[row]), 1)
    if decoded.quantity[row] >= 0:
        values["quantity"] = [int(decoded.quantity[row])]
    values |= addresses(range(first, first + count) if first >= 0 else (), int(decoded.area[row]))
    values["value"] = decoded.values_of(row).tolist()
    values["signed_value"] = signed(values["value"], int(decoded.area[row]))
    each = []
    for i, value in enumerate(values["value"]):
        at = int(decoded.value_address[row])
        spot = addresses((at + i,) if at >= 0 else (), int(decoded.area[row]))
        each.append({"value": [value], "signed_value": signed([value], int(decoded.area[row])), **spot})
    return One(values, each)


def addresses(spoken: Sequence[int], area: int) -> dict[str, list[Any]]:
    registers = area in (AreaCode.INPUT_REGISTERS, AreaCode.HOLDING_REGISTERS)
    bits = area in (AreaCode.COILS, AreaCode.DISCRETE_INPUTS)
    return {
        "address": list(spoken),
        "register": list(spoken) if registers else [],
        "bit": list(spoken) if bits else [],
        "area": [area] * len(spoken),
    }


def signed(values: list[int], area: int) -> list[int]:
    return [] if area in (1, 2) else [value - 0x10000 if value & 0x8000 else value for value in values]


@cache
def captured() -> list[Seen]:
    """A bus with troubles and a healthy one."""
    return [seen(captures.open(samples.path(name))) for name in ("troubled.jsonl", "healthy.jsonl")]


def noisy(folder: Any) -> Seen:
    path = folder / "noisy.jsonl"
    write(Scenario("noisy", "irq", transactions=150, seed=5, char_bits=10, baud=19200), path)
    return seen(captures.open(path))


@dataclass(frozen=True)
class Leaf:
    """A test: its text, and what it says of a row's values."""

    text: str
    field: str
    holds: Callable[[dict[str, list[Any]]], bool]


Tree = Leaf | tuple[Any, ...]  # ("not", tree), ("and", tree, ...), ("or", tree, ...)
EACH = ("address", "register", "bit", "value", "signed_value")
AMOUNTS = {"us": 1e3, "ms": 1e6, "s": 1e9, "chars": CHAR_NS}


def compared(field: str, sign: str, wanted: Any) -> Callable[[dict[str, list[Any]]], bool]:
    def holds(values: dict[str, list[Any]]) -> bool:
        own = values.get(field, [])
        if sign == "!=":
            return bool(own) and all(each != wanted for each in own)
        return any(OPERATORS[sign](each, wanted) for each in own)

    return holds


@st.composite
def leaves(draw: st.DrawFn) -> Leaf:
    field = draw(st.sampled_from([each.name for each in FIELDS if each.name != "name"]))  # which needs a map
    if draw(st.integers(0, 5)) == 0 or (field in FLAGS and field not in ("crc_ok", "unanswered")):
        return Leaf(field, field, lambda v: any(v.get(field, [])) if field in FLAGS else bool(v.get(field)))
    sign = draw(st.sampled_from(sorted(OPERATORS)))
    equal = draw(st.sampled_from(["==", "!="]))
    if field in ("crc_ok", "unanswered"):
        wanted = draw(st.booleans())
        return Leaf(f"{field} {equal} {str(wanted).lower()}", field, compared(field, equal, wanted))
    if field in ("response_time", "gap", "gap_inside", "time"):
        unit = draw(st.sampled_from(sorted(AMOUNTS) if field != "time" else ["us", "ms", "s"]))
        amount = draw(st.sampled_from(["0.5", "1", "1.5", "3.5", "20", "300"]))
        ns = float(amount) * AMOUNTS[unit]
        return Leaf(f"{field} {sign} {amount}{unit}", field, compared(field, sign, ns))
    if field in ("hex", "text"):
        return draw(texts(field))
    if field in ("direction", "protocol", "severity", "finding"):
        return draw(names(field, sign if field == "severity" else equal))
    if field == "confidence":
        text = draw(st.sampled_from(["0", "0.5", "0.9", "1"]))
        return Leaf(f"confidence {sign} {text}", field, compared(field, sign, float(np.float32(text))))
    small = st.sampled_from([1, 2, 3, 4, 5, 6, 9, 16, 17, 23, 43])
    number = draw(st.one_of(small, st.integers(1, 130), st.sampled_from([0, 255, 1000])))
    if field in ("unit", "function", "exception", "port", "uart_errors"):
        number = draw(small)
    if field in EACH and draw(st.integers(0, 3)) == 0 and field in ("register", "bit"):
        return draw(logical(field, sign, number))
    if draw(st.booleans()):
        high = number + draw(st.integers(0, 20))
        also = draw(small)
        holds = lambda v: any(number <= each <= high or each == also for each in v.get(field, []))  # noqa: E731
        if draw(st.booleans()):
            return Leaf(f"{field} in ({number}..{high}, {also},)", field, holds)
        return Leaf(f"{field} not in ({also}, {number}..{high})", field, lambda v: bool(v.get(field)) and not holds(v))
    if field == "confidence":
        text = draw(st.sampled_from(["0", "0.5", "0.9", "1"]))
        return Leaf(f"confidence {sign} {text}", field, compared(field, sign, float(np.float32(text))))
    return Leaf(
        f"{field} {sign} {draw(st.sampled_from([str(number), hex(number)]))}", field, compared(field, sign, number)
    )


@st.composite
def logical(draw: st.DrawFn, field: str, sign: str, number: int) -> Leaf:
    area = draw(st.sampled_from([3, 4] if field == "register" else [1, 0]))
    code = {0: AreaCode.COILS, 1: AreaCode.DISCRETE_INPUTS}.get(area, area)
    forms = [f"{area}{number + 1:04d}", f"{area}{number + 1:05d}"] + ([f"{area}x{number + 1}"] if area else [])
    text = draw(st.sampled_from(forms))

    def holds(values: dict[str, list[Any]]) -> bool:
        own = [
            each for each, where in zip(values.get(field, []), values.get("area", []), strict=False) if where == code
        ]
        if sign == "!=":
            return bool(values.get(field)) and number not in own
        return any(OPERATORS[sign](each, number) for each in own)

    return Leaf(f"{field} {sign} {text}", field, holds)


@st.composite
def texts(draw: st.DrawFn, field: str) -> Leaf:
    if field == "hex":
        needle = draw(st.sampled_from([b"\x03", b"\x00\x01", b"\x01\x03", b"\x00\x00\x00", b"\x11\x04\x00"]))
        form = draw(st.sampled_from([needle.hex(), needle.hex(" "), needle.hex(",").upper()]))
        return Leaf(f'hex contains "{form}"', field, lambda v: any(needle in each for each in v["hex"]))
    word = draw(st.sampled_from(["read", "Read 3", "holding", "exception", "unit", "17"]))
    holds = lambda v: any(word.casefold() in each for each in v.get("text", []))  # noqa: E731
    return Leaf(draw(st.sampled_from([f"text contains '{word}'", f'text matches "*{word}*"'])), field, holds)


@st.composite
def names(draw: st.DrawFn, field: str, sign: str) -> Leaf:
    if field == "severity":
        wanted = draw(st.sampled_from(list(Severity)))
        return Leaf(f"severity {sign} {wanted.name.lower()}", field, compared(field, sign, wanted))
    known = {
        "direction": [each.name for each in Direction],
        "protocol": [each.name.lower() for each in Protocol],
        "finding": ["retry", "crc-error", "no-response", "exception", "truncated", "noise"],
    }[field]
    name = draw(st.sampled_from(known))
    shown = draw(st.sampled_from([name, f'"{name}"', f"'{name.upper()}'"]))
    return Leaf(f"{field} {sign} {shown}", field, compared(field, sign, name))


def joins(parts: st.SearchStrategy[Tree]) -> st.SearchStrategy[Tree]:
    some = st.lists(parts, min_size=2, max_size=4)
    return st.one_of(
        parts.map(lambda part: ("not", part)),
        some.map(lambda found: ("and", *found)),
        some.map(lambda found: ("or", *found)),
    )


TREES: st.SearchStrategy[Tree] = st.recursive(leaves(), joins, max_leaves=8)


def written(tree: Tree, spell: Callable[[str], str]) -> str:
    if isinstance(tree, Leaf):
        return tree.text
    word, *inner = tree
    shown = [text if isinstance(part, Leaf) else f"({text})" for part in inner for text in [written(part, spell)]]
    return f"{spell('not')} {shown[0]}" if word == "not" else f" {spell(word)} ".join(shown)


def said(tree: Tree, row: One) -> bool:
    """The reference: plain recursion over one row."""
    if isinstance(tree, Leaf):
        return tree.holds(row.values)
    word, *inner = tree
    if word == "not":
        return not said(inner[0], row)
    if word == "or":
        return any(said(part, row) for part in inner)
    level = flat(inner)
    mine = [part for part in level if of_values(part)]
    if not together(mine):
        return all(said(part, row) for part in level)
    same = any(all(said(part, One(each, [])) for part in mine) for each in row.each)
    return same and all(said(part, row) for part in level if not of_values(part))


def flat(inner: Sequence[Tree]) -> list[Tree]:
    """Tests joined on one level: `a and (b and c)` is `a and b and c`, but one that is about one value stays so."""
    found: list[Tree] = []
    for part in inner:
        if isinstance(part, Leaf) or part[0] != "and" or has_group(part):
            found.append(part)
        else:
            found += flat(part[1:])
    return found


def has_group(tree: Tree) -> bool:
    return not isinstance(tree, Leaf) and (
        (tree[0] == "and" and together([part for part in flat(tree[1:]) if of_values(part)]))
        or any(has_group(part) for part in tree[1:])
    )


def of_values(tree: Tree) -> bool:
    if isinstance(tree, Leaf):
        return tree.field in EACH
    return all(of_values(part) for part in tree[1:]) and not has_group(tree)


def together(parts: Sequence[Tree]) -> bool:
    used = {field for part in parts for field in fields(part)}
    return bool(used & {"value", "signed_value"}) and bool(used & {"address", "register", "bit"})


def fields(tree: Tree) -> list[str]:
    return [tree.field] if isinstance(tree, Leaf) else [field for part in tree[1:] for field in fields(part)]


SPELLINGS: list[dict[str, str]] = [{}, {"and": "&&", "or": "||", "not": "!"}, {"and": "AND", "or": "Or", "not": "NOT"}]


def agrees(tree: Tree, spelling: dict[str, str], found: Seen) -> None:
    text = written(tree, lambda word: spelling.get(word, word))
    got = compile_filter(text).mask(found.table).tolist()
    assert got == [said(tree, row) for row in found.rows], text


@settings(max_examples=40, deadline=None)
@given(TREES, st.sampled_from(SPELLINGS), st.integers(0, 1))
def test_any_expression_says_what_the_reference_says(tree: Tree, spelling: dict[str, str], which: int) -> None:
    agrees(tree, spelling, captured()[which])


def test_and_on_a_noisy_bus(tmp_path: Any) -> None:
    found = noisy(tmp_path)

    @settings(max_examples=40, deadline=None)
    @given(TREES)
    def law(tree: Tree) -> None:
        agrees(tree, {}, found)

    law()


def test_every_single_field_against_the_reference() -> None:
    """Numbers by name, which the trees above leave out."""
    for found in captured():
        for row, one_row in enumerate(found.rows):
            for name, by in (("function", function_name), ("exception", exception_name)):
                for number in one_row.values.get(name, []):
                    assert compile_filter(f'{name} == "{by(number)}"').mask(found.table)[row]


@settings(max_examples=30, deadline=None)
@given(TREES, st.lists(st.integers(0, 160), max_size=3))
def test_rows_pass_alike_however_the_table_is_cut(tree: Tree, cuts: list[int]) -> None:
    """Blocks and slices are a matter of speed: pieces of a table, each with the requests before it, say the same."""
    table = captured()[0].table
    compiled = compile_filter(written(tree, str))
    if compiled.settled:
        return
    bounds = sorted({0, len(table), *(min(cut, len(table)) for cut in cuts)})
    pieces = [
        compiled.mask(BatchTable(table.batch(first, last), table.line, origin_ns=table.origin_ns))
        for first, last in pairwise(bounds)
    ]
    assert np.concatenate(pieces).tolist() == compiled.mask(table).tolist()


@settings(max_examples=75, deadline=None)
@given(st.data())
def test_values_of_any_function_are_found_where_decoding_finds_them(data: st.DataObject) -> None:
    """Few rows are decoded for a test that few numbers pass; of damaged frames and listed values no other ones."""
    batch = data.draw(batches(data.draw(st.sampled_from(sorted({code for code, _ in SMALL})))))
    decoded = decode(batch)
    wanted = data.draw(st.sampled_from(decoded.values.tolist()) if len(decoded.values) else st.integers(0, 0xFFFF))
    operation = data.draw(st.sampled_from(["==", ">", "<="]))
    got = compile_filter(f"value {operation} {wanted}").mask(BatchTable(batch, LineSettings()))
    said = OPERATORS[operation]
    rows = range(len(batch))
    assert got.tolist() == [any(said(value, wanted) for value in decoded.values_of(row).tolist()) for row in rows]


WORDS = st.sampled_from(
    [*(name for each in FIELDS for name in (each.name, *each.aliases)), "and", "or", "not", "in", "contains", "matches",
     "(", ")", "[", ",", "..", "==", "!=", "<", ">=", "=", "!", "&&", "3", "-1", "0x10", "3.5", "50ms", "2 chars",
     "4x108", "40108", '"03 02"', "'", '"', "true", "request", "late-response", "\u0661", "\x00", "%", "\\"]
)  # fmt: skip


@settings(max_examples=75, deadline=None)
@given(
    st.one_of(
        st.text(max_size=60), st.lists(WORDS, max_size=14).map(" ".join), st.lists(WORDS, max_size=14).map("".join)
    )
)
def test_any_text_is_a_filter_or_an_error_within_it(text: str) -> None:
    wrong = check(text)
    if wrong is None:
        assert isinstance(compile_filter(text), Filter)
        assert compile_filter(text).mask(captured()[0].table).dtype == np.bool_
    else:
        assert isinstance(wrong, FilterError)
        assert 0 <= wrong.column <= len(text)
        assert wrong.message
        assert "\n" not in wrong.message
    for cursor in (len(text), len(text) // 2):
        for each in complete(text, cursor):
            assert 0 <= each.start <= cursor


def test_long_and_deep_texts_are_refused_or_done_soon() -> None:
    for text in ("not " * 1000 + "noise", "(" * 4000, "!" * 4000 + "noise", "noise and " * 400 + "noise",
                 "((noise) or " * 40 + "noise" + ")" * 40, "unit in (" + "1," * 2000 + "1)", '"' * 4000,
                 'text matches "' + "*a" * 100 + '"', "-" * 4000, "unit == " + "9" * 4000):  # fmt: skip
        if check(text) is None:
            compile_filter(text).mask(captured()[0].table)
