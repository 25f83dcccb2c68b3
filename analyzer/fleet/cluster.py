"""Tasks on a Dask cluster: the scheduler that is there hands them out; a worker that dies is its business.

The lake and the sources must be reachable from all workers by the same names: an object store or a shared folder.
"""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterable
from concurrent.futures import CancelledError
from typing import Any, Final

from ..extras import needs
from .errors import FleetError
from .runners import TRIES, Outcome
from .tasks import LineTask, run_task

_GONE: Final = "the Dask scheduler is there no more; what was done is kept: --resume goes on"
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
            raise FleetError(f"{address}: no Dask scheduler answers there") from error

    def __call__(self, tasks: Iterable[LineTask]) -> Generator[Outcome, None, None]:
        """Outcomes as they come. Raises FleetError where the scheduler is there no more."""
        try:
            yield from self._outcomes(tasks)
        except (OSError, CancelledError) as error:
            logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it would tell its tries to come back
            raise FleetError(_GONE) from error

    def _outcomes(self, tasks: Iterable[LineTask]) -> Generator[Outcome, None, None]:
        from distributed import as_completed

        coming, running = iter(tasks), dict[str, LineTask]()
        finished = as_completed(with_results=False)
        while True:
            while len(running) < self._room() and (task := next(coming, None)) is not None:
                future = self.client.submit(run_task, task, pure=False, retries=TRIES)
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


def _error(future: Any) -> Exception:
    error = future.exception()
    return error if isinstance(error, Exception) else RuntimeError(f"{future.status}: {error}")
