"""A user's own functions: declared with any construct, by registration, file or entry point."""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path

import construct as c
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.annotation import annotate, summary
from dissectors.blocks import Items, Record, Registers, Rest, Text
from dissectors.crc import crc_bytes
from dissectors.declaration import ByteCount, DeclarationError, Function, Number, Quantity
from dissectors.envelopes import Adu, rtu
from dissectors.fields import Field
from dissectors.functions import function_class, function_name, load_entry_points, load_file, register, revision
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length, rule
from dissectors.limits import Count

REQUEST, RESPONSE = Role.REQUEST, Role.RESPONSE
CODE = 0x65


def declare(response: object, **more: object) -> None:
    register(Function(CODE, "Read Trend", c.Struct("channel" / Number(1)), response, **more))  # type: ignore[arg-type]


def frame(pdu: bytes) -> Adu:
    body = b"\x01" + pdu
    return rtu(body + crc_bytes(body))


def shown(pdu: bytes) -> list[tuple[str, object]]:
    return [(field.name, field.value) for field in annotate(frame(pdu), RESPONSE)[2:-1]]


def test_registering_makes_it_known() -> None:
    assert rule(CODE, REQUEST) is None
    assert function_class(CODE) == "user-defined"
    before = revision()
    declare(c.Struct("level" / c.Float32b), request_words="trend of {channel}", response_words="level {level}")
    assert revision() > before
    assert function_name(CODE) == "Read Trend"
    known = rule(CODE, RESPONSE)
    assert known is not None
    assert (known.base, known.name) == (5, "Read Trend")
    assert pdu_length(bytes([CODE]), RESPONSE) == 5
    assert summary(frame(bytes([CODE, 7])), REQUEST) == "trend of 7"
    assert summary(frame(bytes([CODE]) + bytes.fromhex("3FC00000")), RESPONSE) == "level 1.5"


def test_a_user_may_replace_a_public_function() -> None:
    register(Function(3, "Read My Registers", c.Struct("page" / Number(1)), c.Struct()))
    assert pdu_length(b"\x03", REQUEST) == 2
    assert function_name(3) == "Read My Registers"


@pytest.mark.parametrize(
    ("response", "base", "count", "walks", "variable"),
    [
        (c.Struct("a" / c.Int16ub, "b" / c.Float32b), 7, None, False, False),
        (c.Struct("n" / c.Int8ub, "data" / c.Bytes(c.this.n)), 2, Count(1, 1, 1), False, False),
        (c.Struct("n" / c.Int16ub, "data" / c.Array(c.this.n, c.Int32ub)), 3, Count(1, 2, 4), False, False),
        (c.Struct("data" / c.Prefixed(c.Int8ub, c.GreedyBytes)), 2, Count(1, 1, 1), False, False),
        (
            c.Struct("q" / Quantity(1, 9), "n" / ByteCount(2, 18, of="q"), "r" / Registers("n")),
            4,
            Count(3, 1, 1),
            False,
            False,
        ),
        (c.Struct("n" / c.Int16ul, "data" / c.Bytes(c.this.n)), None, None, True, False),  # little-endian: read to know
        (c.Struct("n" / c.Int8ub, "data" / c.Bytes(c.this.n * 2)), None, None, True, False),
        (c.Struct("a" / c.Int8ub, "rest" / c.GreedyBytes), None, None, False, True),
        (c.Struct("a" / c.Int8ub, "rest" / Rest(usual=3)), 5, None, False, True),
        (c.Struct("n" / Number(1), "x" / Items("i" / c.Int16ub, number="n")), None, None, True, False),
        (c.Struct("k" / c.Int8ub, c.If(c.this.k == 1, "v" / c.Int16ub)), None, None, True, False),
        (c.BitStruct("hi" / c.BitsInteger(3), "lo" / c.BitsInteger(5)), 2, None, False, False),
    ],
    ids=str,
)
def test_the_length_of_any_construct(
    response: c.Construct[object, object], base: int | None, count: Count | None, walks: bool, variable: bool
) -> None:
    declare(response)
    known = rule(CODE, RESPONSE)
    assert known is not None
    assert (known.base, known.count, known.walk is not None, known.variable) == (base, count, walks, variable)


def test_walked_lengths() -> None:
    declare(c.Struct("n" / c.Int8ub, "items" / c.Array(c.this.n, c.Prefixed(c.Int8ub, c.GreedyBytes))))
    pdu = bytes([CODE, 2, 1, 9, 3, 1, 2, 3])
    assert [pdu_length(pdu[:n], RESPONSE) for n in (1, 3, 7)] == [None, None, None]
    assert pdu_length(pdu + b"more", RESPONSE) == len(pdu)


