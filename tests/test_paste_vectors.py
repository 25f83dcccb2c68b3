"""Pasted bytes read right on 460 strings from other software's tests and trackers (the shared corpus).

Each one that this reading disagrees with is in DISAGREED, with the reason why the reading stays.
"""

import json

import pytest
from buses import shared

from analyzer.paste import read
from analyzer.paste.model import Envelope

DISAGREED = {
    "pymodbus-tcp-badlen-exception": "MBAP says 2 bytes, 3 follow: the length ends the frame",
    "aldas-82": "MBAP says 8 bytes, 5 follow: the answer is cut, and said to need 3 more",
    "aldas-74": "a request to register 0 with a wrong CRC as well: of a serial line it is the likelier",
    "pymodbus-ascii-dec-6": "no CR LF, but the LRC is right: people paste such lines without their ends",
    "pymodbus-ascii-dec-7": "as pymodbus-ascii-dec-6, with other text before",
    "minimalmodbus-rtu-81": "the second chunk holds a damaged echo, then a whole answer with a right CRC",
    "mbserial-srv-short": "too short for function 10, but its CRC is right: a frame that breaks the specification",
}
GUESSED = frozenset({"aldas-74"})  # of these, where nobody says which envelope it is
PROTOCOL: dict[str, Envelope] = {"request": "rtu", "response": "rtu", "stream": "rtu", "ascii": "ascii", "tcp": "tcp"}


def vectors():
    return [json.loads(line) for line in shared("corpus/vectors.jsonl").read_text(encoding="utf-8").splitlines()]


def disagreements(vector, paste):
    """What the reading says other than what is expected."""
    expect = vector["expect"]
    frames = list(paste.frames())
    good = [frame for frame in frames if frame.check_ok is not False]
    found = []
    if "frames" in expect and [frame.adu.data.hex() for frame in good] != expect["frames"]:
        found.append(("frames", expect["frames"], [frame.adu.data.hex() for frame in good]))
    if expect.get("frames") and paste.protocol != PROTOCOL[vector["role"]]:
        found.append(("protocol", PROTOCOL[vector["role"]], paste.protocol))
    first = (good or frames or [None])[0]
    if first is not None:
        said = {"unit": first.adu.unit, "function": first.function}
        found += [(key, expect[key], value) for key, value in said.items() if expect.get(key) not in (None, value)]
        if "exception" in expect and expect["exception"] not in [frame.exception for frame in frames]:
            found.append(("exception", expect["exception"], [frame.exception for frame in frames]))
        if "crc_ok" in expect and expect["crc_ok"] != (len(frames) == 1 and frames[0].check_ok):
            found.append(("crc_ok", expect["crc_ok"], [frame.check_ok for frame in frames]))
        if vector["role"] in ("request", "response") and expect.get("frames") and first.also is None:
            role = first.role.name.lower()
            found += [] if role == vector["role"] else [("role", vector["role"], role)]
    return found


@pytest.mark.parametrize("envelope", ["auto", "known"])
@pytest.mark.parametrize("lines", [False, True])
def test_every_vector_is_read_right(envelope, lines):
    wrong = {}
    for vector in vectors():
        pieces = vector.get("chunks", [vector["bytes_hex"]]) if lines else [vector["bytes_hex"]]
        text = "\n".join(bytes.fromhex(piece).hex(" ") for piece in pieces)
        paste = read(text, "auto" if envelope == "auto" else PROTOCOL[vector["role"]])
        if found := disagreements(vector, paste):
            wrong[vector["id"]] = found
    assert {name: found for name, found in wrong.items() if name not in DISAGREED} == {}
    guessed = GUESSED if envelope == "known" else frozenset()
    assert set(wrong) == set(DISAGREED) - guessed, "a reason that is no longer needed"


def test_what_is_not_modbus_is_no_frame():
    for vector in vectors():
        if vector["expect"].get("not_modbus"):
            assert not any(frame.check_ok for frame in read(bytes.fromhex(vector["bytes_hex"]).hex(" ")).frames()), (
                vector["id"]
            )
