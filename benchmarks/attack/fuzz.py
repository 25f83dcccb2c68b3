"""Fuzz: hostile inputs for every target, in processes of their own, timed and weighed.

These are forks of one that has imported what all of them need, which takes longer than many a run.

A target may raise only what its users are told in a line; no input of 64 KiB takes over a second of CPU, and no process
over 300 MB. Input number i of a target is the same for a seed, whatever else is run.
"""

from __future__ import annotations

import faulthandler
import json
import mmap
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, Final

from attack import account
from attack.inputs import spoilt
from attack.target import Outcome, Target
from attack.targets import targets

MEGABYTES: Final = 300
_DEAD_S: Final = 600  # without a sign of life, after which a process is asked where it stands, and ended
_LOOP_S: Final = 30  # the same of CPU seconds, over what a batch may take
_BATCH: Final = 64  # inputs, between two looks at what the system knows of the process
_NOTABLE_S: Final = 0.1  # of one input
_SLICE: Final = 60_000  # inputs that one process of a campaign has at most
_A_SHARE: Final = 700  # of them for each share of its target
_TOLD: Final = 20  # failures of a target that are told in full


def attack(seed: int, inputs: int, *, only: str = "", first: int = 0, patience: float = 1) -> Outcome:
    """So many inputs over all targets by their shares, or over those whose name has `only` in it.

    An input may take `patience` times what its target allows.
    """
    chosen = _chosen(only)
    shares = sum(target.share for target in chosen)
    outcome = Outcome("fuzz")
    begun, slowest, largest = time.monotonic(), 0.0, 0.0
    with _Nursery() as nursery:
        for target in chosen:
            count, at = max(1, round(inputs * target.share / shares)), first
            target_begun, failures = time.monotonic(), len(outcome.failures)
            while at < first + count:
                done = _run(nursery, target.name, (seed, at, first + count - at, patience), outcome)
                at = int(done["next"])
                slowest, largest = max(slowest, done["slowest"]), max(largest, done["megabytes"])
            outcome.tried += count
            rate = count / (time.monotonic() - target_begun)
            bad = len(outcome.failures) - failures
            told = f"  {target.name}: {count:,} inputs, {rate:,.0f} a second, {bad} failures"
            print(told, file=sys.stderr, flush=True)
    spent = time.monotonic() - begun
    outcome.figures = f"seed {seed}, slowest {slowest:.2f} s, largest process {largest:.0f} MB, {spent:.0f} s"
    return outcome


def _chosen(only: str) -> list[Target]:
    return [target for name, target in targets().items() if any(word in name for word in only.split(","))]


def campaign(seed: int, inputs: int, path: Path, *, only: str = "", most: int = _SLICE) -> Outcome:
    """Goes on with the account at `path` until it has so many inputs of this seed over the targets chosen.

    Every target gets its share in turn, at most `most` for each, so that an account which was broken off is balanced.
    """
    chosen = _chosen(only)
    outcome, names = Outcome("campaign"), {target.name for target in chosen}

    def mine() -> list[account.Entry]:
        return [entry for entry in account.entries(path) if entry.target in names]

    with suppress(KeyboardInterrupt), _Nursery() as nursery:
        while chosen and sum(entry.count for entry in mine() if entry.seed == seed) < inputs:
            for target in chosen:
                first = account.reached(mine(), target.name, seed)
                account.add(path, _slice(nursery, target, seed, first, most))
    for entry in (done := mine()):
        outcome.failures += entry.failures
        outcome.tried += entry.count
    print("\n".join(account.told(done)), flush=True)
    outcome.figures = f"account in {path}"
    return outcome


def _slice(nursery: _Nursery, target: Target, seed: int, first: int, most: int) -> account.Entry:
    """The next inputs of a target, in one process, or in more where one ends early."""
    found, at, last = Outcome(target.name), first, first + min(_A_SHARE * target.share, most)
    cpu = slowest = megabytes = 0.0
    while at < last:
        done = _run(nursery, target.name, (seed, at, last - at, 1.0), found)
        at, cpu = int(done["next"]), cpu + done["cpu_s"]
        slowest, megabytes = max(slowest, done["slowest"]), max(megabytes, done["megabytes"])
    return account.Entry(
        target.name, seed, first, last - first, account.revision(), round(cpu, 2), round(slowest, 3),
        round(megabytes, 1), found.failures,
    )  # fmt: skip


