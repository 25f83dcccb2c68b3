"""Frames, directions, pairs and damage: a row a frame, against what was sent.

A row: `start`, `length` (bytes of the stream), `crc_ok`; where the tool claims them `direction` (request, response or
null) and `request_start` (where the request begins that a response answers, or null).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..items import Row

_SHORTEST = 4  # bytes: less is no frame, damaged or not


def check(row: Row, size: int) -> str:
    """What is wrong with a row, "" if nothing; `size` is that of the stream."""
    start, length = row.get("start"), row.get("length")
    if type(start) is not int or type(length) is not int or start < 0 or length < 1 or start + length > size:
        return f"start and length must be whole numbers within the {size} bytes"
    if type(row.get("crc_ok")) is not bool:
        return "crc_ok must be true or false"
    if row.get("direction") not in (None, "request", "response"):
        return "direction must be request, response or null"
    if row.get("request_start") is not None and type(row["request_start"]) is not int:
        return "request_start must be a whole number or null"
    return ""


def f1(hits: float, wanted: int, given: int) -> float:
    """Harmonic mean of recall and precision."""
    return 2 * hits / (wanted + given) if wanted + given else 1.0


def _intact(truth: Row) -> dict[tuple[int, int], Row]:
    return {(one["start"], one["length"]): one for one in truth["frames"] if one["intact"]}


def _found(truth: Row, rows: Sequence[Row]) -> list[tuple[Row, Row]]:
    """Intact frames that rows name exactly, each once, with the first row that does."""
    wanted = _intact(truth)
    found: dict[tuple[int, int], Row] = {}
    for row in rows:
        place = row["start"], row["length"]
        if row["crc_ok"] and place in wanted:
            found.setdefault(place, row)
    return [(wanted[place], row) for place, row in found.items()]


def frames(truth: Row, rows: Sequence[Row]) -> float:
    """F1 of frames that arrived unchanged; every other row with a right check value is a false one."""
    return f1(len(_found(truth, rows)), len(_intact(truth)), sum(row["crc_ok"] for row in rows))


def directions(truth: Row, rows: Sequence[Row]) -> float | None:
    """Share of intact frames, of those whose direction is known, that are found and have the right one."""
    known = sum("role" in one for one in _intact(truth).values())
    right = sum(one.get("role") == row.get("direction") for one, row in _found(truth, rows))
    return right / known if known else None


def pairs(truth: Row, rows: Sequence[Row]) -> float | None:
    """F1 of intact responses with the request that they answer. Tries in a row of the same bytes are one request."""
    by_id = {one["id"]: one for one in truth["frames"] if one["intact"]}
    asked = {one["id"]: by_id[one["pair"]] for one in by_id.values() if one.get("pair") in by_id}
    tries = _tries(by_id.values())
    hits = given = 0
    for one, row in _found(truth, rows):
        named = row.get("request_start")
        given += one.get("role") == "response" and named is not None
        hits += one["id"] in asked and tries.get(named) == tries[asked[one["id"]]["start"]]
    return f1(hits, len(asked), max(given, hits)) if asked else None


def _tries(frames: Iterable[Row]) -> dict[int | None, int]:
    """Where each request begins, and which run of the same request it is a try of; nothing on the line tells them."""
    runs: dict[int | None, int] = {}
    before = ""
    for one in frames:
        if one.get("role") == "request":
            runs[one["start"]] = len(runs) if one["hex"] != before else max(runs.values())
            before = one["hex"]
    return runs


def damage(truth: Row, rows: Sequence[Row]) -> float | None:
    """F1 of damaged frames: a row with a wrong check value finds one where they share half of what either covers.

    Remains of less than four bytes count neither way.
    """
    damaged = [one for one in truth["frames"] if one["fault"] and one["length"] >= _SHORTEST]
    remains = [one for one in truth["frames"] if one["fault"] and one["length"] < _SHORTEST]
    left = list(damaged)
    false = 0
    for row in rows:
        if row["crc_ok"]:
            continue
        near = max(left, key=lambda one: _overlap(one, row), default=None)
        if near is not None and _overlap(near, row) >= 0.5:
            left.remove(near)
        else:
            false += all(_overlap(one, row) == 0 for one in remains)
    hits = len(damaged) - len(left)
    return f1(hits, len(damaged), hits + false) if damaged else None


def _overlap(one: Row, other: Row) -> float:
    """Bytes that both cover over bytes that either covers."""
    ends = [row["start"] + row["length"] for row in (one, other)]
    both = min(ends) - max(one["start"], other["start"])
    return both / (one["length"] + other["length"] - both) if both > 0 else 0.0
