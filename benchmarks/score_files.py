"""Scores what the commands say of files whose truth is known.

    python benchmarks/score_files.py FOLDER... [-v] [--min SHARE] [--rtuscope COMMAND]

FILE has its truth beside it in FILE.truth.json:

- `frames`: [direction or null, hex] in order; `least`: the share of them that must be found (1: all, and nothing else);
- `crc_only`: frames without a right check value do not count; `ignore_responses`: answers do not;
- `gaps`: seconds between the starts of frames, in order;
- `how`: `export` (where nothing is said), `parse`, `roundtrip` (converted to `via` and back, each read is the same at
  the same time), `foreign` (said to be no Modbus);
- `protocol` of each frame; `say`, `forbid`: texts that `parse`, or `parse` and `report`, must and must not say;
- `no_findings`: codes that nothing deserves; `no_causes`; `forbid_report`: texts that `report` must not say.

A file is right when all of its truth holds.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

TRUTH: Final = ".truth.json"
_NOT_MODBUS: Final = "not modbus"
_OFF_S: Final = 0.002  # by which the time between two frames may be wrong: reads stand for ends and for starts

Frame = tuple[str | None, str]


class Commands:
    """The commands, run as a user runs them."""

    def __init__(self, rtuscope: list[str]) -> None:
        self._rtuscope = rtuscope

    def text(self, *arguments: str | Path) -> str:
        """What a command prints; what it says beside that comes first."""
        done = subprocess.run([*self._rtuscope, *map(str, arguments)], capture_output=True, check=False)
        return (done.stderr + done.stdout).decode(errors="replace")

    def lines(self, *arguments: str | Path) -> list[dict[str, Any]]:
        """The JSON lines that a command prints."""
        done = subprocess.run([*self._rtuscope, *map(str, arguments)], capture_output=True, check=False)
        return [json.loads(line) for line in done.stdout.splitlines() if line.startswith(b"{")]


def judged(path: Path, truth: Mapping[str, Any], run: Commands) -> list[str]:
    """What of a file's truth does not hold."""
    how = truth.get("how", "export")
    found = run.lines("parse", "--json", "-f", path) if how == "parse" else []
    if how in ("export", "roundtrip"):
        found = run.lines("export", path, "-o", "-")
    frames = [one for one in found if one.get("kind") != "noise"]
    wrong = list(_wrong_frames(truth, frames)) if "frames" in truth else []
    wrong += _wrong_times(truth, frames)
    codes = {finding["code"] for one in found for finding in one.get("findings", ())}
    wrong += [f"finding {code}" for code in truth.get("no_findings", ()) if code in codes]
    wrong += [
        f"protocol {one['protocol']}" for one in frames if truth.get("protocol", one["protocol"]) != one["protocol"]
    ]
    if how == "roundtrip":
        wrong += _wrong_reads(path, truth["via"], run)
    return wrong + list(_wrong_words(path, truth, run))


def _wrong_frames(truth: Mapping[str, Any], found: list[dict[str, Any]]) -> Iterator[str]:
    mine = [one for one in found if not (truth.get("crc_only") and one["crc_ok"] is False)]
    got: list[Frame] = [(one["direction"], one["hex"]) for one in mine]
    due: list[Frame] = [(direction, octets) for direction, octets in truth["frames"]]
    if truth.get("ignore_responses"):
        got = [frame for frame in got if frame[0] != "response"]
    octets, needed = [frame[1] for frame in got], [frame[1] for frame in due]
    pairs = [
        (block.a + i, block.b + i)
        for block in SequenceMatcher(None, octets, needed, autojunk=False).get_matching_blocks()
        for i in range(block.size)
    ]
    turned = sum(due[b][0] not in (None, got[a][0]) for a, b in pairs)
    if turned:
        yield f"{turned} frames in the wrong direction"
    if len(pairs) < truth.get("least", 1) * len(due):
        yield f"{len(due) - len(pairs)} of {len(due)} frames missing"
    if "least" not in truth and len(pairs) < len(got):
        yield f"{len(got) - len(pairs)} frames that nobody sent"


def _wrong_times(truth: Mapping[str, Any], frames: list[dict[str, Any]]) -> Iterator[str]:
    if "gaps" not in truth:
        return
    starts = [one["t_start_ns"] for one in frames]
    if None in starts or len(starts) != len(truth["gaps"]) + 1:
        yield "no times"
        return
    steps = [(later - earlier) / 1e9 for earlier, later in pairwise(starts)]
    off = max(abs(step - gap) for step, gap in zip(steps, truth["gaps"], strict=True))
    if off > _OFF_S:
        yield f"times off by {off:.4f} s"


def _wrong_reads(path: Path, via: str, run: Commands) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        there, back, plain = (Path(folder) / name for name in (f"there.{via}", "back.jsonl", "plain.jsonl"))
        for source, target in ((path, there), (there, back), (path, plain)):
            run.text("convert", source, "-o", target)
        first, second = (_reads(one) for one in (plain, back))
    if not first or [octets for _, octets in first] != [octets for _, octets in second]:
        yield f"{len(first)} reads come back as {len(second)}"
    elif first != second:
        yield "reads come back at other times"


def _reads(path: Path) -> list[tuple[int, str]]:
    if not path.is_file():
        return []
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    return [(line["t_ns"], line["hex"]) for line in lines if "hex" in line]


def _wrong_words(path: Path, truth: Mapping[str, Any], run: Commands) -> Iterator[str]:
    if "say" in truth and truth["say"] not in run.text("parse", "-f", path):
        yield f"parse does not say {truth['say']!r}"
    if "forbid" in truth:
        parsed, report = run.text("parse", "-f", path), run.text("report", path)
        yield from (f"says {word!r}" for word in truth["forbid"] if word in parsed or word in report)
        if truth.get("how") == "foreign":
            said = {"parse": parsed, "report": report}
            yield from (
                f"{name} does not say that it is no Modbus"
                for name, text in said.items()
                if _NOT_MODBUS not in _flat(text)
            )
    if "forbid_report" in truth:
        report = _flat(run.text("report", path))
        yield from (f"report says {word!r}" for word in truth["forbid_report"] if word in report)
    if truth.get("no_causes"):
        report = run.text("report", "--json", path)
        causes = json.loads(report[report.index("{") :])["causes"]
        yield from (f"cause {cause['id']}" for cause in causes)


def _flat(text: str) -> str:
    """Text without its line ends and capitals."""
    return " ".join(text.lower().split())


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("-v", action="store_true", help="say of each file what is wrong")
    parser.add_argument("--min", type=float, default=0.0, metavar="SHARE", help="exit status 1 below this share")
    parser.add_argument("--rtuscope", default=f"{sys.executable} -m analyzer.cli", help="the command to run")
    given = parser.parse_args(arguments)
    run = Commands(given.rtuscope.split())
    count = right = 0
    for folder in given.folders:
        for beside in sorted(folder.glob(f"*{TRUTH}")):
            path = beside.with_name(beside.name.removesuffix(TRUTH))
            wrong = judged(path, json.loads(beside.read_text()), run)
            count, right = count + 1, right + (not wrong)
            if wrong and given.v:
                print(f"{path.name:<32} {'; '.join(wrong)}")
    print(f"{right} of {count} files are right ({right / max(count, 1):.2f})")
    return int(right < given.min * count)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
