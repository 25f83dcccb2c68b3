"""Runs two versions of the tool over everything real and made, and prints each difference on a line of its own.

    python benchmarks/ecosystem.py OLD [NEW] [--only KIND ...] [--every N] [--seeds N] [--fold fit|told]

OLD and NEW are folders of the project or revisions of git; without NEW, this tree as it stands. The samples are the
shared corpus where it is beside the project, the bundled captures, the layouts of registers, and buses that this
tree's simulator makes: every wire, defect and field case. A difference is
`KIND SAMPLE KEY: what OLD says -> what NEW says`; kinds are frames, directions, findings, causes, registers, maps and
pastes. Then a sum by kind; exit status 1 where any differs.

`--fold` takes half of the samples: those that a change may be fitted on, or those on which its score is told. A sample
is in the same half whatever else there is.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ecosystem_facts import KINDS, WORKER

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "corpus"
_TRUTHS = (".truth.jsonl", ".truth.json", ".expect.jsonl", "truth.jsonl", "truth.json")
_NO_SAMPLES = {".md", ".py", ".sh", ".pickle", ".json"}
_TRANSACTIONS = 150
_FIRST_SEED = 1000  # scores take theirs from 0 on

Told = dict[tuple[str, str, str], str]  # by kind, sample and key


def fold_of(sample: str) -> str:
    """The half that a sample is in, by its name alone."""
    return "fit" if zlib.crc32(sample.encode()) % 2 else "told"


def real_samples() -> Iterator[tuple[str, Path]]:
    """Names and files of what stands in the project and beside it."""
    for folder, name in (
        (ROOT / "captures" / "samples", "bundled"),
        (ROOT / "benchmarks" / "layouts", "layouts"),
        (SHARED, "corpus"),
    ):
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix not in _NO_SAMPLES and not path.name.endswith(_TRUTHS):
                yield f"{name}/{path.relative_to(folder)}", path


def made_samples(folder: Path, seeds: int) -> Iterator[tuple[str, Path, Callable[[Path], None]]]:
    """Captures of this tree's simulator: name, file in a folder, and what writes it."""
    import captures
    from analyzer.simulation import TAPS, WIRES, Scenario, write
    from analyzer.simulation.defects import defects
    from analyzer.simulation.field.cases.registry import FieldCase, field_cases

    def in_turn(taps: Iterable[str], turn: int) -> str:
        taps = list(taps)
        return taps[turn % len(taps)]

    def scenario(**asked: Any) -> Callable[[Path], None]:
        return lambda path: write(Scenario(transactions=_TRANSACTIONS, **asked), path)

    def case_of(case: FieldCase, tap: str, seed: int) -> Callable[[Path], None]:
        def put(path: Path) -> None:
            made = case.capture(tap, seed)
            captures.write(path, made.chunks, line=made.line)

        return put

    for turn in range(seeds):
        seed = _FIRST_SEED + turn
        made: list[tuple[str, str, Callable[[Path], None]]] = []
        for number, wire in enumerate(WIRES):
            tap = in_turn(TAPS, number + turn)
            made.append((f"wire-{wire}", tap, scenario(wire=wire, tap=tap, seed=seed)))
        for number, (code, defect) in enumerate(defects().items()):
            tap = in_turn(defect.taps, number + turn)
            made.append((f"defect-{code}", tap, scenario(wire="clean", tap=tap, defect=code, seed=seed)))
        for number, (name, case) in enumerate(field_cases().items()):
            tap = in_turn(case.taps, number + turn)
            made.append((f"case-{name}", tap, case_of(case, tap, seed)))
        for name, tap, put in made:
            path = folder / f"{name}-{tap}-{seed}.jsonl"
            yield f"made/{path.name}", path, put


def facts(
    tree: Path, samples: Sequence[tuple[str, Path]], kinds: Sequence[str], options: Sequence[str] = ()
) -> subprocess.Popen[str]:
    """A process of a tree that says what it makes of the samples: a line of JSON each."""
    own = tree / ".venv" / "bin" / "python"
    command = [str(own if own.exists() else sys.executable), str(WORKER), *options, "--kinds", ",".join(kinds)]
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": "0", "COLUMNS": "100", "LANG": "C.UTF-8"}
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=tree, env=environment
    )
    assert process.stdin is not None
    process.stdin.write("".join(json.dumps([name, str(path)]) + "\n" for name, path in samples))
    process.stdin.close()
    return process


def told_by(process: subprocess.Popen[str], *, may_fail: bool = False) -> Told:
    """What a process said, to its end; SystemExit where it failed and may not."""
    told: Told = {}
    assert process.stdout is not None
    for line in process.stdout:
        sample, found = json.loads(line)
        told.update({(kind, sample, key): value for kind, key, value in found})
    if process.wait() != 0 and not may_fail:
        raise SystemExit(f"the version in {process.args!r} ended with status {process.returncode}")
    return told


def differences(old: Told, new: Told) -> Iterator[tuple[str, str]]:
    """Kind and line of each difference, in the order of kinds and samples."""
    for place in sorted({*old, *new}):
        before, after = old.get(place, "nothing"), new.get(place, "nothing")
        if before != after:
            kind, sample, key = place
            yield kind, f"{kind} {sample} {key}: {before} -> {after}"


def tree_of(name: str, stack: ExitStack) -> Path:
    """The folder of a version: itself, or a work tree of a revision for as long as the stack is open."""
    if Path(name).is_dir():
        return Path(name).resolve()
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "tree"
    git = ("git", "-C", str(ROOT), "worktree")
    subprocess.run([*git, "add", "-q", "--detach", str(folder), name], check=True)
    stack.callback(subprocess.run, [*git, "remove", "--force", str(folder)], check=True)
    return folder


def chosen_samples(folder: Path, options: argparse.Namespace) -> list[tuple[str, Path]]:
    """The samples that the arguments ask for."""
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    real = [(name, path, None) for name, path in real_samples()]
    every = [*real, *made_samples(folder, options.seeds)]
    chosen = [one for one in every if options.fold in (None, fold_of(one[0]))][:: options.every]
    for _, path, put in chosen:
        if put is not None:
            put(path)
    return [(name, path) for name, path, _ in chosen]


def add_sample_arguments(parser: argparse.ArgumentParser) -> None:
    """What chooses samples; benchmarks/ablate.py has the same."""
    parser.add_argument("--only", nargs="+", choices=KINDS, default=list(KINDS), metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each Nth sample (1)")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="seeds of each made bus (1)")
    parser.add_argument("--fold", choices=("fit", "told"), help="half of the samples")


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("old", metavar="OLD", help="folder or revision")
    parser.add_argument("new", metavar="NEW", nargs="?", default=str(ROOT), help="folder or revision (this tree)")
    add_sample_arguments(parser)
    options = parser.parse_args(arguments)
    with ExitStack() as stack:
        samples = chosen_samples(Path(stack.enter_context(tempfile.TemporaryDirectory())), options)
        trees = [tree_of(name, stack) for name in (options.old, options.new)]
        processes = [facts(tree, samples, options.only) for tree in trees]
        with ThreadPoolExecutor() as threads:  # a process whose pipe nobody reads would wait
            old, new = threads.map(told_by, processes)
    by_kind: Counter[str] = Counter()
    for kind, line in differences(old, new):
        by_kind[kind] += 1
        print(line)
    facts_by_kind = Counter(kind for kind, _, _ in new)
    print(
        f"{len(samples)} samples; "
        + ", ".join(f"{kind} {by_kind[kind]} of {facts_by_kind[kind]}" for kind in options.only)
    )
    return int(bool(by_kind))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
