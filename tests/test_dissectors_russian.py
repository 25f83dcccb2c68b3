"""Fields of a frame in Russian: names, values and what is wrong with them, whatever the bytes; JSON stays English."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import CASES, built

import dissectors
from analyzer import languages, paste
from analyzer.languages import field_name, wording
from analyzer.paste import tree
from dissectors.annotation import Context, annotate, summary
from dissectors.envelopes import Adu, rtu, tcp
from dissectors.fields import Field
from dissectors.functions import exception_name, function_name
from dissectors.functions.diagnostics import SUB_FUNCTIONS
from dissectors.length_rules import Role

_SPECIFIED = [name for code in range(256) for name in (function_name(code), exception_name(code))]
_SPECIFIED += [name for name, _, _ in SUB_FUNCTIONS.values()]
_TERMS = re.compile(
    "|".join(map(re.escape, sorted(set(_SPECIFIED), key=len, reverse=True)))
    + r"""|CANopen\ General\ Reference|Read\ Device\ Identification
    |VendorName|ProductCode|MajorMinorRevision|VendorUrl|ProductName|ModelName|UserApplicationName
    |\b(?:FC|CRC|LRC|MEI|NAK|AND|OR|FIFO|Modbus|and|or)\b|0x[0-9A-F]+|\b[0-9A-Fa-f]{2,8}\b""",
    re.VERBOSE,
)


@pytest.fixture(autouse=True)
def _russian() -> Iterator[None]:
    languages.use_language("ru")
    yield
    languages.use_language("en")


def _walk(fields: tuple[Field, ...]) -> Iterator[Field]:
    for field in fields:
        yield field
        yield from _walk(field.fields)


def _latin(words: str) -> set[str]:
    return set(re.findall(r"[A-Za-z]{2,}", _TERMS.sub(" ", words)))


def _left(adu: Adu, role: Role, context: Context) -> set[str]:
    """English in the names, texts and problems of a frame's fields; what a device says in letters is its own."""
    left: set[str] = set()
    fields = list(_walk(annotate(adu, role, context, wording())))
    for field in fields:
        left |= _latin(field_name(field.name)) | _latin(field.problem or "")
        if not field.fields and not isinstance(field.value, str):
            left |= _latin(field.text)
    if not any(isinstance(field.value, str) for field in fields):
        left |= _latin(summary(adu, role, context, wording()))
    return left


@pytest.mark.parametrize(("code", "role"), CASES)
@settings(max_examples=30)
@given(data=st.data())
def test_no_field_is_left_in_english(code: int, role: Role, data: st.DataObject) -> None:
    pdu = built(code, role, data.draw(CASES[code, role]))
    frame = bytearray(b"\x11" + pdu + b"\0\0")
    for at in data.draw(st.lists(st.integers(2, len(frame) - 1), max_size=3)):
        frame[at] = data.draw(st.integers(0, 255))
    cut = bytes(frame[: data.draw(st.integers(1, len(frame)))])
    asked = data.draw(st.none() | st.just(pdu) | st.binary(min_size=4, max_size=8).map(bytes([code]).__add__))
    for adu in (rtu(bytes(frame)), rtu(cut), tcp(b"\0\1\0\0\0" + cut)):
        assert not _left(adu, role, Context(request=asked))


@given(st.binary(max_size=30), st.sampled_from(Role))
def test_no_field_of_any_bytes_is_left_in_english(data: bytes, role: Role) -> None:
    assert not _left(rtu(data), role, Context())
    assert not _left(tcp(data), role, Context())


def test_what_declarations_say_is_in_the_catalogue() -> None:
    """What the source hands to `say` and `tell`, and the words behind codes, but the specification's names."""
    known = languages.catalogue("ru")["frames"]
    said = {
        node.args[0].value
        for path in Path(dissectors.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and (getattr(node.func, "attr", None) in ("say", "fill_template") or getattr(node.func, "id", None) == "say")
        and node.args
        and isinstance(node.args[0], ast.Constant)
    }
    assert len(said) > 35
    assert not said - set(known)


def test_json_and_python_stay_english() -> None:
    line = next(paste.read("11 03 00 6B 00 03 76 88").to_json())
    assert [field["name"] for field in line["fields"]] == ["unit", "function", "starting_address", "quantity", "crc"]
    assert line["fields"][-1]["text"] == "wrong: 76 88, should be 76 87"
    assert line["fields"][-1]["problem"] == "76 87 is correct"


def test_a_paste_s_fields_are_told_in_russian() -> None:
    said = tree(paste.read("11 83 02 C1 34"))
    assert re.search("1  бит 7 +признак исключения +исключение", said)
    assert re.search("3  C1 34 +CRC +верна", said)
    coils = tree(paste.read("11 0F 00 13 00 0A 02 CD 01 BF 0B"))
    assert "дискр. выходы  с 00020 по 00027: 1011 0011" in coils
    wrong = tree(paste.read("11 03 00 6B 00 03 76 88"))
    assert "CRC              неверна: верная — 76 87, принята 76 88" in wrong
    late = annotate(rtu(bytes.fromhex("11030600010002")), Role.RESPONSE, Context(), wording())
    assert late[3].problem == "нужно 6 байтов, есть 2"
