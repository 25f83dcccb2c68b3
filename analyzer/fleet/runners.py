"""Tasks on this machine's cores. A worker that dies takes only its own task with it, which is tried again."""

from __future__ import annotations

import signal
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any, Final

from .tasks import LineTask, run_task

Outcome = tuple[LineTask, dict[str, Any] | Exception]
Runner = Callable[[Iterable[LineTask]], Generator[Outcome, None, None]]  # takes tasks when it has room for them
TRIES: Final = 3  # of a task whose worker died


def in_this_process(tasks: Iterable[LineTask]) -> Generator[Outcome, None, None]:
    """One task after the other, here."""
    for task in tasks:
        try:
            yield task, run_task(task)
        except Exception as error:
            yield task, error


class ProcessPool:
    """A runner: so many processes, started anew where one died; then those that it may have been at, one by one."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def __call__(self, tasks: Iterable[LineTask]) -> Generator[Outcome, None, None]:
        coming, again, deaths = iter(tasks), deque[LineTask](), Counter[tuple[str, str]]()
        while True:
            begun: list[LineTask] = []
            alone = bool(again)
            try:
                yield from self._run(again, 1, begun) if alone else self._run(coming, self.workers, begun)
            except BrokenProcessPool as death:
                for task in begun:
                    key = (task.site, task.line)
                    deaths[key] += 1
                    if deaths[key] < TRIES:
                        again.append(task)
                    else:
                        yield task, RuntimeError(f"its worker died {TRIES} times: {death}")
            else:
                if not alone:
                    return

    def _run(
        self, tasks: Iterator[LineTask] | deque[LineTask], workers: int, begun: list[LineTask]
    ) -> Iterator[Outcome]:
        """Outcomes until all is done. Raises BrokenProcessPool where a worker dies; `begun` then has no outcome yet."""
        running: dict[Future[dict[str, Any]], LineTask] = {}
        at_hand = workers + (workers > 1)  # nobody waits for its next task while an outcome is put down
        with ProcessPoolExecutor(workers, get_context("spawn"), _heed_no_interrupt) as pool:
            while True:
                while len(begun) < at_hand and (task := _next(tasks)) is not None:
                    begun.append(task)
                    running[pool.submit(run_task, task)] = task
                if not begun:
                    return
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    outcome = _outcome(future)
                    task = running.pop(future)
                    begun.remove(task)
                    yield task, outcome


def _next(tasks: Iterator[LineTask] | deque[LineTask]) -> LineTask | None:
    if isinstance(tasks, deque):
        return tasks.popleft() if tasks else None
    return next(tasks, None)


def _heed_no_interrupt() -> None:
    """Ctrl-C is for the process that hands out tasks: those that were begun are finished."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _outcome(future: Future[dict[str, Any]]) -> dict[str, Any] | Exception:
    try:
        return future.result()
    except BrokenProcessPool:
        raise
    except Exception as error:
        return error
