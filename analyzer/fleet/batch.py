"""A batch: what of the sources the lake does not have yet, made into tasks, run, and entered in the manifest."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any

from ..version import __version__
from .errors import FleetError
from .manifest import LakeLine, Manifest, writing
from .packs import LakePacking, pack
from .runners import Runner
from .sources import LineFiles, SourceFile
from .stores import LakeStore
from .tasks import BatchOptions, LineTask

_FOLDERS = ("frames", "transactions", "values", "findings", "causes", "captures", "hours", "state", "scratch")


@dataclass(slots=True)
class BatchResult:
    """What a batch came to. `troubles`: a line each, of captures that are damaged and tasks that failed."""

    lines: int = 0
    captures: int = 0
    frames: int = 0
    octets: int = 0
    skipped: int = 0  # captures that the lake has already
    outdated: int = 0  # lines that another version or other options made
    failed: int = 0  # tasks
    damaged: int = 0  # captures
    partial: bool = False
    packed: LakePacking = field(default_factory=LakePacking)
    seconds: float = 0.0
    troubles: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class BatchStep:
    """How far a batch is: bytes of files done, and of all."""

    done: int
    total: int
    frames: int
    seconds: float


def planned(
    manifest: Manifest, lines: Sequence[LineFiles], options: BatchOptions, *, redo: bool, result: BatchResult
) -> list[LineTask]:
    """The tasks that are left to do, the largest first. What is not done is counted in `result`."""
    tasks = []
    for line in lines:
        task = _planned(manifest, line, options, redo=redo, result=result)
        if task is not None:
            tasks.append(task)
    return sorted(tasks, key=lambda task: (-sum(file.size for file in task.files), task.site, task.line))


def _planned(
    manifest: Manifest, line: LineFiles, options: BatchOptions, *, redo: bool, result: BatchResult
) -> LineTask | None:
    before = manifest.lines.get((line.site, line.line))
    others = [each for key, each in manifest.lines.items() if key[0] == line.site and each is not before]
    elsewhere = frozenset(one["sha256"] for each in others for one in each.slices() if one["sha256"])
    plain = LineTask(manifest.store.root, line.site, line.line, line.files, options, elsewhere, None, line.sliced)
    if before is None:
        return plain
    made_so = before.last["version"] == __version__ and before.last["options"] == options.mark()
    if not made_so:
        if redo:
            return plain
        result.outdated += 1
    known = {(one["url"], one["size"], one["stamp"]) for one in before.slices()}
    fresh = tuple(file for file in line.files if (file.url, file.size, file.stamp) not in known)
    result.skipped += len(line.files) - len(fresh)
    if not fresh:
        return None
    if not made_so and not line.sliced:
        return plain
    return _continued(before, plain, fresh, result) if line.sliced else plain


def _continued(before: LakeLine, plain: LineTask, fresh: tuple[SourceFile, ...], result: BatchResult) -> LineTask:
    """The newer slices behind what the lake has; the whole line anew where one of them belongs before that."""
    newest = max(one["url"].rpartition("/")[2] for one in before.slices())
    here = {file.url for file in plain.files}
    anew = {one["url"] for one in before.slices()} <= here
    if min(file.name for file in fresh) <= newest:
        if anew:
            return plain
        result.troubles.append(
            f"{fresh[0].url}: belongs before slices of which some are there no more: taken in behind them"
        )
    hashes = plain.known | {one["sha256"] for one in before.slices() if one["sha256"]}
    state = before.last["state"] if before.last["version"] == __version__ else None
    return LineTask(
        plain.lake, plain.site, plain.line, fresh, plain.options, hashes, state, sliced=True, after=before.numbers[-1]
    )


def run_batch(
    store: LakeStore,
    lines: Sequence[LineFiles],
    options: BatchOptions,
    runner: Runner,
    *,
    redo: bool = False,
    compact: bool = False,
    progress: Callable[[BatchStep], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> BatchResult:
    """Take into the lake what it does not have. Once `stop` says True what is done is kept and the rest left.

    At its end small files are made into larger ones, where there are many, or whatever their count if `compact`.
    Raises FleetError where the lake cannot be written.
    """
    begun, result = time.monotonic(), BatchResult()
    with writing(store):
        manifest = Manifest(store)
        remove_waste(manifest)
        tasks = planned(manifest, lines, options, redo=redo, result=result)
        total, done = sum(_size(task) for task in tasks), 0
        wanted = takewhile(lambda _: stop is None or not stop(), tasks)
        with closing(runner(wanted)) as outcomes:
            for task, outcome in outcomes:
                done += _size(task)
                _enter(manifest, task, outcome, result)
                if progress is not None:
                    progress(BatchStep(done, total, result.frames, time.monotonic() - begun))
        result.partial = done < total
        if not result.partial:
            result.packed = pack(manifest, 1 if compact else None, stop)
    result.seconds = time.monotonic() - begun
    return result


def _enter(manifest: Manifest, task: LineTask, outcome: dict[str, Any] | Exception, result: BatchResult) -> None:
    if isinstance(outcome, Exception):
        result.failed += 1
        words = str(outcome) if isinstance(outcome, FleetError) else f"{type(outcome).__name__}: {outcome}"
        result.troubles.append(f"site {task.site}, line {task.line}: not done: {' '.join(words.split())}")
        return
    manifest.add(outcome)
    result.lines += 1
    result.captures += len(outcome["slices"])
    result.frames += outcome["frames"]
    result.octets += outcome["bytes"]
    for one in outcome["slices"]:
        if one["state"] in ("damaged", "unreadable"):
            result.damaged += 1
            more = f" (and {len(one['damage']) - 1} more)" if len(one["damage"]) > 1 else ""
            said = one["damage"][0] if one["damage"] else "damaged"
            result.troubles.append(said + more if one["url"] in said else f"{one['url']}: {said}{more}")


def compact_lake(store: LakeStore) -> LakePacking:
    """Make all small files of a lake into larger ones. Raises FleetError where there is none, or another writes it."""
    Manifest.of(store)
    with writing(store):
        manifest = Manifest(store)
        remove_waste(manifest)
        return pack(manifest, 1)


def _size(task: LineTask) -> int:
    return sum(file.size for file in task.files) + 1


def remove_waste(manifest: Manifest) -> None:
    """Take away what killed or repeated tasks left, and what later entries took the place of.

    At the beginning of a batch, so that who reads what the one before replaced has until then.
    """
    named = manifest.named()
    for folder in _FOLDERS:
        for name in manifest.store.names(folder):
            if name not in named:
                manifest.store.remove(name)
