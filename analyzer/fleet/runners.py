"""Who runs tasks: this process, this machine's cores, or a Dask cluster.

On this machine a worker that dies takes only its own task with it, which is tried again. No worker outlives the process
that hands out tasks, however that ends: each holds the end of a pipe that nobody writes to, and ends where the other
end is closed.

On a cluster the scheduler that is there hands tasks out; a worker that dies is its business. The lake and the sources
must be reachable from all workers by the same names: an object store or a shared folder.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Final, NoReturn, Protocol

from ..extras import needs
from . import FleetError


class LakeTask(Protocol):
    """What is run: it goes to another process and may run twice; what it gives is entered by who handed it out."""

    @property
    def key(self) -> tuple[str, str]: ...

    def run(self) -> dict[str, Any]: ...


Outcome = tuple[LakeTask, dict[str, Any] | Exception]
Runner = Callable[[Iterable[LakeTask]], Generator[Outcome, None, None]]  # takes tasks when it has room for them
TRIES: Final = 3  # of a task whose worker died
_TERMINATED: Final = 128 + signal.SIGTERM
_ENDING: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)
_HEED_S: Final = 0.5  # a signal that came just before a wait, or to another thread, does not end that wait
_GRACE_S: Final = 1.0  # for a worker to take its temporary files away


def in_this_process(tasks: Iterable[LakeTask]) -> Generator[Outcome, None, None]:
    """One task after the other, here."""
    for task in tasks:
        try:
            yield task, task.run()
        except Exception as error:
            yield task, error


class ProcessPool:
    """A runner: so many processes, started anew where one died; then those that it may have been at, one by one."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def __call__(self, tasks: Iterable[LakeTask]) -> Generator[Outcome, None, None]:
        coming, again, deaths = iter(tasks), deque[LakeTask](), Counter[tuple[str, str]]()
        while True:
            begun: list[LakeTask] = []
            alone = bool(again)
            try:
                yield from self._run(again, 1, begun) if alone else self._run(coming, self.workers, begun)
            except BrokenProcessPool as death:
                for task in begun:
                    deaths[task.key] += 1
                    if deaths[task.key] < TRIES:
                        again.append(task)
                    else:
                        yield task, RuntimeError(f"its worker died {TRIES} times: {death}")
            else:
                if not alone:
                    return

    def _run(
        self, tasks: Iterator[LakeTask] | deque[LakeTask], workers: int, begun: list[LakeTask]
    ) -> Iterator[Outcome]:
        """Outcomes until all is done. Raises BrokenProcessPool where a worker dies; `begun` then has no outcome yet."""
        running: dict[Future[dict[str, Any]], LakeTask] = {}
        at_hand = workers + (workers > 1)  # nobody waits for its next task while an outcome is put down
        context = get_context("spawn")
        here, there = context.Pipe(duplex=False)
        with here, there, ProcessPoolExecutor(workers, context, _begin, (here,)) as pool:
            try:
                while True:
                    while len(begun) < at_hand and (task := _next(tasks)) is not None:
                        begun.append(task)
                        with _begun_whole():
                            running[pool.submit(_work, task)] = task
                    if not begun:
                        return
                    done, _ = wait(running, _HEED_S, return_when=FIRST_COMPLETED)
                    for future in done:
                        outcome = _outcome(future)
                        task = running.pop(future)
                        begun.remove(task)
                        yield task, outcome
            except BaseException:
                there.close()  # who is still at a task is not waited for
                raise


def _next(tasks: Iterator[LakeTask] | deque[LakeTask]) -> LakeTask | None:
    if isinstance(tasks, deque):
        return tasks.popleft() if tasks else None
    return next(tasks, None)


@contextmanager
def _begun_whole() -> Iterator[None]:
    """What would end this process waits until those that begin here have all that they begin with."""
    came: list[int] = []
    before = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: handler for number in _ENDING if callable(handler := signal.getsignal(number))}
    for number in before:
        signal.signal(number, lambda number, _frame: came.append(number))
    try:
        with _no_interrupt():
            yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in came:
            signal.raise_signal(number)


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Processes that begin here are deaf to Ctrl-C from their first instruction; what comes meanwhile is not lost."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # when it begins it lets them through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(alive: Connection) -> None:
    """A worker: Ctrl-C is for the process that hands out tasks, and what is begun is finished unless that is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(alive,), daemon=True).start()


def _work(task: LakeTask) -> dict[str, Any]:
    """A task in a worker, which takes its temporary files away where it is told to end."""
    before = signal.signal(signal.SIGTERM, _end)
    try:
        return task.run()
    finally:
        signal.signal(signal.SIGTERM, before)


def _end(_number: int, _frame: object) -> NoReturn:
    raise SystemExit(_TERMINATED)


def _end_with(alive: Connection) -> None:
    with suppress(EOFError, OSError):
        alive.recv_bytes()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_GRACE_S)
    os._exit(_TERMINATED)


def _outcome(future: Future[dict[str, Any]]) -> dict[str, Any] | Exception:
    try:
        return future.result()
    except BrokenProcessPool:
        raise
    except SystemExit as end:
        raise BrokenProcessPool(f"ended by itself or by a signal: {end}") from end
    except Exception as error:
        return error


_GONE: Final = "the Dask scheduler is gone; partial output is kept: continue with --resume"
_AHEAD: Final = 2  # tasks handed out for each thread of the cluster


class DaskCluster:
    """A runner: the scheduler at an address such as `tcp://host:8786`, or a client that is there already."""

    def __init__(self, address: str | Any) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise FleetError(needs("--scheduler", "distributed", "cluster")) from error
        if not isinstance(address, str):
            self.client = address
            return
        try:
            self.client = Client(address, timeout="10s")
        except (OSError, ValueError, TimeoutError) as error:
            raise FleetError(f"{address}: no Dask scheduler responds there") from error

    def __call__(self, tasks: Iterable[LakeTask]) -> Generator[Outcome, None, None]:
        """Outcomes as they come. Raises FleetError where the scheduler no longer exists."""
        try:
            yield from self._outcomes(tasks)
        except (OSError, CancelledError) as error:
            logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it would tell its tries to come back
            raise FleetError(_GONE) from error

    def _outcomes(self, tasks: Iterable[LakeTask]) -> Generator[Outcome, None, None]:
        from distributed import as_completed

        coming, running = iter(tasks), dict[str, LakeTask]()
        finished = as_completed(with_results=False)
        while True:
            while len(running) < self._room() and (task := next(coming, None)) is not None:
                future = self.client.submit(_run, task, pure=False, retries=TRIES)
                running[future.key] = task
                finished.add(future)
            if not running:
                return
            future = next(finished)
            if future.status == "cancelled":  # by its end or a new beginning
                raise CancelledError
            task = running.pop(future.key)
            yield task, future.result() if future.status == "finished" else _error(future)

    def _room(self) -> int:
        threads: int = sum(self.client.nthreads().values())
        return _AHEAD * max(threads, 1)


def _run(task: LakeTask) -> dict[str, Any]:
    return task.run()


def _error(future: Any) -> Exception:
    error = future.exception()
    return error if isinstance(error, Exception) else RuntimeError(f"{future.status}: {error}")
