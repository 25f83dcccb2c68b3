"""What the autopsy says of damaged frames: by example, by law, and how often it is right."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest
from buses import adu
from damages import DAMAGES, damaged
from hypothesis import given
from hypothesis import strategies as st

from analyzer.diagnosis.damage import FRAME, DamagedFrame, Explanation, autopsy, divided, joined
from dissectors.crc import VARIANTS, crc_bytes, crc_ok
from dissectors.length_rules import Role

READ = adu("1103006b0003")
ANSWER = adu("110306ae4156524340")

# Of each hundred damages, how many are told for what they are. What is short of all is ambiguous in itself: a CRC that
# a single flipped bit explains by chance, two transmitters whose first bytes agree, an answer cut to one byte less.
RECALL = dict.fromkeys(DAMAGES, 0.98) | {"crc-error": 0.95, "collision": 0.94}
PRECISION = dict.fromkeys(DAMAGES, 0.98) | {"crc-error": 0.94}


def _answered(data: bytes, **other: object) -> Explanation:
    return autopsy(replace(DamagedFrame(data, Role.RESPONSE, request=READ), **other))  # type: ignore[arg-type]


def test_a_flipped_bit_is_named() -> None:
    data = bytearray(ANSWER)
    data[5] ^= 1 << 3
    verdict = _answered(bytes(data))
    assert (verdict.code, verdict.byte, verdict.bit, verdict.repaired) == ("bit-flip", 5, 3, ANSWER)
    assert verdict.certainty > 0.99


@pytest.mark.parametrize("at", range(len(ANSWER)))
def test_a_lost_byte_is_named_wherever_it_was(at: int) -> None:
    verdict = _answered(ANSWER[:at] + ANSWER[at + 1 :])
    assert verdict.code == "byte-missing"
    assert any(place.first <= at <= place.last and place.value == ANSWER[at] for place in verdict.places)


def test_a_byte_lost_of_a_run_is_said_to_be_anywhere_in_it() -> None:
    sent = adu("110306000000000000")
    verdict = _answered(sent[:4] + sent[5:])
    assert verdict.code == "byte-missing"
    assert verdict.places[0] == (3, 8, 0)


@pytest.mark.parametrize("at", range(1, len(ANSWER)))
def test_an_added_byte_is_named(at: int) -> None:
    verdict = _answered(ANSWER[:at] + b"\x7e" + ANSWER[at:])
    assert verdict.code == "byte-extra"
    assert verdict.places[0] == (at, at, 0x7E)
    assert verdict.repaired == ANSWER


def test_a_doubled_slice_of_22_bytes() -> None:
    asked, sent = adu("010300000028"), adu("010350" + bytes(range(80)).hex())
    verdict = autopsy(DamagedFrame(sent[:40] + sent[18:], Role.RESPONSE, request=asked))
    assert (verdict.code, verdict.length, verdict.repaired) == ("bytes-repeated", 22, sent)


def test_cut_short() -> None:
    verdict = _answered(ANSWER[:6])
    assert (verdict.code, verdict.length, verdict.at_least) == ("truncated", 11, False)


def test_cut_before_the_length_is_told() -> None:
    verdict = autopsy(DamagedFrame(adu("01100000000204000a0102")[:6], Role.REQUEST))
    assert (verdict.code, verdict.at_least) == ("truncated", True)


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_other_conventions_are_named(variant: object) -> None:
    body = ANSWER[:-2]
    verdict = _answered(body + variant.made(body))  # type: ignore[attr-defined]
    assert verdict.code == "crc-variant"
    assert verdict.variant == variant.name  # type: ignore[attr-defined]


def test_lost_xon_xoff_bytes_are_put_back() -> None:
    asked = adu("110300130001")
    verdict = autopsy(DamagedFrame(asked.translate(None, b"\x11\x13"), Role.REQUEST))
    assert (verdict.code, verdict.lost, verdict.repaired) == ("flow-control-loss", 2, asked)


def test_a_port_that_lets_xon_through_has_no_flow_control() -> None:
    sent = adu("010306001112345678")
    data = sent[:4] + sent[5:]
    assert autopsy(DamagedFrame(data, Role.RESPONSE, flow_free=3000)).code == "flow-control-loss"
    assert autopsy(DamagedFrame(data, Role.RESPONSE, flow_free=0)).code == "byte-missing"


def test_what_no_simple_thing_explains() -> None:
    verdict = _answered(ANSWER[:-2] + b"\x12\x34")
    assert verdict.code == "crc-error"
    assert verdict.repaired is None


def test_garbage_where_an_answer_was_due() -> None:
    noise = bytes.fromhex("a3f190c81de76b025593")
    assert _answered(noise).code == "collision"
    assert autopsy(DamagedFrame(noise)).code == "crc-error"


def test_an_answer_that_another_one_talks_over_is_longer() -> None:
    assert _answered(ANSWER[:7] + bytes.fromhex("8e40c29b61ffe2037a")).code == "collision"


def test_a_recurring_request_settles_what_the_crc_leaves_open() -> None:
    polls = {adu(f"0103{address:04x}0002") for address in range(0, 100, 10)}
    sent = min(polls)
    verdict = autopsy(DamagedFrame(sent[1:], known=polls))
    assert (verdict.code, verdict.repaired) == ("byte-missing", sent)


def test_a_byte_left_over_belongs_to_the_frame() -> None:
    captured = READ[:4] + b"\x55" + READ[4:]
    found = joined(DamagedFrame(captured[:8], Role.REQUEST), after=captured[8:])
    assert (found.verdict.code, found.verdict.repaired, found.before, found.after) == ("byte-extra", READ, 0, 1)


def test_a_glitch_before_a_frame_does_not() -> None:
    data = bytearray(ANSWER)
    data[5] ^= 1 << 3
    found = joined(DamagedFrame(bytes(data), Role.RESPONSE, request=READ), before=b"\x00")
    assert (found.verdict.code, found.verdict.byte, found.before, found.after) == ("bit-flip", 5, 0, 0)


def test_frames_that_flow_control_ran_together_are_taken_apart() -> None:
    left = [frame.translate(None, b"\x11\x13") for frame in (READ, ANSWER, adu("110600010003"), adu("110600010003"))]
    parts = divided(DamagedFrame(b"".join(left), flow_free=2000))
    assert [(part.start, part.length) for part in parts] == [(0, 7), (7, 10), (17, 7), (24, 7)]
    assert [part.verdict.repaired for part in parts[:2]] == [READ, ANSWER]
    assert {part.verdict.code for part in parts} == {"flow-control-loss"}


@given(st.binary(max_size=60), st.sampled_from([None, READ]))
def test_what_flow_control_does_not_explain_is_not_taken_apart(data: bytes, request: bytes | None) -> None:
    parts = divided(DamagedFrame(data, request=request, flow_free=2000))
    assert not parts or [part.start for part in parts[1:]] == [part.start + part.length for part in parts[:-1]]
    assert sum(part.length for part in parts) in (0, len(data))


@pytest.mark.parametrize("length", [3, 5, 9, 20])
def test_noise_is_no_frame(length: int) -> None:
    random = Random(length)
    stretches = [random.randbytes(length) for _ in range(300)]
    held = sum(autopsy(DamagedFrame(data, units=(1, 17, 40))).bits >= FRAME for data in stretches)
    assert held <= 3


@given(
    st.binary(max_size=300),
    st.sampled_from([None, *Role]),
    st.sampled_from([None, READ, adu("00050001ff00"), b"\x01"]),
    st.sampled_from([None, 0, 5000]),
)
def test_any_bytes_get_a_verdict(data: bytes, role: Role | None, request: bytes | None, free: int | None) -> None:
    verdict = autopsy(DamagedFrame(data, role, request=request, flow_free=free))
    assert 0 <= verdict.certainty <= 1
    for said in (verdict, *verdict.rivals):
        assert said.repaired is None or crc_ok(said.repaired)
        assert said.bits <= verdict.bits


@given(st.sampled_from(sorted(DAMAGES)), st.integers(0, 10_000))
def test_a_repair_is_what_it_says(code: str, seed: int) -> None:
    for one in damaged(code, seed, 1):
        data, verdict = one.case.data, autopsy(one.case)
        for said in (verdict, *verdict.rivals):
            if said.code == "bit-flip":
                assert said.repaired is not None and said.byte is not None and said.bit is not None
                changed = [i for i, (a, b) in enumerate(zip(said.repaired, data, strict=True)) if a != b]
                assert changed == [said.byte]
                assert said.repaired[said.byte] ^ data[said.byte] == 1 << said.bit
            for place in said.places:
                at = place.last
                if said.code == "byte-missing":
                    assert crc_ok(data[:at] + bytes((place.value,)) + data[at:])
                elif said.code == "byte-extra":
                    assert data[at] == place.value
                    assert crc_ok(data[:at] + data[at + 1 :])


def test_how_often_it_is_right() -> None:
    said, right = dict.fromkeys(DAMAGES, 0), dict.fromkeys(DAMAGES, 0)
    count = 300
    for code in DAMAGES:
        placed = 0
        for one in damaged(code, 7, count):
            verdict = autopsy(one.case)
            said[verdict.code] += 1
            right[code] += verdict.code == code
            placed += verdict.code == code and one.told(verdict)
        assert right[code] >= RECALL[code] * count, code
        assert placed >= 0.98 * right[code], code
    for code in DAMAGES:
        assert right[code] >= PRECISION[code] * said[code], code


@pytest.mark.parametrize("lost", [1, 3])
def test_a_robbed_answer_too_long_to_be_solved_is_told_by_the_robbed_request_behind_it(lost: int) -> None:
    """Its length is due, and what is left of it must end where the next frame, which the check value proves, begins."""
    request = bytes.fromhex("1e0400040055739b")
    values = bytes(20 + i % 200 for i in range(170))
    answer = bytes((30, 4, 170)) + bytes((0x11, 0x13)) * lost + values[2 * lost :]
    answer += crc_bytes(answer)
    behind = bytes.fromhex("0a0300110004")
    behind += crc_bytes(behind)
    left = [frame.translate(None, bytes((0x11, 0x13))) for frame in (answer, behind)]
    parts = divided(DamagedFrame(b"".join(left), request=request, flow_free=2000))
    assert [(part.start, part.length, part.verdict.lost) for part in parts] == [
        (0, len(left[0]), len(answer) - len(left[0])),
        (len(left[0]), len(left[1]), len(behind) - len(left[1])),
    ]
