"""What is known of byte strings from other projects' tests: unit, function, exception, start, count and values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from dissectors.annotation import annotate
from dissectors.envelopes import Adu, ascii_frames, rtu, tcp, tcp_frames
from dissectors.fields import Field
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length

VECTORS = Path(__file__).parents[2] / "shared" / "corpus" / "vectors.jsonl"

# The MBAP length says 2 and 3 bytes follow: a stream is split by that length, so the third is outside frames. Read as
# one frame, the whole is annotated, with the length's problem.
WRONG_LENGTH = "pymodbus-tcp-badlen-exception"

pytestmark = pytest.mark.skipif(not VECTORS.exists(), reason="the corpus of byte strings is not beside the project")


def single_frames() -> list[dict[str, Any]]:
    """Vectors of one frame."""
    if not VECTORS.exists():
        return []
    found = (json.loads(line) for line in VECTORS.read_text(encoding="utf-8").splitlines())
    return [v for v in found if len(v["expect"].get("frames") or []) == 1 and v["role"] != "stream"]


def adu_of(vector: dict[str, Any]) -> Adu:
    raw = bytes.fromhex(vector["bytes_hex"])
    due = bytes.fromhex(vector["expect"]["frames"][0])
    if vector["role"] == "ascii":
        return next(adu for adu in ascii_frames(raw) if adu.data == due)
    if vector["role"] != "tcp":
        return rtu(due)
    if vector["id"] == WRONG_LENGTH:
        assert [adu.length for adu in tcp_frames(raw)] == [len(raw) - 1]
        return tcp(raw)
    return next(adu for adu in tcp_frames(raw) if adu.data == due)


def roles_of(vector: dict[str, Any], adu: Adu) -> list[Role]:
    """The role that the vector states, else those that the length allows."""
    said = vector["expect"].get("kind", vector["role"])
    if said in ("request", "response"):
        return [Role[said.upper()]]
    return [role for role in Role if pdu_length(adu.pdu, role) == len(adu.pdu)]


def flat(fields: tuple[Field, ...]) -> dict[str, Field]:
    return {field.name: field for field in fields}


@pytest.mark.parametrize("vector", single_frames(), ids=lambda v: str(v["id"]))
def test_vector(vector: dict[str, Any]) -> None:
    expect, adu = vector["expect"], adu_of(vector)
    if vector["role"] != "tcp":
        assert adu.check_ok is True
    if expect.get("unit") is not None:
        assert adu.unit == expect["unit"]
    if "function" in expect:
        assert adu.pdu[0] & 0x7F == expect["function"]
    readings = [flat(annotate(adu, role)) for role in roles_of(vector, adu)]
    if expect.get("exception") is not None:
        assert any(fields["exception_code"].value == expect["exception"] for fields in readings)
    if "start" in expect:
        assert any(fields["starting_address"].value == expect["start"] for fields in readings)
    if "count" in expect:
        assert any(fields["quantity"].value == expect["count"] for fields in readings)
    if "values" in expect:
        assert any(expect["values"] == values_of(fields, len(expect["values"])) for fields in readings)


def values_of(fields: dict[str, Field], n: int) -> list[object]:
    """Registers; of bits, as many as asked for."""
    block = next((fields[name] for name in ("registers", "coils", "inputs") if name in fields), None)
    if block is None:
        return []
    values: list[object] = [child.value for child in block.fields]
    return values if block.name == "registers" else [int(bool(value)) for value in values[:n]]
