"""Unit 58 in RTU: its number is the colon with which frames in ASCII mode begin."""

from __future__ import annotations

from bursts import causes, named

from analyzer.causes.exchanges import Ending
from analyzer.causes.rawbytes import KnownRequests, is_in_ascii
from analyzer.causes.samples import Sample, SampleRow
from analyzer.causes.signatures import AnswerDamage, known_header, signature
from analyzer.tables.schema import Kind
from dissectors.crc import crc_bytes, lrc

_BODY = bytes.fromhex("3a0300640002")
REQUEST = _BODY + crc_bytes(_BODY)
_ANSWER = bytes.fromhex("3a030442471838")


def test_a_colon_alone_makes_no_ascii_mode() -> None:
    assert not is_in_ascii(REQUEST)
    assert is_in_ascii(b":010400010010EA\r\n")
    assert is_in_ascii(b":010400010010EA\r")  # its line feed came late
    assert known_header(REQUEST) == bytes.fromhex("3a0304")


def test_the_end_of_an_answer_of_unit_58_is_cut_off() -> None:
    data = _ANSWER + crc_bytes(_ANSWER)[:1]
    piece = SampleRow(int(Kind.NOISE), False, False, 58, 10_000_000, 12_000_000, 0, data)
    sample = Sample(58, 3, REQUEST, Ending.GARBAGE, 9, 0, 0, 500_000_000, (piece,), None, 31)
    found = signature(sample, 1e6, KnownRequests.of([REQUEST]), off_ns=0.0)
    assert (found.damage, found.bytes, found.due) == (AnswerDamage.TAIL, 1, 9)


def _in_ascii(*octets: int) -> bytes:
    return b":" + bytes((*octets, lrc(bytes(octets)))).hex().upper().encode() + b"\r\n"


def test_what_damage_leaves_of_lines_in_ascii_mode_is_no_other_protocol() -> None:
    sent: list[tuple[float, bytes]] = []
    for value in range(40):
        for unit in (4, 9):
            answer = _in_ascii(unit, 3, 4, 0, value, 1, 3 * value)
            late = b"J\x03*2\x1a$" + answer[9:]  # from the $ on it reads like a line of DCON
            sent += [(40.0, _in_ascii(unit, 3, 0, unit, 0, 2)), (12.0, late if unit == 4 else answer)]
    assert named(causes(sent))[0] == ("driver-enabled-late", (4,))
    assert "other-protocol" not in {cause for cause, _ in named(causes(sent))}