def test_foreign_constructs_are_annotated() -> None:
    declare(
        c.Struct(
            "kind" / c.Enum(c.Int8ub, slow=1, fast=2),
            "flags" / c.BitStruct("alarm" / c.Flag, c.Padding(3), "level" / c.BitsInteger(4)),
            "n" / c.Int8ub,
            "samples" / c.Array(c.this.n, c.Int16sb),
            c.Padding(1),
            "scale" / c.Float32b,
            "tail" / c.GreedyRange(c.Struct("tag" / c.Int8ub, "value" / c.Int16ub)),
        )
    )
    pdu = bytes([CODE, 2, 0x85, 2]) + bytes.fromhex("FFFF0001 00 3FC00000 010002 030004")
    assert shown(pdu) == [
        ("kind", 2),
        ("flags", None),
        ("n", 2),
        ("samples", None),
        ("unnamed", "00"),
        ("scale", 1.5),
        ("tail", None),
    ]
    fields = {field.name: field for field in annotate(frame(pdu), RESPONSE)}
    assert fields["kind"].text == "fast"
    assert [(f.name, f.value, f.bit, f.bits) for f in fields["flags"].fields] == [
        ("alarm", True, 7, 1),
        ("level", 5, 0, 4),
    ]
    assert [(f.name, f.start, f.value) for f in fields["samples"].fields] == [
        ("samples[0]", 5, -1),
        ("samples[1]", 7, 1),
    ]
    assert [f.value for f in fields["tail"].fields] == [1, 2, 3, 4]


def test_substreams_keep_their_place() -> None:
    declare(c.Struct("head" / c.Int8ub, "body" / c.Prefixed(c.Int8ub, c.Struct("a" / c.Int8ub, "b" / c.Int16ub))))
    fields = annotate(frame(bytes([CODE, 9, 3, 1, 0, 2])), RESPONSE)
    body = next(field for field in fields if field.name == "body")
    assert [(child.name, child.start, child.value) for child in body.fields] == [("a", 4, 1), ("b", 5, 2)]


def test_what_was_tried_and_taken_back_leaves_no_fields() -> None:
    declare(
        c.Struct(
            c.Select(
                c.Struct("long" / c.Int8ub, "mark" / c.Const(b"L")),
                c.Struct("short" / c.Int16ub),
            )
        )
    )
    assert shown(bytes([CODE, 1]) + b"L") == [("long", 1), ("mark", "4c")]
    assert shown(bytes([CODE, 1, 2])) == [("short", 0x0102)]


def test_lists_of_counted_things() -> None:
    declare(
        c.Struct(
            "n" / Number(1),
            "tags" / Items("tag" / Record("{label}", "size" / Number(1), "label" / Text("size")), number="n"),
        ),
        response_words="{tags}",
    )
    assert summary(frame(bytes([CODE, 2]) + b"\x02ab\x01c"), RESPONSE) == "ab, c"


