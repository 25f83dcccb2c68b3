"""Text that arrays put together is what Python's own joining and formatting give."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from analyzer.exports.encoding.pieces import Store, decimals, inside, insides, without
from analyzer.exports.encoding.sheet import Sheet
from analyzer.exports.targets.csv import _seconds

TEXTS = st.lists(
    st.binary(max_size=9) | st.integers(0, 700).map(lambda n: bytes(i % 251 for i in range(n))), max_size=9
)
WHOLE = (1 << 63) - 1


def joined(sheet: Sheet) -> bytes:
    return b"".join(sheet.parts())


@given(st.lists(st.integers(-WHOLE, WHOLE) | st.integers(-10001, 10001), max_size=20))
@example([0])
@example([-WHOLE, WHOLE])
@example([-9999, 9999, 10000])
def test_numbers_read_as_python_writes_them(numbers: list[int]) -> None:
    text, begins, sizes = decimals(np.array(numbers, np.int64))
    places = zip(begins.tolist(), sizes.tolist(), strict=True)
    assert [text[at : at + size].tobytes() for at, size in places] == [b"%d" % number for number in numbers]


@given(TEXTS, TEXTS, st.data())
def test_pieces_of_any_size_are_joined(kept: list[bytes], lent: list[bytes], data: st.DataObject) -> None:
    store = Store()
    made = store.add(kept)
    sheet = Sheet(store, np.zeros(0, np.int64))
    pieces = np.concatenate((made[: len(made) // 2], sheet.texts(lent), made[len(made) // 2 :]))
    texts = [*kept[: len(made) // 2], *lent, *kept[len(made) // 2 :]]
    order = data.draw(st.lists(st.integers(0, len(texts) - 1), max_size=30)) if texts else []
    sheet.pieces = pieces[order] if order else sheet.pieces
    assert joined(sheet) == b"".join(texts[i] for i in order)


@given(st.lists(st.lists(st.integers(0, 50) | st.integers(0, 1 << 40), max_size=30), max_size=6), st.integers(1, 300))
def test_tables_give_what_was_made_also_after_forgetting(asked: list[list[int]], kept: int) -> None:
    store = Store(kept)
    table = store.table(lambda number: b"<%d>" % number)
    for numbers in asked:
        store.settle()
        sheet = Sheet(store, np.ones(len(numbers), np.int64))
        sheet.at(np.arange(len(numbers))).put(table.take(np.array(numbers, np.int64)))
        assert joined(sheet) == b"".join(b"<%d>" % number for number in numbers)


def test_a_piece_without_its_beginning() -> None:
    store = Store()
    sheet = Sheet(store, np.zeros(0, np.int64))
    sheet.pieces = without(store.add([b", 12", b", 345"]), 2)
    assert joined(sheet) == b"12345"


@given(st.lists(st.text(max_size=6) | st.sampled_from(['"', '","', "\\", '\\","']), max_size=8))
def test_texts_at_once_are_escaped_as_each_is(texts: list[str]) -> None:
    assert insides(texts) == [inside(text) for text in texts]


@given(st.lists(st.integers(-(10**18), 10**18) | st.integers(0, 10**7) | st.integers(0, 10**13).map(lambda n: 500 * n)))
@example([499, 500, 501, 999_999_499, 999_999_500, 999_999_999, (1 << 53) - 1, 1 << 53, -1, -500])
def test_seconds_round_as_their_float_does(ns: list[int]) -> None:
    sheet = Sheet(Store(), np.full(len(ns), 3))
    cursor = sheet.at(np.arange(len(ns)))
    whole, rest = _seconds(np.array(ns, np.int64), sheet)
    for part in (whole, b".", rest):
        cursor.put(part)
    assert joined(sheet).decode() == "".join(f"{one / 1e9:.6f}" for one in ns)
