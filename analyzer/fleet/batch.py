"""A batch: what of the sources the lake does not have yet, made into tasks, run, and entered in the manifest."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any, Final

from ..version import RULES, __version__
from . import FleetError, LakeWriteError
from .account import refuse_sources_inside, refuse_unless_lake, remove_waste, writing
from .catalog import HAVE_ROWS, KnownLine, made_by
from .datasets import DATASETS, touched
from .linetask import BatchOptions, KeptRows, LineTask, contents_taken
from .manifest import LakeLine, Manifest
from .packs import FULL, FullPacks, LakePacking, PackTask, pack_tasks
from .runners import LakeTask, Runner, in_this_process
from .sources import LineFiles, SourceFile, readable
from .stores import LakeStore
from .tasks import LinesTask, line_tasks_together

_UNWRITTEN: Final = 5  # tasks one after the other that could not write: a full disk, and no fault of theirs


@dataclass(slots=True)
class BatchResult:
    """What a batch came to. `troubles`: a line each, of captures that are damaged and tasks that failed."""

    lines: int = 0
    captures: int = 0
    frames: int = 0
    octets: int = 0
    skipped: int = 0  # captures that the lake has already
    outdated: int = 0  # lines that other rules or other options made, and that are left so
    failed: int = 0  # tasks
    damaged: int = 0  # captures
    troubled: int = 0  # lines whose state, or newest slice, was not what the lake had known
    partial: bool = False
    packed: LakePacking = field(default_factory=LakePacking)
    seconds: float = 0.0
    troubles: list[str] = field(default_factory=list)

    @property
    def is_flawed(self) -> bool:
        """Whether something could not be done as it should."""
        return bool(self.failed or self.damaged or self.troubled)


@dataclass(frozen=True, slots=True)
class BatchStep:
    """How far a batch is: bytes of files done, and of all."""

    done: int
    total: int
    frames: int
    seconds: float


def planned(
    manifest: Manifest,
    entered: EnteredCaptures,
    lines: Sequence[LineFiles],
    options: BatchOptions,
    *,
    redo: bool,
    result: BatchResult,
) -> list[LineTask]:
    """The tasks that are left to do, the largest first. What is not done is counted in `result`."""
    tasks, asked = [], made_by(options.mark(), RULES)
    for line in lines:
        plain = LineTask(manifest.store.root, line.site, line.line, line.files, options, sliced=line.sliced)
        before = manifest.catalog.known(line.site, line.line)
        if before is not None and before.made == asked and _has_all(before, line):
            result.skipped += len(line.files)
            continue
        plain = replace(plain, known=entered.of_size(line.site, line.line, {file.size for file in line.files}))
        whole = manifest.line(line.site, line.line)
        task = plain if whole is None else _further(whole, plain, redo=redo, result=result)
        if task is not None:
            tasks.append(task)
    return sorted(tasks, key=lambda task: (-task.size, task.site, task.line))


def _has_all(known: KnownLine, line: LineFiles) -> bool:
    return all((file.url, file.size, file.stamp) in known.sources for file in line.files)


class EnteredCaptures:
    """Whose rows the lake has, by content: the lines of a site that took a capture, by its SHA-256."""

    def __init__(self, manifest: Manifest) -> None:
        self._catalog = manifest.catalog
        self._new: dict[tuple[str, str], set[str]] = defaultdict(set)  # that the manifest does not name yet
        self._of_size: dict[tuple[str, int], list[tuple[str, str]]] = {}

    def add(self, site: str, line: str, entry: Mapping[str, Any]) -> None:
        """What a line has."""
        for sha256 in contents_taken(entry):
            self._new[site, sha256].add(line)

    def of_size(self, site: str, line: str, sizes: Iterable[int]) -> frozenset[str]:
        """What another line of the site has, of captures that have so many bytes: copies of others have not.

        Where this one has it as well, it is the first one's by name.
        """
        lines: dict[str, set[str]] = defaultdict(set)
        for size in sizes:
            if (found := self._of_size.get((site, size))) is None:
                found = self._of_size[site, size] = self._catalog.of_size(site, size)
            for sha256, other in found:
                lines[sha256].add(other)
        return frozenset(sha256 for sha256, others in lines.items() if _is_of_another(line, others))

    def elsewhere(self, site: str, line: str, among: Iterable[str]) -> frozenset[str]:
        """Of these contents those that another line of the site has."""
        new, catalog = self._new, self._catalog
        return frozenset(
            sha256
            for sha256 in among
            if _is_of_another(line, new.get((site, sha256), set()) | catalog.with_content(site, sha256))
        )


def _is_of_another(line: str, lines: Collection[str]) -> bool:
    return min(lines) < line if line in lines else bool(lines)


def _further(before: LakeLine, plain: LineTask, *, redo: bool, result: BatchResult) -> LineTask | None:
    """What is left to do of a line that the lake has."""
    if outdated := _outdated(before, plain):
        gone = {one["url"] for one in before.slices()} - {file.url for file in plain.files}
        if redo and not gone:
            return _anew(before, plain, outdated)
        result.outdated += 1
        if redo:
            result.troubles.append(
                f"site {plain.site}, line {plain.line}: kept as made with other rules or options: {len(gone)} of its "
                "captures are gone"
            )
    known = {(one["url"], one["size"], one["stamp"]) for one in before.slices()}
    fresh = tuple(file for file in plain.files if (file.url, file.size, file.stamp) not in known)
    result.skipped += len(plain.files) - len(fresh)
    if not fresh:
        return None
    return _continued(before, plain, fresh, result) if plain.sliced else plain


def _outdated(before: LakeLine, plain: LineTask) -> frozenset[str]:
    """The tables of a line that are not as these rules and options make them."""
    mark = plain.options.mark()
    if any(entry["options"] != mark for entry in before.entries):
        return frozenset(DATASETS)
    return frozenset().union(*(touched(entry.get("rules", {})) for entry in before.entries))


def _anew(before: LakeLine, plain: LineTask, outdated: frozenset[str]) -> LineTask:
    """The whole line again; rows of other tables than these stay, where one pass over the same captures made them."""
    slices = tuple(before.slices())
    same = [(file.url, file.size, file.stamp) for file in plain.files[: len(slices)]]
    if not _one_pass(before) or same != [(one["url"], one["size"], one["stamp"]) for one in slices]:
        return plain
    if not (stay := DATASETS.keys() - outdated):
        return plain
    settled, tail = ({table: tuple(of(table)) for table in stay} for of in (before.settled, before.tail))
    return replace(plain, kept=KeptRows(settled, tail, slices))


def _one_pass(line: LakeLine) -> bool:
    """Whether each entry went on from the state of the one before."""
    made = {(entry["version"], *sorted(entry.get("rules", {}).items())) for entry in line.entries}
    return len(made) == 1 and not any(entry.get("trouble") for entry in line.entries)


def _continued(
    before: LakeLine, plain: LineTask, fresh: tuple[SourceFile, ...], result: BatchResult
) -> LineTask | None:
    """The newer slices behind what the lake has; the whole line anew where one of them belongs before that."""
    slices, last = list(before.slices()), before.last
    usable = last["version"] == __version__ and not touched(last.get("rules", {}))
    every_one_there = {one["url"] for one in slices} <= {file.url for file in plain.files}
    entered = {one["url"] for one in slices if one["state"] in HAVE_ROWS}
    newest = max(one["url"].rpartition("/")[2] for one in slices)
    grown = slices[-1] if usable and _may_have_grown(slices[-1], fresh[0], newest) else None
    if grown is None and fresh[0].name <= newest:
        if every_one_there:
            return plain
        for file in fresh:
            if file.url in entered:
                words = "has changed since, and older slices of its line are gone: left unchanged"
            elif file.name <= newest:
                words = "belongs before slices that are partly gone: added after them"
            else:
                continue
            result.troubles.append(f"{readable(file.url)}: {words}")
        fresh = tuple(file for file in fresh if file.url not in entered)
        if not fresh:
            return None
    return replace(
        plain,
        files=fresh,
        known=plain.known | {one["sha256"] for one in slices if one["sha256"]},
        state=last["state"] if usable else None,
        tail=last["tail"],
        tail_frames=last.get("tail_frames", 0),
        after=before.numbers[-1],
        grown=grown,
        anew=plain if every_one_there else None,
    )


def _taken_over(before: LakeLine | None, entry: Mapping[str, Any]) -> Iterator[str]:
    """Of a line that was made anew, a line for each capture whose name another recording has now."""
    former = {one["url"]: one["span"] for one in before.slices()} if before else {}
    for one in entry["slices"]:
        spans = [span for span in (former.get(one["url"], one["span"]), one["span"]) if span[0] is not None]
        if spans and max(begin for begin, _ in spans) > min(end for _, end in spans):
            yield (
                f"{readable(one['url'])}: another recording has this name now: its rows take the place of the former "
                "one's"
            )


def _may_have_grown(slice: Mapping[str, Any], file: SourceFile, newest: str) -> bool:
    """Whether this file may be the newest slice with more behind what the lake has of it."""
    return slice["url"] == file.url and file.name == newest and slice["state"] != "twice" and "chunk_digest" in slice


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
    manifest: Manifest | None = None,
) -> BatchResult:
    """Take into the lake what it does not have. Once `stop` says True what is done is kept and the rest left.

    At its end small files are made into larger ones, where there are many, or whatever their count if `compact`.
    `manifest`: the lake's, as it was read before; only newer entries are read then.
    Raises FleetError where the lake cannot be written, at once or again and again.
    """
    begun, result = time.monotonic(), BatchResult()
    refuse_unless_lake(store)
    refuse_sources_inside(store, lines)
    with writing(store):
        manifest = Manifest(store) if manifest is None else manifest.read_on()
        result.troubles += remove_waste(manifest)
        entered = EnteredCaptures(manifest)
        left = planned(manifest, entered, lines, options, redo=redo, result=result)
        total, taking = sum(map(_size, left)), _Taking(manifest, entered, result)
        tasks = line_tasks_together(left)
        while tasks:
            wanted = takewhile(lambda _: stop is None or not stop(), _beside(tasks, taking.full))
            with closing(runner(wanted)) as outcomes:
                for task, outcome in outcomes:
                    if isinstance(task, PackTask):
                        result.packed += _packed(manifest, task, outcome)
                        continue
                    assert isinstance(task, LinesTask)
                    taking.enter(task, outcome)
                    if progress is not None:
                        progress(BatchStep(taking.done, total, result.frames, time.monotonic() - begun))
            tasks = taking.again()
        result.partial = taking.done < total
        if not result.partial:
            result.packed += _pack(manifest, runner, 1 if compact else None, stop)
        manifest.checkpoint()
    result.seconds = time.monotonic() - begun
    return result


class _Taking:
    """What tasks made, entered in the manifest and counted in a result. `done`: bytes; `full`: packs that are full."""

    def __init__(self, manifest: Manifest, entered: EnteredCaptures, result: BatchResult) -> None:
        self._manifest, self._result = manifest, result
        self._entered = entered
        self._unwritten = 0  # one after the other
        self._copies: list[LineTask] = []
        self._alone: list[LinesTask] = []
        self.full = FullPacks(manifest.store.root)
        self.done = 0

    def enter(self, task: LinesTask, outcome: dict[str, Any] | Exception) -> None:
        """One task is done. Raises FleetError where the lake cannot be written, again and again."""
        if not isinstance(outcome, Exception):
            self._enter(task.lines, outcome["lines"], outcome["packs"])
        elif len(task.lines) == 1:
            self._fail(task.lines[0], outcome)
        else:  # each answers for itself
            self._count_unwritten(outcome)
            self._alone += [LinesTask((line,)) for line in task.lines]
        if self._unwritten >= _UNWRITTEN:
            raise FleetError(f"{outcome}; partial output is kept: continue with --resume")

    def again(self) -> list[LinesTask]:
        """What is to be done once more, once."""
        tasks = [*self._alone, *line_tasks_together(self._copies)]
        self._alone, self._copies = [], []
        return tasks

    def _enter(
        self, lines: Sequence[LineTask], outcomes: Iterable[dict[str, Any] | Exception], packs: list[dict[str, Any]]
    ) -> None:
        entries = []
        for line, outcome in zip(lines, outcomes, strict=True):
            if isinstance(outcome, Exception):
                self._fail(line, outcome)
            elif copies := self._elsewhere(line, outcome):
                self._copies.append(line.knowing(copies))
            else:
                self._unwritten = 0
                if outcome["after"] is None:  # made anew, if it was there
                    self._result.troubles += _taken_over(self._manifest.line(line.site, line.line), outcome)
                self._entered.add(line.site, line.line, outcome)
                entries.append(outcome)
                self.done += _size(line)
        if entries:
            self._manifest.add(entries, packs)
            self.full.entered(entries, packs)
        for entry in entries:
            _count(entry, self._result)

    def _elsewhere(self, line: LineTask, entry: dict[str, Any]) -> frozenset[str]:
        """What a line took though another of the site has it since: two copies of a capture, in one batch."""
        return self._entered.elsewhere(line.site, line.line, contents_taken(entry))

    def _fail(self, line: LineTask, error: Exception) -> None:
        self._count_unwritten(error)
        self.done += _size(line)
        words = str(error) if isinstance(error, FleetError) else f"{type(error).__name__}: {error}"
        self._result.failed += 1
        self._result.troubles.append(f"site {line.site}, line {line.line}: not done: {' '.join(words.split())}")

    def _count_unwritten(self, error: Exception) -> None:
        self._unwritten = self._unwritten + 1 if isinstance(error, LakeWriteError) else 0


def _count(entry: dict[str, Any], result: BatchResult) -> None:
    if entry["trouble"]:
        result.troubled += 1
        result.troubles.append(f"site {entry['site']}, line {entry['line']}: {entry['trouble']}")
    result.lines += 1
    result.captures += len(entry["slices"])
    result.frames += entry["frames"]
    result.octets += entry["bytes"]
    for one in entry["slices"]:
        if one["state"] in ("damaged", "unreadable"):
            result.damaged += 1
            more = f" (and {len(one['damage']) - 1} more)" if len(one["damage"]) > 1 else ""
            said = one["damage"][0] if one["damage"] else "damaged"
            result.troubles.append(f"{readable(one['url'])}: {said}{more}")


def compact_lake(store: LakeStore) -> LakePacking:
    """Make all small files of a lake into larger ones. Raises FleetError where there is none, or another writes it."""
    Manifest.of(store)
    with writing(store):
        manifest = Manifest(store)
        remove_waste(manifest)
        packing = _pack(manifest, in_this_process, 1, None)
        manifest.checkpoint()
        return packing


def _beside(tasks: Iterable[LinesTask], full: FullPacks) -> Iterator[LakeTask]:
    """Tasks, with the packs that are full by then between them."""
    for task in tasks:
        yield from full.tasks()
        yield task


def _pack(manifest: Manifest, runner: Runner, least: int | None, stop: Callable[[], bool] | None) -> LakePacking:
    """Make small files into larger ones; what was packed is kept, whatever comes then. Raises FleetError."""
    packing, tasks = LakePacking(), list(pack_tasks(manifest, least))
    if len(tasks) < 2 or sum(task.price for task in tasks) < FULL:
        runner = in_this_process  # done before others would have begun
    wanted = takewhile(lambda _: stop is None or not stop(), tasks)
    with closing(runner(wanted)) as outcomes:
        for task, outcome in outcomes:
            assert isinstance(task, PackTask)
            packing += _packed(manifest, task, outcome)
    return packing


def _packed(manifest: Manifest, task: PackTask, outcome: dict[str, Any] | Exception) -> LakePacking:
    if isinstance(outcome, Exception):
        raise outcome
    return task.enter(manifest, outcome)


def _size(task: LineTask) -> int:
    return task.size + 1