@pytest.mark.parametrize(
    "response",
    [
        c.Struct("x" / c.Computed(lambda _: 1 // 0)),
        c.Struct("n" / c.Int8ub, "x" / c.Bytes(lambda ctx: ctx.missing)),
        c.Struct("x" / c.Bytes(lambda _: -5)),
        c.Struct("x" / c.Const(b"AB")),
        c.Struct("x" / c.PaddedString(4, "ascii")),
        c.Struct("x" / c.CString("utf8")),
        c.Struct("a" / c.Int16ub, c.Seek(0), "b" / c.Int8ub),
        c.Struct("x" / c.Pointer(0, c.Int32ub), "y" / c.Peek(c.Int16ub), "z" / c.Int8ub),
        c.Struct("x" / c.Select(c.Const(b"\x01\x02"), c.Struct("p" / c.Int8ub, "q" / c.Int8ub))),
        c.Struct("x" / c.Float32b, "y" / c.Float64b),
        c.Struct("k" / c.Int8ub, "v" / c.Switch(c.this.k, {1: c.Int8ub, 2: c.Struct("w" / c.Int16ub)})),
        c.Struct("v" / c.RepeatUntil(lambda x, *_: x == 0, c.Int8ub)),
        c.Struct("v" / c.Optional(c.Int32ub), c.Terminated),
        c.Sequence("a" / c.Int8ub, c.Int8ub, "b" / c.Bytes(3)),
        c.Int8ub,
    ],
    ids=str,
)
def test_any_declaration_and_any_bytes_give_a_tree(response: c.Construct[object, object]) -> None:
    declare(response)

    @given(st.binary(max_size=20))
    def check(data: bytes) -> None:
        adu = frame(bytes([CODE]) + data)
        fields: tuple[Field, ...] = annotate(adu, RESPONSE)
        assert b"".join(bytes.fromhex(field.raw) for field in fields) == adu.data
        assert summary(adu, RESPONSE)
        length = pdu_length(bytes([CODE]) + data, RESPONSE)
        assert length is None or length >= -1

    check()


def test_a_file_of_functions(tmp_path: Path) -> None:
    path = tmp_path / "vendor.py"
    path.write_text(
        "from construct import Struct\n"
        "from dissectors import Function, Number\n"
        "ONE = Function(0x65, 'One', Struct('a' / Number(1)), Struct())\n"
        "MORE = [Function(0x66, 'Two', Struct(), Struct()), ONE]\n"
    )
    assert [function.code for function in load_file(path)] == [0x65, 0x66]
    assert function_name(0x66) == "Two"
    assert pdu_length(b"\x65", REQUEST) == 2


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("x = (\n", r"vendor\.py:1: .*never closed"),
        ("\n\n1 / 0\n", r"vendor\.py:3: ZeroDivisionError: division by zero"),
        ("def f():\n    raise KeyError('k')\n\nf()\n", r"vendor\.py:2: KeyError: 'k'"),
        ("import sys\nsys.exit(3)\n", r"vendor\.py:2: SystemExit: 3"),
        ("import no_such_module\n", r"vendor\.py:1: ModuleNotFoundError: No module named 'no_such_module'"),
        ("x = 1\n", r"vendor\.py: defines no Function"),
        ("\0", r"vendor\.py"),
        (
            "from dissectors import Function\nFunction(200, 'Two hundred', None, None)\n",
            r"vendor\.py:2: function 'Two hundred': the code is 200, but codes run from 1 to 127",
        ),
        (
            "from dissectors import Function\nFunction(70, 'X', None, None)\n",
            r"vendor\.py:2: .*request is not a construct",
        ),
        (
            "from construct import Struct\nfrom dissectors import Function\n"
            "Function(70, 'X', Struct(), Struct(), request_words='{')\n",
            r"vendor\.py:3: function 70 'X': request_words: ",
        ),
        ("class Odd(BaseException): pass\nraise Odd('a\\nb')\n", r"vendor\.py:2: Odd: a b"),
        (
            "class Dumb(Exception):\n    def __str__(self): raise ValueError\nraise Dumb()\n",
            r"vendor\.py:3: Dumb",
        ),
        ("def f(): f()\nf()\n", r"vendor\.py:1: RecursionError"),
        ("(" * 5000, r"vendor\.py"),
        (
            "from construct import Struct\nfrom dissectors import Function\nA = Function(70, 5, Struct(), Struct())\n",
            r"vendor\.py: function 70: 5 cannot be shown as text",
        ),
        (
            "from construct import Struct\nfrom dissectors import Function\n"
            "A = Function(70, 'A', Struct(), Struct(), request_words=5)\n",
            r"vendor\.py:3: TypeError",
        ),
    ],
)
def test_a_broken_file_is_one_line_with_its_place(tmp_path: Path, source: str, said: str) -> None:
    path = tmp_path / "vendor.py"
    path.write_text(source, encoding="utf-8")
    with pytest.raises(DeclarationError, match=said) as caught:
        load_file(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["missing.py", ""])
def test_a_file_that_cannot_be_read(tmp_path: Path, name: str) -> None:
    with pytest.raises(DeclarationError, match=re.escape(str(tmp_path))):
        load_file(tmp_path / name)


def test_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    offered = Function(CODE, "From a package", c.Struct(), c.Struct())

    class Point:
        name, value = "vendor", "vendor:FUNCTIONS"

        def load(self) -> object:
            return self.thing

        def __init__(self, thing: object) -> None:
            self.thing = thing

    def offer(thing: object) -> None:
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [Point(thing)] if group else [])

    for thing in (offered, [offered], type("module", (), {"F": offered})):
        offer(thing)
        assert load_entry_points() == [offered]
    assert function_name(CODE) == "From a package"
    told: list[str] = []
    for broken in (3, Function(CODE, "\x1b[2J", c.Struct(), c.Struct())):
        offer(broken)
        assert load_entry_points(told.append) == []
    assert told[0] == "plug-in vendor (vendor:FUNCTIONS) is skipped: holds no Function"
    assert told[1].startswith("plug-in vendor (vendor:FUNCTIONS) is skipped: function 101: ")
