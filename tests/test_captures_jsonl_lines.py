"""Plain lines of reads as arrays: what JSON would say of them, or nothing."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from captures.formats.jsonl import reads_in

times = st.integers(0, 10**18 - 1) | st.integers(0, 99)
reads = st.lists(st.tuples(times, st.binary(min_size=1, max_size=300)), min_size=1, max_size=30)


def text_of(reads: list[tuple[int, bytes]], separators: tuple[str, str]) -> bytes:
    lines = (json.dumps({"t_ns": t, "hex": data.hex()}, separators=separators) + "\n" for t, data in reads)
    return "".join(lines).encode()


@given(reads=reads, separators=st.sampled_from([(", ", ": "), (",", ":")]))
def test_plain_lines_are_read(reads: list[tuple[int, bytes]], separators: tuple[str, str]) -> None:
    text = text_of(reads, separators)
    found = reads_in(text)
    assert found is not None
    t_ns, sizes, data = found
    assert t_ns.tolist() == [t for t, _ in reads]
    assert sizes.tolist() == [len(content) for _, content in reads]
    assert data == b"".join(content for _, content in reads)


@given(reads=reads, data=st.data())
def test_a_changed_text_is_read_as_json_reads_it_or_not_at_all(
    reads: list[tuple[int, bytes]], data: st.DataObject
) -> None:
    text = bytearray(text_of(reads[:4], (", ", ": ")))
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(text) - 1))
        text[at : at + data.draw(st.integers(0, 3))] = data.draw(
            st.sampled_from([b"", b'"', b"0", b" ", b"a", b"\n", b"\\", b"-", b"9", b"{", b"}\n", b"\xff"])
        )
    found = reads_in(bytes(text))
    if found is None:
        return
    rows = [json.loads(line) for line in bytes(text).splitlines()]
    assert found[0].tolist() == [row["t_ns"] for row in rows]
    assert found[2] == b"".join(bytes.fromhex(row["hex"]) for row in rows)
    assert found[1].tolist() == [len(row["hex"]) // 2 for row in rows]


@pytest.mark.parametrize(
    "line",
    [
        b'{"t_ns": 1, "hex": ""}\n',
        b'{"t_ns": 1, "hex": "1"}\n',
        b'{"t_ns": 1, "hex": "1 1 "}\n',
        b'{"t_ns": 1, "hex": "zz"}\n',
        b'{"t_ns": 01, "hex": "11"}\n',
        b'{"t_ns": -1, "hex": "11"}\n',
        b'{"t_ns": 1.5, "hex": "11"}\n',
        b'{"t_ns": , "hex": "11"}\n',
        b'{"t_ns": 1000000000000000000000, "hex": "11"}\n',
        b'{"t_ns": 1, "hex": "11", "port": 1}\n',
        b'{"t_ns": 1, "hex": "11"}',
        b'{"hex": "11", "t_ns": 1}\n',
        b'{"t_ns":1, "hex": "11"}\n',
        b"\n",
        b"",
    ],
)
def test_anything_else_is_left_to_a_parser(line: bytes) -> None:
    good = b'{"t_ns": 1, "hex": "11"}\n'
    assert reads_in(line) is None
    assert reads_in(good + line) is None or not line
    assert reads_in(line + good) is None or not line
    assert reads_in(good) is not None
