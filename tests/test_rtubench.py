"""RTUBench: its truth is its own, its scores are what the page says, a run for this tool ends with a whole table."""

from __future__ import annotations

import ast
import json
import shutil
import subprocess
import sys
from pathlib import Path
from random import Random
from typing import Any

import pytest
from running import PATIENCE_S, ROOT
from scripts import package

BENCH = ROOT / "benchmarks" / "rtubench"
table, plants, pastes, recorded, buses, corpus, bus, causes, registers, texts = (
    package(f"rtubench.{name}")
    for name in (
        "table", "made.plants", "made.pastes", "made.recorded", "made.buses", "made.corpus", "scored.bus",
        "scored.causes", "scored.registers", "scored.texts",
    )
)  # fmt: skip
adu, crc16, read = (getattr(package("rtubench.modbus"), name) for name in ("adu", "crc16", "read"))
TRACKS = package("rtubench.scored").TRACKS
TAPS = package("rtubench.taps").TAPS
wire_of = package("rtubench.line").wire_of
Row = dict[str, Any]


def imported(path: Path) -> set[str]:
    """Top names of what a file imports, at any depth of it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names.add((node.module or "").split(".")[0])
    return names


def test_nothing_of_the_bench_imports_the_product_nor_other_benchmarks():
    files = list(BENCH.rglob("*.py"))
    assert len(files) > 25
    product = {"analyzer", "captures", "dissectors", "rtuscope"}
    others = {path.stem for path in (ROOT / "benchmarks").iterdir()} - {"rtubench"}
    assert {
        path.name: imported(path) & (product | others) for path in files if imported(path) & (product | others)
    } == {}


def test_adapters_know_nothing_of_truth_and_scores():
    for path in (BENCH / "adapters").glob("*.py"):
        ours = {node.module for node in ast.walk(ast.parse(path.read_text()))
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rtubench")}  # fmt: skip
        assert ours <= {"rtubench.adapters.speaking"}, path.name


def run(*arguments: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(BENCH), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=PATIENCE_S, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="the speed track counts by wait4")
def test_a_run_for_this_tool_alone_ends_with_a_table(tmp_path: Path):
    figures = tmp_path / "figures.json"
    tracks = ("frames", "directions", "pairs", "texts")  # the others take minutes
    done = run("run", "--size", "tiny", "--tools", "rtuscope", "--tracks", *tracks, "--rounds", "1", "--json", figures)
    assert done.returncode == 0, done.stdout + done.stderr
    (tool,) = json.loads(figures.read_text())["tools"]
    assert tool["wrong"] == [] and set(tool["tracks"]) == set(tracks)
    assert all(0.5 < told["score"] <= 1 for told in tool["tracks"].values()), tool["tracks"]
    assert all({"made", "recorded"} <= told.keys() for told in tool["tracks"].values())
    assert "| rtuscope | " in done.stdout and "Broke the protocol" not in done.stdout


@pytest.mark.skipif(shutil.which("perl") is None, reason="the example is in Perl")
def test_the_stranger_s_adapter_keeps_the_protocol():
    done = run("check", f"perl {BENCH / 'example' / 'lengths.pl'}")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "| lengths.pl | 0." in done.stdout


def test_an_adapter_that_breaks_the_protocol_is_named(tmp_path: Path):
    adapter = tmp_path / "bad.py"
    adapter.write_text(
        "import sys, json\n"
        "about = {'tool': 'bad', 'version': '0', 'input': 'reads', 'claims': ['frames']}\n"
        "print(json.dumps(about if sys.argv[1] == 'about' else {'start': 10**9, 'length': 8, 'crc_ok': True}))\n"
    )
    done = run("run", "--size", "tiny", "--tracks", "frames", "--tools", "silence", "--tool",
               f"bad={sys.executable} {adapter}")  # fmt: skip
    assert done.returncode == 1
    assert "| bad | 0.000 |" in done.stdout
    assert "Broke the protocol: bad, calm-bytes: start and length must be whole numbers within" in done.stdout


def test_a_tool_that_is_not_there_is_named(tmp_path: Path):
    done = run(
        "run", "--size", "tiny", "--tracks", "frames", "--tools", "silence", "--tool", f"gone={tmp_path}/no-such"
    )
    assert done.returncode == 0
    assert "Not here: gone: " in done.stdout


def test_a_corpus_follows_from_its_seed():
    first, again, other = (
        [(item.name, item.inputs, item.text, item.truth) for item in corpus.items(seed, corpus.SIZES["tiny"])]
        for seed in (5, 5, 6)
    )
    assert first == again
    assert [name for name, *_ in first] == [name for name, *_ in other]
    assert first != other


def test_a_frame_is_as_the_specification_has_it():
    assert adu(17, read(3, 107, 3)).hex() == "1103006b00037687"
    assert crc16(b"123456789") == 0x4B37


@pytest.mark.parametrize("name", buses.BUSES)
def test_truth_stands_where_it_says_and_taps_lose_nothing(name: str):
    line, client = buses.BUSES[name](Random(f"3 {name}"))
    sent = line.run([client], 60)
    data = bytes(byte for _, byte in wire_of(sent, line.char_ns))
    items = list(buses.heard(name, sent, line, 3))
    assert len(items) == len(TAPS)
    for item in items:
        for reads in item.inputs.values():
            assert b"".join(one.data for one in reads) == data
            times = [one.t_ns for one in reads if one.t_ns is not None]
            assert times == sorted(times)
    frames = items[0].truth["frames"]
    assert len(frames) > 50
    for row in frames:
        told = data[row["start"] : row["start"] + row["length"]]
        assert (told.hex() == row["hex"]) == row["intact"]
        assert crc16(bytes.fromhex(row["hex"])) == 0


def test_every_kind_of_line_is_heard_in_every_track_and_beside_it_recordings():
    made = list(corpus.items(2026, corpus.SIZES["tiny"]))
    for track in TRACKS:
        assert {item.source for item in made if track in item.tracks} == {"made", "recorded"}, track


def frames_of(*places: tuple[int, int], **more: object) -> list[Row]:
    return [{"start": start, "length": length, "crc_ok": True, **more} for start, length in places]


TRUTH: Row = {
    "frames": [
        {"id": 0, "role": "request", "start": 0, "length": 8, "hex": "aa", "intact": True, "pair": None, "fault": None},
        {"id": 1, "role": "request", "start": 8, "length": 8, "hex": "aa", "intact": True, "pair": None, "fault": None},
        {"id": 2, "role": "response", "start": 16, "length": 9, "hex": "bb", "intact": True, "pair": 0, "fault": None},
        {
            "id": 3,
            "role": "request",
            "start": 25,
            "length": 7,
            "hex": "cc",
            "intact": False,
            "pair": None,
            "fault": "lost",
        },
    ]
}


def test_a_false_frame_costs_as_much_as_a_lost_one():
    every = frames_of((0, 8), (8, 8), (16, 9))
    assert bus.frames(TRUTH, every) == 1.0
    assert bus.frames(TRUTH, every[:2]) == pytest.approx(0.8)
    assert bus.frames(TRUTH, [*every, *frames_of((25, 7))]) == pytest.approx(6 / 7)
    assert bus.frames(TRUTH, every + every) == pytest.approx(6 / 9)


def test_a_try_in_a_row_is_as_right_as_the_other_and_no_answer_costs_less_than_a_wrong_one():
    def answered(request: int | None) -> Any:
        return bus.pairs(TRUTH, frames_of((16, 9), direction="response", request_start=request))

    assert answered(0) == answered(8) == 1.0
    assert answered(None) == 0.0
    assert answered(25) == 0.0


def test_directions_are_of_frames_that_are_found():
    told = frames_of((0, 8), direction="request") + frames_of((16, 9), direction="request")
    assert bus.directions(TRUTH, told) == pytest.approx(1 / 3)


def test_damage_is_found_where_it_is():
    assert bus.damage(TRUTH, [{"start": 25, "length": 6, "crc_ok": False}]) == 1.0
    assert bus.damage(TRUTH, [{"start": 25, "length": 3, "crc_ok": False}]) == 0.0
    assert bus.damage(
        TRUTH, [{"start": 25, "length": 7, "crc_ok": False}, {"start": 0, "length": 8, "crc_ok": False}]
    ) == (pytest.approx(2 / 3))


def test_the_first_cause_counts_and_a_healthy_line_has_none():
    silent = {"causes": ["unit-silent"], "units": [9]}
    assert causes.causes(silent, [{"cause": "unit-silent", "units": [9]}]) == 1.0
    assert causes.causes(silent, [{"cause": "unit-silent", "units": [8]}]) == 0.0
    assert causes.causes(silent, [{"cause": "line-noise", "units": []}, {"cause": "unit-silent", "units": [9]}]) == 0.0
    assert causes.causes(silent, []) == 0.0
    assert causes.causes({"causes": [], "units": []}, []) == 1.0


def test_a_text_is_scored_by_frames_and_directions():
    truth = {"frames": [{"hex": "01", "direction": "request"}, {"hex": "02", "direction": "response"}]}
    assert texts.texts(truth, [{"hex": "01", "direction": "request"}]) == pytest.approx(2 / 3)
    assert texts.texts(truth, [{"hex": "01", "direction": "response"}]) == 0.0
    assert texts.texts({"frames": []}, []) == 1.0


def test_a_value_needs_its_type_and_its_order():
    truth = {"values": [
        {"unit": 1, "table": 3, "address": 0, "types": ["f32"], "order": "big", "counts": True},
        {"unit": 1, "table": 3, "address": 2, "types": ["i16", "u16"], "order": None, "counts": True},
        {"unit": 1, "table": 3, "address": 3, "types": ["u16"], "order": None, "counts": False},
    ]}  # fmt: skip

    def told(*values: tuple[int, str, str | None]) -> Any:
        return registers.registers(
            truth, [{"unit": 1, "table": 3, "address": at, "type": kind, "order": order} for at, kind, order in values]
        )

    assert told((0, "f32", "big"), (2, "i16", None), (3, "i16", None)) == 1.0
    assert told((0, "f32", "little"), (2, "u16", None)) == pytest.approx(0.5)
    assert told((0, "u16", None), (1, "u16", None), (2, "u16", None)) == pytest.approx(0.4)


def test_values_travel_as_they_were_meant():
    assert plants.words("f32", 1.0, "big") == (0x3F80, 0)
    assert plants.words("u32", 65537.0, "little") == (1, 1)
    assert plants.words("i16", -1.0, "big") == (0xFFFF,)


def test_every_style_shows_every_byte_of_its_frames():
    for item in pastes.items(1, 1):
        digits = "".join(char for char in item.text.lower() if char in "0123456789abcdef")
        if item.name.split("-")[0] in ("arrows", "brackets", "solid", "prose"):
            assert all(row["hex"] in digits.replace("0x", "") for row in item.truth["frames"]), item.name


def test_recordings_are_of_stacks_and_whole():
    assert {row["client"].split()[0] for row in recorded.kept("conversations")} == {
        "mbpoll",
        "minimalmodbus",
        "pymodbus",
    }
    for row in recorded.kept("conversations"):
        assert all(crc16(bytes.fromhex(text)) == 0 for _, _, text in row["sent"])


def result(**scores: float) -> Row:
    return {
        "tools": [{"tool": name, "tracks": {"frames": {"score": score}}, "speed": {}} for name, score in scores.items()]
    }


def test_who_changes_places_is_named():
    runs = [result(a=0.9, b=0.8001, c=0.8), result(a=0.95, b=0.85, c=0.8)]
    assert table.orders(runs) == "frames: a > b > c; 2 runs, the same order in each"
    assert (
        table.orders([*runs, result(a=0.5, b=0.85, c=0.3)]) == "frames: b = a > c; 3 runs, change places: b and a in 2"
    )


def test_parts_of_a_run_are_one():
    one, other = ({**result(a=score), "seed": 1, "size": "tiny", "absent": {}} for score in (0.5, 0.6))
    for part in (one, other):
        part["tools"][0] |= {"wrong": []}
    other["tools"][0]["tracks"] = {"pairs": {"score": 0.6}}
    assert table.merged([one, other])["tools"][0]["tracks"].keys() == {"frames", "pairs"}
    with pytest.raises(ValueError, match="same seed and size"):
        table.merged([one, {**other, "seed": 2}])


@pytest.mark.parametrize("page", ["rtubench.md", "ru/rtubench.md"])
def test_the_page_names_every_track_kind_of_line_and_word(page: str):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert [name for name in (*TRACKS, *causes.WORDS) if name not in text] == []
