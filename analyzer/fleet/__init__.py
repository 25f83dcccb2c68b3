"""Fleets: many captures of many sites, analysed into one lake of Parquet tables, and asked.

A task is a pure function of one line's slices to files; a runner (`runners`) runs tasks wherever it likes; the
manifest alone says which files are the lake's. Nothing here schedules, stores or queries by its own means: that is the
work of Dask, fsspec, Parquet and DuckDB.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import RtuscopeError
from ..lazy import lazily

if TYPE_CHECKING:
    from .lake import Lake, lake

__all__ = ["FleetError", "Lake", "lake"]

_HOMES = {"Lake": "lake", "lake": "lake"}


__getattr__ = lazily(__name__, _HOMES)


class FleetError(RtuscopeError):
    """Sources, a lake or a question that cannot be used: what, where, what to do."""


class LakeWriteError(FleetError):
    """The lake took no rows: no fault of the capture that they are of."""