class _Nursery:
    """A process that forks one for each run."""

    def __enter__(self) -> _Nursery:
        command = [sys.executable, str(Path(__file__).parent), "--nursery"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, errors="replace"
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def run(self, *given: object) -> tuple[int, list[dict[str, Any]]]:
        """How a run of `work` ended, and the objects that it printed."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(given) + "\n")
        self._process.stdin.flush()
        lines = []
        for line in self._process.stdout:
            if line.startswith("{"):
                lines.append(json.loads(line))
                if "ended" in lines[-1]:
                    return lines.pop()["ended"], lines
        raise RuntimeError(f"the process that runs come from died ({self._process.wait()})")


def nurse() -> None:
    """Forks for each line of standard input, a list of what `work` is given; the fork works, and comes back."""
    while line := sys.stdin.readline():
        pid = os.fork()
        if not pid:
            work(*json.loads(line))
            return
        ended = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        print(json.dumps({"ended": ended}), flush=True)


def _run(nursery: _Nursery, name: str, given: tuple[int, int, int, float], outcome: Outcome) -> dict[str, float]:
    """One process for as many inputs as it lives; where the next has to go on, and its figures."""
    seed, first, *_ = given
    with tempfile.NamedTemporaryFile() as place, tempfile.NamedTemporaryFile() as said:
        status, lines = nursery.run(name, *given, place.name, said.name)
        reached = int.from_bytes(Path(place.name).read_bytes(), "little") or first
        last = Path(said.name).read_text(errors="replace").strip()[-1500:]
    again = f"benchmarks/attack fuzz --only {name!r} --seed {seed} --first"
    told = [f"{name} ({again} {line['input']} --inputs 1): {line['failure']}" for line in lines if "failure" in line]
    outcome.failures += told
    ends = [line for line in lines if "next" in line]
    if ends:
        end: dict[str, float] = ends[0]
        return end
    outcome.failures.append(f"{name} ({again} {reached} --inputs 1): the process died ({status}): {last}")
    return {"next": reached + 1, "slowest": 0.0, "megabytes": 0.0, "cpu_s": 0.0}


def work(name: str, seed: int, first: int, count: int, patience: float, place: str, said: str) -> None:
    """What a process of its own does: one JSON object per line for each failure, and one at the end.

    The number of the input in hand goes to the file `place`, what is said of the process's end to `said`.
    """
    with Path(said).open("wb") as errors:
        os.dup2(errors.fileno(), 2)
    target = targets()[name]
    slowest, told = 0.0, 0
    with suppress(Exception):  # what is loaded when it is first used is not the input's
        target.take(target.seeds()[0], Random(0))
    faulthandler.register(signal.SIGPROF, chain=True)  # in a loop without end: where, and then the signal's own effect
    with Path(place).open("r+b") as file:
        file.write(bytes(8))
        file.flush()
        at_work = mmap.mmap(file.fileno(), 8)  # written without a call of the system for each input
    for number in range(first, first + count):
        if (number - first) % _BATCH == 0:
            faulthandler.dump_traceback_later(_DEAD_S, exit=True)
            signal.setitimer(
                signal.ITIMER_PROF, patience * (max(_LOOP_S, 3 * target.seconds) + _BATCH * target.seconds)
            )
        at_work[:] = number.to_bytes(8, "little")
        failure, spent = _one(target, seed, number, patience)
        slowest = max(slowest, spent)
        looked = spent > _NOTABLE_S or (number - first) % _BATCH == _BATCH - 1 or number == first + count - 1
        grown = looked and _most_so_far() > MEGABYTES and _peak_megabytes() > MEGABYTES
        if grown and not failure:
            failure = f"{_peak_megabytes():.0f} MB, by this input or one of the {_BATCH} before it"
        if failure and told < _TOLD:
            print(json.dumps({"input": number, "failure": failure}), flush=True)
            told += 1
        if grown:  # it would be said of all inputs to come
            break
    else:
        number = first + count - 1
    signal.setitimer(signal.ITIMER_PROF, 0)
    figures = {"slowest": slowest, "megabytes": _peak_megabytes(), "cpu_s": time.process_time()}
    print(json.dumps({"next": number + 1, **figures}), flush=True)


def _most_so_far() -> float:
    """The most memory in MB, cheaply: on Linux it may be that of the process which started this one."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def _peak_megabytes() -> float:
    """The most memory that this process had."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1e3
    return _most_so_far()


def _one(target: Target, seed: int, number: int, patience: float = 1) -> tuple[str, float]:
    """What was wrong with one input, if anything, and the CPU seconds that it took.

    The time of day is cheap to ask for and never less; only of what took notably long is the CPU's asked, once more.
    """
    failure, data, spent = _fed(target, seed, number, time.perf_counter)
    if spent > min(_NOTABLE_S, patience * target.seconds):
        failure, data, spent = _fed(target, seed, number, time.process_time)
    if spent > patience * target.seconds and not failure:
        failure = f"{data[:60]!r}... of {len(data):,} bytes: {spent:.1f} s"
    return failure, spent


def _fed(target: Target, seed: int, number: int, clock: Callable[[], float]) -> tuple[str, bytes, float]:
    """What was wrong with one input, if anything; the input; the seconds that it took by a clock."""
    chance = Random(f"{seed} {target.name} {number}")
    data = target.make(chance) if target.make else spoilt(chance, target.seeds(), target.tokens)
    failure = ""
    begun = clock()
    try:
        target.take(data, chance)
    except Exception as error:
        if not _is_told(error, target):
            failure = f"{data[:60]!r}: " + "".join(traceback.format_exception(error, limit=-4)).strip()
        elif "\n" in str(error):
            failure = f"{data[:60]!r}: an error of more than a line: {error}"
    return failure, data, clock() - begun


def _is_told(error: Exception, target: Target) -> bool:
    """Whether it is an error of this target, raised on purpose: not by Python underneath."""
    if not isinstance(error, target.errors):
        return False
    if type(error).__module__ != "builtins":
        return True
    return (traceback.extract_tb(error.__traceback__)[-1].line or "").startswith("raise ")
