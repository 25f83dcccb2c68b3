"""rtuscope, by its command line alone: export, report, parse, registers."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import Given, NotThereError, Row, frame, given, speak

CAUSES = {  # its words, in those of the bench
    "dead-unit": "unit-silent", "absent-units": "unit-silent", "unit-restarts": "unit-restarts",
    "unit-busy": "unit-busy", "missing-registers": "missing-registers", "cannot-serve": "missing-registers",
    "timeout-too-short": "timeout-too-short", "two-masters": "two-clients", "duplicate-address": "same-address",
    "interference": "line-noise", "termination": "line-noise", "bad-drop": "unit-noise",
    "driver-enabled-late": "driver-late", "driver-released-early": "driver-early",
    "unit-line-settings": "unit-settings",
}  # fmt: skip
_TYPES = {("int", 1, False): "u16", ("int", 1, True): "i16", ("int", 2, False): "u32", ("int", 2, True): "i32",
          ("float", 2, True): "f32", ("float", 2, False): "f32"}  # fmt: skip


def _command() -> str:
    beside = Path(sys.executable).with_name("rtuscope")
    found = str(beside) if beside.exists() else shutil.which("rtuscope")
    if found is None:
        raise NotThereError("rtuscope is not installed")
    return found


def _printed(*arguments: str | Path) -> str:
    """What it prints; exit status 1 says that nothing was found."""
    done = subprocess.run([_command(), *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr.strip() or f"exit status {done.returncode}")
    return done.stdout


def _lines(*arguments: str | Path) -> Iterator[Row]:
    return map(json.loads, _printed(*arguments).splitlines())


def _capture(path: Path) -> list[str | Path]:
    """The reads as a capture of its own format; as raw bytes where they have no times. Arguments that open it."""
    told: Given = given(path)
    timed = all(t_ns is not None for t_ns, _ in told.reads)
    made = Path.cwd() / f"{path.stem}{'.jsonl' if timed else '.bin'}"
    if not timed:
        made.write_bytes(b"".join(data for _, data in told.reads))
        return [made, "--baud", str(told.head["baud"])]
    head = {"format": "serial-chunks", "version": 1, "baud": told.head["baud"], "char_bits": told.head["char_bits"]}
    rows = ({"t_ns": t_ns, "hex": data.hex()} for t_ns, data in told.reads)
    made.write_text("".join(json.dumps(row) + "\n" for row in (head, *rows)))
    return [made]


def about() -> Row:
    version = subprocess.run([_command(), "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
    claims = ["frames", "directions", "pairs", "damage", "causes", "texts", "registers", "speed"]
    return {"tool": "rtuscope", "version": version, "input": "reads", "claims": claims}


def bus(path: Path) -> Iterator[Row]:
    """Frames, and stretches in no frame that are long enough for one as damaged, as the other adapters have them."""
    for row in _lines("export", *_capture(path), "--noise", "--format", "jsonl", "-o", "-"):
        if row.get("kind") == "noise":
            if row["length"] >= 4:
                yield frame(row["start"], row["length"], False)
        else:
            yield frame(row["start"], row["length"], row["crc_ok"], row["direction"], row["request_start"])


def causes(path: Path) -> Iterator[Row]:
    for cause in json.loads(_printed("report", *_capture(path), "--json"))["causes"]:
        if cause["severity"] != "note":
            yield {"cause": CAUSES.get(cause["cause"], cause["cause"]), "units": cause["units"]}


def text(path: Path) -> Iterator[Row]:
    for row in _lines("parse", "--json", "-f", path):
        if row.get("crc_ok"):
            yield {"hex": row["hex"], "direction": row["direction"]}


def registers(path: Path) -> Iterator[Row]:
    for row in _lines("registers", *_capture(path), "--json"):
        kind = _TYPES.get((row["kind"], row["words"], row["signed"]))
        if kind is not None:
            table = {"holding": 3, "input": 4}[row["area"]]
            order = {"ABCD": "big", "CDAB": "little"}.get(row["order"] or "")
            yield {"unit": row["unit"], "table": table, "address": row["address"], "type": kind, "order": order}


def speed(path: Path) -> Iterator[Row]:
    yield {"command": [_command(), "export", *map(str, _capture(path)), "--format", "csv", "-o", "-"]}


if __name__ == "__main__":
    sys.exit(speak(about, {one.__name__: one for one in (bus, causes, text, registers, speed)}))
