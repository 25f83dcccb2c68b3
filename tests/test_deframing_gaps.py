"""Silences are sorted into classes, and the conversation is carried past runs of frames, alike by every way."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.deframing.conversation import Conversation, FrameRun, OpenRequest, conversation_after
from analyzer.deframing.gaps import _EDGES, classes_of
from dissectors.length_rules import Role
from dissectors.lengths import expectation

NS = st.integers(-(1 << 62), 1 << 62) | st.integers(-(10**6), 10**10)


@given(st.lists(NS, min_size=1), st.floats(1.0, 1e8))
def test_a_silence_is_of_the_class_between_whose_edges_it_lies(silences: list[int], char_ns: float) -> None:
    on_edges = (_EDGES * char_ns).astype(np.int64)
    all_of_them = np.concatenate((np.array(silences, np.int64), on_edges - 1, on_edges, on_edges + 1))
    assert (classes_of(all_of_them, char_ns) == np.digitize(all_of_them / char_ns, _EDGES) + 1).all()


FRAMES = st.sampled_from([
    (Role.REQUEST, bytes.fromhex("010300000001840a")),
    (Role.REQUEST, bytes.fromhex("010300000002c40b")),
    (Role.REQUEST, bytes.fromhex("0006000100059818")),
    (Role.RESPONSE, bytes.fromhex("0103020005784f")),
    (Role.RESPONSE, bytes.fromhex("01030400050006da31")),
    (Role.RESPONSE, bytes.fromhex("018302c0f1")),
])  # fmt: skip


@given(st.lists(FRAMES, min_size=1, max_size=40))
def test_a_run_leaves_the_conversation_that_its_frames_one_by_one_leave(frames: list[tuple[Role, bytes]]) -> None:
    conversation, offset, fits = Conversation(), 5000, [False]
    for role, adu in frames:
        if role is Role.REQUEST:
            conversation = conversation.ask(OpenRequest.of(offset, adu))
        elif (which := conversation.answers(adu)) is not None:
            conversation = conversation.answer(which)
        offset += len(adu)
    for (role, asked), (next_role, answer) in pairwise(frames):
        turn = role is Role.REQUEST and next_role is Role.RESPONSE
        fits.append(turn and expectation(asked).fits(answer))
    ends = np.cumsum([len(adu) for _, adu in frames])
    starts = ends - np.array([len(adu) for _, adu in frames])
    data = np.frombuffer(b"".join(adu for _, adu in frames), np.uint8)
    roles = np.array([role for role, _ in frames], np.uint8)
    assert conversation_after(Conversation(), FrameRun(data, 5000, starts, ends, roles, np.array(fits))) == conversation
