"""The array forms of what is told of one frame at a time elsewhere: they say the same."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from analyzer.deframing.rules import lengths_fit
from dissectors.length_rules import Role
from dissectors.lengths import RULES, sound_roles

FUNCTIONS = sorted({function for function, _ in RULES})
PDUS = st.builds(
    lambda function, head, rest: bytes((function, *head, *rest)),
    st.sampled_from(FUNCTIONS) | st.integers(0, 255),
    st.lists(st.integers(0, 6), max_size=8),
    st.binary(max_size=12),
)


@settings(max_examples=300, deadline=None)
@given(st.lists(PDUS, min_size=1, max_size=6))
def test_lengths_fit_as_sound_roles_says(pdus: list[bytes]) -> None:
    data = np.frombuffer(b"".join(b"\x01" + pdu + b"\0\0" for pdu in pdus), np.uint8)
    length = np.array([len(pdu) + 3 for pdu in pdus], np.intp)
    at = np.cumsum(length) - length
    for i, pdu in enumerate(pdus):
        for role in Role:
            mine = np.flatnonzero(np.array([other[0] == pdu[0] for other in pdus]))
            fits = lengths_fit(data, at[mine], length[mine], pdu[0], role)
            assert bool(fits[mine.tolist().index(i)]) == (role in sound_roles(pdu)), (pdu.hex(), role)
