"""The law of the deframer's edges: bytes beside a legal frame never hide it from a tap, whatever it hears else."""

from __future__ import annotations

from buses import LINE, deframed, heard, transactions
from hypothesis import event, example, given, settings
from hypothesis import strategies as st

from analyzer.simulation import TAPS
from analyzer.tables.schema import Kind
from dissectors.lengths import sound_roles

_MOST_STRAYS = 8

conversations = st.lists(transactions(), max_size=3)
glitches = st.lists(st.sampled_from([b"\0", b"\xff", b"\xfe"]), max_size=_MOST_STRAYS).map(b"".join)
stray_bytes = st.one_of(glitches, st.binary(max_size=_MOST_STRAYS))
frames = st.tuples(transactions(), st.integers(0, 1)).map(lambda drawn: drawn[0][drawn[1]])
WRITE, UNANSWERED = bytes.fromhex("010500000000cdca"), bytes.fromhex("010100000001fdca")
ANSWER = bytes.fromhex("0103020019798e")


@settings(deadline=None)
@given(
    ahead=conversations,
    before=stray_bytes,
    frame=frames,
    behind=stray_bytes,
    after=conversations,
    tap=st.sampled_from(sorted(TAPS)),
    seed=st.integers(0, 99),
)
@example(ahead=[], before=b"", frame=ANSWER, behind=b"\0", after=[], tap="untimed", seed=0)
@example(ahead=[], before=b"\xfe", frame=ANSWER, behind=b"\0\0", after=[], tap="ftdi16", seed=0)
@example(
    ahead=[[WRITE, WRITE]], before=b"\0\0\0\1", frame=UNANSWERED, behind=b"\0\0\1", after=[[WRITE, WRITE]],
    tap="untimed", seed=0,
)  # fmt: skip
def test_a_legal_frame_is_found_among_stray_bytes(
    ahead: list[list[bytes]],
    before: bytes,
    frame: bytes,
    behind: bytes,
    after: list[list[bytes]],
    tap: str,
    seed: int,
) -> None:
    """Or legal frames with right CRCs explain its bytes as well: no bytes of it are given up."""
    pieces = [piece for pair in ahead for piece in pair]
    start = len(b"".join(pieces)) + len(before)
    pieces += [before + frame + behind, *(piece for pair in after for piece in pair)]
    found = deframed(heard(pieces, tap, seed), LINE)
    whole = [(row.start, row.length) for row in found.rows if row.kind != Kind.NOISE and row.check]
    if (start, len(frame)) in whole:
        event("found")
        return
    event("other frames")
    overlapping = [(at, size) for at, size in whole if at < start + len(frame) and start < at + size]
    assert overlapping
    assert all(sound_roles(found.data[at + 1 : at + size - 2]) for at, size in overlapping)
