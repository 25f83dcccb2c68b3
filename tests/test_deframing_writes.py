"""A write that comes once more: the unit's answer, or the client that got none."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from buses import CHAR_NS, LINE, Found, adu, deframed, rtu_deframer

from analyzer.reports import summarize
from analyzer.simulation.field.cases.registry import field_cases
from analyzer.tables.schema import Kind
from captures.chunks import Block, Capture, Chunk

READ, WORD = adu("010300100001"), adu("0103020007")
WRITE, OTHER = adu("050600200001"), adu("06050001ff00")
MS = 1_000_000


def bus(*frames: tuple[int, bytes]) -> list[Chunk]:
    """Frames, each so many ms behind the one before it, a byte a read."""
    chunks, now = [], 1_000_000_000
    for pause, frame in frames:
        now += pause * MS
        for octet in frame:
            now += CHAR_NS
            chunks.append(Chunk(now, bytes([octet])))
    return chunks


def polls(count: int, pause: int = 8) -> list[tuple[int, bytes]]:
    return [(pause, READ), (5, WORD)] * count


def directions(chunks: Sequence[Chunk], frame: bytes) -> str:
    """Those of the frames that read so, in order."""
    return told(deframed([Block.from_chunks(chunks)]), frame)


def told(found: Found, frame: bytes) -> str:
    """The same of what was found."""
    rows = [row for row in found.rows if found.data[row.start : row.start + row.length] == frame]
    return "".join({Kind.REQUEST: "q", Kind.RESPONSE: "a"}.get(Kind(row.kind), "?") for row in rows)


def test_a_write_that_nobody_answers_is_asked_again() -> None:
    once = [*polls(3), (8, WRITE), (500, WRITE), (505, READ), (5, WORD)]
    assert directions(bus(*polls(2), *once * 3), WRITE) == "qq" * 3
    thrice = [*polls(3), (8, WRITE), (500, WRITE), (501, WRITE), (503, WRITE), (500, READ), (5, WORD)]
    assert directions(bus(*thrice * 2), WRITE) == "qqqq" * 2


@pytest.mark.parametrize(
    ("once", "read"),
    [
        ([(1000, WRITE), (260, WRITE), (283, READ), (5, WORD), (30, READ), (5, WORD), (1000, READ), (5, WORD)], "qq"),
        ([(100, READ), (5, WORD), (100, WRITE), (265, WRITE), (365, READ), (5, WORD), (100, READ), (5, WORD)], "qq"),
        ([(200, READ), (5, WORD), (200, WRITE), (300, WRITE), (301, WRITE), (500, READ), (5, WORD)], "qqq"),
    ],
    ids=["behind a short round", "a pause of its own", "twice as long as a pause"],
)
def test_a_client_that_gave_up_goes_on_behind_its_pause_however_long_it_rests(
    once: list[tuple[int, bytes]], read: str
) -> None:
    assert directions(bus(*polls(2, 30), *once * 12), WRITE)[-4 * len(read) :] == read * 4


@pytest.mark.parametrize(
    ("delay", "behind"), [(40, 8), (400, 8), (400, 60), (150, 900), (2000, 9), (300, 5000), (160, 128)], ids=str
)
def test_a_slow_answer_stays_one(delay: int, behind: int) -> None:
    slow = [*polls(4), (8, WRITE), (delay, WRITE), (behind, READ), (5, WORD)]
    assert directions(bus(*slow * 4), WRITE) == "qa" * 4


def test_where_the_client_always_rests_so_long_nothing_tells() -> None:
    """Neither the silence before nor that behind says whose it is."""
    assert directions(bus(*[(500, WRITE), (500, WRITE)] * 8), WRITE) == "qa" * 8
    rests = [*polls(3, 480), (500, WRITE), (500, WRITE)]
    assert directions(bus(*rests * 4), WRITE) == "qa" * 4


def test_a_timeout_that_is_known_tells_it_where_the_list_ends_in_a_rest() -> None:
    silent = [(8, adu("070300000002")), (500, READ), (5, WORD)]
    rest = [*polls(2), *silent, (8, WRITE), (500, WRITE), (4000, READ), (5, WORD)]
    assert directions(bus(*polls(2), *silent * 3, *rest * 3), WRITE) == "qq" * 3
    assert directions(bus(*rest * 3)[: -len(READ + WORD)], WRITE)[-1] == "q"  # nothing is heard behind the last one


def test_it_hangs_on_the_bytes_and_their_times_alone() -> None:
    once = [*polls(2), (8, WRITE), (300, WRITE), (304, OTHER), (700, OTHER), (9, READ), (5, WORD)]
    chunks = bus(*once * 5)
    whole = deframed([Block.from_chunks(chunks)])
    assert deframed(chunks).rows.kind.tolist() == whole.rows.kind.tolist()
    live = rtu_deframer(LINE)
    kinds: list[int] = []
    for chunk in chunks:
        kinds += live.tick(chunk.t_ns - MS).rows.kind.tolist()
        kinds += live.feed(chunk).rows.kind.tolist()
    kinds += live.close().rows.kind.tolist()
    assert kinds == whole.rows.kind.tolist()
    assert directions(chunks, WRITE) == "qq" * 5
    assert directions(chunks, OTHER) == "qa" * 5


def test_live_it_is_given_once_the_silence_behind_it_tells() -> None:
    chunks = bus(*polls(4), (8, WRITE), (300, WRITE))
    live = rtu_deframer(LINE)
    given = sum(len(live.feed(chunk).rows) for chunk in chunks)
    end = chunks[-1].t_ns
    given += len(live.tick(end + 200 * MS).rows)
    assert given == 9  # whether it is an answer shows when the next frame comes,
    assert live.tick(end + 2000 * MS).rows.kind.tolist() == [Kind.RESPONSE]  # or does not for so long


def test_a_second_port_lets_go_of_what_was_held_back() -> None:
    chunks = bus(*polls(20), (8, WRITE), (300, WRITE))
    live = rtu_deframer(LINE)
    rows = [live.feed(chunk).rows for chunk in chunks]
    rows.append(live.tick(chunks[-1].t_ns + 50 * MS).rows)
    assert sum(map(len, rows)) == 41
    rows += [live.feed(Chunk(chunks[-1].t_ns + 60 * MS, READ, 1)).rows, live.close().rows]
    assert sum(map(len, rows)) == 43


@pytest.mark.parametrize("seed", [1, 2])
def test_table_and_cause_count_the_same_requests(seed: int) -> None:
    """A unit that is only written to and never answers: it has no answer in any view."""
    made = field_cases()["written-dead-unit"].capture("precise", seed)
    (unit,) = made.expected.units
    report = summarize(Capture.of(made.line, made.chunks))
    counts = next(row.counts for row in report.units if row.unit == unit)
    asked = counts.requests - counts.unheard  # where a capture ends with a request, nobody knows of its answer
    assert counts.answered == 0 and f"{asked} of {asked} requests" in report.causes[0].text
    assert "slow-device" not in {row.code for row in report.findings}


DAMAGED = bytes([0x05, 0x06, 0x80, 0x20])


@pytest.mark.parametrize("timed", [True, False], ids=["timed", "untimed"])
@pytest.mark.parametrize(
    ("behind", "read"),
    [([(7, WRITE)], "qqa"), ([(7, DAMAGED)], "qq"), ([], "qa")],
    ids=["answered", "damaged again", "not at all"],
)
def test_a_write_whose_answer_came_damaged_is_asked_again(
    behind: list[tuple[int, bytes]], read: str, *, timed: bool
) -> None:
    once = [*polls(3), (8, WRITE), (7, DAMAGED), (20, WRITE), *behind, (9, READ), (5, WORD)]
    chunks = bus(*polls(2), *once * 3)
    found = deframed([Block.from_chunks(chunks, timed=timed)])
    assert told(found, WRITE) == read * 3


def test_what_drivers_leave_on_a_line_is_no_damaged_answer() -> None:
    once = [*polls(3), (8, WRITE), (1, bytes([0xFE, 0xFF, 0xFF, 0])), (7, WRITE), (2, bytes([0, 0xFE, 0xFF, 0]))]
    assert directions(bus(*polls(2), *once * 3, *polls(1)), WRITE) == "qa" * 3
