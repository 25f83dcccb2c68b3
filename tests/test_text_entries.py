"""Logs whose entries stand over several lines, or several in one: JSON's objects and YAML's items."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from buses import adu

import captures
from analyzer.paste import judge

Read = tuple[int, str, bytes]
BEGIN_MS = 1_760_000_000_123
STEPS_MS = (0, 14, 1003, 1019, 2009, 2021, 3006, 3017)
READS: list[Read] = [
    (ms, "rx" if i % 2 else "tx", adu("2B0304 00CE 1DFA") if i % 2 else adu("2B0300A0 0002"))
    for i, ms in enumerate(STEPS_MS)
]


def _seconds(ms: int) -> float:
    return (BEGIN_MS + ms) / 1000


def _flat(read: Read) -> dict[str, object]:
    return {"ts": _seconds(read[0]), "dir": read[1], "data": read[2].hex(" ")}


def _time_last(read: Read) -> dict[str, object]:
    return {"data": read[2].hex(" ").upper(), "direction": read[1], "timestamp": BEGIN_MS + read[0]}


def _nested(read: Read) -> dict[str, object]:
    return {"time": _seconds(read[0]), "frame": {"dir": read[1], "bytes": list(read[2])}}


def _counted(read: Read) -> dict[str, object]:
    return {"dir": read[1], "uptime_us": 5000 + read[0] * 1000, "data": read[2].hex(" ")}


def _journal(read: Read) -> dict[str, object]:
    """As journald exports it."""
    direction = "<- " if read[1] == "rx" else "-> "
    return {"__REALTIME_TIMESTAMP": str((BEGIN_MS + read[0]) * 1000), "MESSAGE": direction + read[2].hex(" ")}


def _packet(read: Read) -> dict[str, object]:
    """As packets are exported: values in lists."""
    return {"layers": {"frame.time_epoch": [f"{_seconds(read[0]):.6f}"], "dir": [read[1]], "data": [read[2].hex()]}}


def _since_start(read: Read) -> dict[str, object]:
    return {"t": read[0] / 1000, "dir": read[1], "data": read[2].hex(" ")}


def _item(read: Read, lead: str) -> str:
    return f"{lead}- ts: {_seconds(read[0])}\n{lead}  dir: {read[1]}\n{lead}  data: '{read[2].hex(' ')}'\n"


ENTRIES = [_flat, _time_last, _nested, _counted, _journal, _packet, _since_start]
SHAPES: dict[str, Callable[[list[dict[str, object]]], str]] = {
    "indented": lambda entries: json.dumps(entries, indent=2),
    "tabs": lambda entries: json.dumps(entries, indent="\t"),
    "within an object": lambda entries: json.dumps({"port": "COM3", "frames": entries}, indent=2),
    "one line": json.dumps,
    "one line, no blanks": lambda entries: json.dumps(entries, separators=(",", ":")),
    "one line within an object": lambda entries: json.dumps({"port": "COM3", "frames": entries}),
    "a line each": lambda entries: "\n".join(map(json.dumps, entries)),
    "objects side by side": lambda entries: ",\n".join(json.dumps(entry, indent=4) for entry in entries),
    "braces in one line": lambda entries: json.dumps(entries, indent=2).replace("},\n  {", "}, {"),
}


def _assert_read(path: Path) -> None:
    capture = captures.open(path, judge=judge)
    chunks = list(capture.chunks())
    assert b"".join(chunk.data for chunk in chunks) == b"".join(data for _, _, data in READS)
    starts = {chunk.t_ns: chunk.mark for chunk in reversed(chunks)}
    assert [(t_ns - chunks[0].t_ns) // 10**6 for t_ns in sorted(starts)] == list(STEPS_MS)
    assert len(set(starts.values())) == 2, "requests and answers are told apart"
    assert not [damage for damage in capture.damage if "time" in damage.what]


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("shape", SHAPES)
def test_objects_of_json(tmp_path: Path, shape: str, entry: Callable[[Read], dict[str, object]]) -> None:
    path = tmp_path / "log.json"
    path.write_text(SHAPES[shape]([entry(read) for read in READS]), encoding="utf-8")
    _assert_read(path)


@pytest.mark.parametrize("head", ["", "frames:\n"])
def test_items_of_yaml(tmp_path: Path, head: str) -> None:
    path = tmp_path / "log.yaml"
    path.write_text(head + "".join(_item(read, "  " if head else "") for read in READS), encoding="utf-8")
    _assert_read(path)


def test_an_object_that_never_ends_is_read_by_its_lines(tmp_path: Path) -> None:
    path = tmp_path / "cut.json"
    path.write_text(json.dumps([_flat(read) for read in READS], indent=2)[:-60], encoding="utf-8")
    data = b"".join(chunk.data for chunk in captures.open(path, judge=judge).chunks())
    assert data.startswith(b"".join(data for _, _, data in READS[:-1]))
