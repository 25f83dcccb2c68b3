"""What one version of the tool says of samples, by the commands that users have: the worker of `ecosystem.py`.

Standard input names samples, a JSON list `[name, path]` a line; a line of JSON comes back for each, its facts as
`[kind, key, value]`. It runs in the tree of either version and rests on nothing but commands and their JSON. With
`--without FILE:LINE:COLUMN` one decision of the source is switched off before anything is imported (`ablate.py`).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

WORKER: Final = Path(__file__).resolve()
KINDS: Final = ("frames", "directions", "findings", "causes", "registers", "maps", "pastes")

_LONGEST_S: Final = 120  # a command that takes longer is a fact of its own
_MAPS: Final = ("layouts/",)
_TEXTS: Final = (".txt", ".md", ".log")

Fact = tuple[str, str, str]
Record = dict[str, Any]


def frame_facts(lines: list[Record]) -> Iterator[Fact]:
    """Frames and noise by where they stand, directions and pairs, findings by their frames."""
    for line in lines:
        place = f"{line.get('port', 0)}@{line['start']}"
        if line.get("kind") == "noise":
            yield "frames", place, f"noise of {line['length']}"
            continue
        words = (line[key] for key in ("length", "protocol", "unit", "function", "crc_ok"))
        yield "frames", place, " ".join(map(str, words))
        yield "directions", place, f"{line['direction']} to {line['request_start']}"
        found = sorted(one["code"] for one in line["findings"])
        if found:
            yield "findings", place, " ".join(found)


def report_facts(lines: list[Record]) -> Iterator[Fact]:
    """Causes with their units, in their order, and how the requests ended."""
    for page in lines:
        for rank, cause in enumerate(page["causes"], 1):
            yield "causes", f"{rank}", f"{cause['cause']} of {cause['units'][:4]}"
        yield "causes", "requests", " ".join(f"{key} {count}" for key, count in page["transactions"].items() if count)


def register_facts(lines: list[Record]) -> Iterator[Fact]:
    """What each register is taken for."""
    for line in lines:
        place = f"{line['unit']} {line['area']} {line['address']}"
        yield "registers", place, " ".join(str(line[key]) for key in ("words", "kind", "signed", "order", "role"))


def map_facts(text: str) -> Iterator[Fact]:
    """The rows of a map as it is written again."""
    for number, line in enumerate(text.splitlines()):
        yield "maps", f"line {number}", line


def paste_facts(lines: list[Record]) -> Iterator[Fact]:
    """Frames and other bytes of a text, by their bytes; times are those of `frames`."""
    met: Counter[str] = Counter()
    for line in lines:
        met[line["hex"]] += 1
        what = "noise" if line.get("kind") == "noise" else f"{line['protocol']} {line['direction']} {line['crc_ok']}"
        yield "pastes", f"{line['hex']} #{met[line['hex']]}", what


def records(text: str) -> list[Record]:
    """The JSON objects of an output: one that fills all of it, or one a line."""
    try:
        whole = json.loads(text)
        return [whole] if isinstance(whole, dict) else []
    except ValueError:
        pass
    found = []
    for line in text.splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return [one for one in found if isinstance(one, dict)]


def _of_lines(read: Callable[[list[Record]], Iterator[Fact]]) -> Callable[[str], Iterator[Fact]]:
    return lambda text: read(records(text))


# Kinds, whether it is for maps, for texts only, the command, and what its output says.
WAYS: Final[tuple[tuple[tuple[str, ...], bool, bool, tuple[str, ...], Callable[[str], Iterator[Fact]]], ...]] = (
    (
        ("frames", "directions", "findings"),
        False,
        False,
        ("export", "{}", "--noise", "--format", "jsonl", "-o", "-"),
        _of_lines(frame_facts),
    ),
    (("causes",), False, False, ("report", "{}", "--json"), _of_lines(report_facts)),
    (("registers",), False, False, ("registers", "{}", "--json"), _of_lines(register_facts)),
    (("pastes",), False, True, ("parse", "-f", "{}", "--json", "--noise"), _of_lines(paste_facts)),
    (("maps",), True, False, ("map", "import", "{}", "-o", "-"), map_facts),
)


def facts_of(name: str, path: str, kinds: set[str]) -> Iterator[Fact]:
    """All facts of a sample that are asked for."""
    is_map, is_text = name.startswith(_MAPS), path.endswith(_TEXTS)
    for of_way, for_maps, texts_only, command, read in WAYS:
        if for_maps is is_map and (is_text or not texts_only) and kinds & set(of_way):
            status, text = output([path if word == "{}" else word for word in command])
            yield of_way[0], "status", str(status)
            yield from (fact for fact in read(text) if fact[0] in kinds)


def output(command: list[str]) -> tuple[int, str]:
    """Status and standard output of a command, in a process of its own that has all imports already."""
    with tempfile.TemporaryFile() as out:
        child = os.fork()
        if child == 0:
            os._exit(_run(command, out.fileno()))
        _, status = os.waitpid(child, 0)
        out.seek(0)
        return os.waitstatus_to_exitcode(status), out.read().decode(errors="replace")


def _run(command: list[str], out: int) -> int:
    from analyzer.cli import main as rtuscope

    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(_LONGEST_S)
    os.dup2(out, 1)
    os.dup2(os.open(os.devnull, os.O_RDWR), 2)
    try:
        status = rtuscope(command)
        sys.stdout.flush()
    except BaseException:  # a defect of that version is a status here, and no end of the comparison
        return 99
    return status


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--without", metavar="FILE:LINE:COLUMN", help="a decision to switch off")
    options = parser.parse_args()
    sys.path.insert(0, str(Path.cwd()))
    if options.without:
        import ablate

        ablate.switch_off(options.without)
    import analyzer.cli
    import analyzer.core
    import analyzer.reports.summary  # noqa: F401 - once, before the commands fork

    for line in sys.stdin:
        name, path = json.loads(line)
        print(json.dumps([name, list(facts_of(name, path, set(options.kinds.split(","))))]), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
