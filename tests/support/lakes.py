"""Lakes for tests: buses over days, rings that are cut, batches, rows to compare."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

import captures
from analyzer.fleet.batch import run_batch
from analyzer.fleet.datasets import DATASETS
from analyzer.fleet.lake import Lake
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.runners import in_this_process
from analyzer.fleet.sources import found, lines_of
from analyzer.fleet.stores import store
from analyzer.simulation import Scenario, simulate

DAY_NS = 86_400_000_000_000
BEGIN_NS = 1_790_000_000_000_000_000  # in September 2026


def bus(wire="noisy", seed=1, transactions=120, *, begin_ns=BEGIN_NS, span_ns=None):
    """A simulated bus at a date; `span_ns` spreads it over so long, by longer pauses before requests."""
    made = simulate(Scenario(wire, "precise", transactions=transactions, seed=seed, baud=9600))
    pauses = np.diff([0, *(chunk.t_ns for chunk in made.chunks)])
    offsets = np.cumsum([0, *(len(chunk.data) for chunk in made.chunks[:-1])])
    asked = np.isin(offsets, [frame.start for frame in made.truth if frame.direction == "request"])
    asked &= pauses > 5_000_000
    factor = 1.0 if span_ns is None else (span_ns - pauses[~asked].sum()) / pauses[asked].sum()
    times = np.cumsum(np.where(asked, pauses * factor, pauses).astype(np.int64)) + begin_ns
    chunks = [captures.Chunk(int(t), chunk.data) for t, chunk in zip(times, made.chunks, strict=True)]
    return captures.Capture.of(made.line, chunks)


def write_fleet(folder, transactions=40):
    """Three sites with two lines each, over days; one of the files is text, to be damaged by hand."""
    for site in range(3):
        for line in range(2):
            capture = bus("noisy" if site else "clean", site * 10 + line, transactions, span_ns=2 * DAY_NS)
            path = folder / f"site{site}" / f"bus{line}.{'jsonl' if (site, line) == (2, 1) else 'mcap'}"
            path.parent.mkdir(parents=True, exist_ok=True)
            captures.write(path, capture)
    return folder


def sliced(capture, cuts, folder, name="bus"):
    """The files of a ring that holds these chunks, cut where `cuts` (0 to 1) say."""
    chunks = list(capture.chunks())
    bounds = sorted({0, len(chunks), *(int(cut * len(chunks)) for cut in cuts)})
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, (first, last) in enumerate(pairwise(bounds)):
        path = folder / f"{name}-20260921T{number:06d}.000Z.mcap"
        captures.write(path, captures.Capture.of(capture.line, chunks[first:last]))
        paths.append(path)
    return paths


def ring(tmp_path, name="ring"):
    """Three slices of a ring, and what one pass over them gives."""
    capture = bus("clean", 3, 120, span_ns=DAY_NS)
    return capture, sliced(capture, [0.5, 0.75], tmp_path / name / "site")


def batch(lake, *sources, runner=in_this_process, options=None, **more):
    lines = lines_of(found(map(str, sources)), more.pop("site", None))
    return run_batch(store(str(lake)), lines, options or BatchOptions(), runner, **more)


def plain(answer):
    """The rows of an Arrow table, times as ns: Python's own times know no nanoseconds."""
    import pyarrow as pa

    for i, field in enumerate(answer.schema):
        if pa.types.is_timestamp(field.type):
            answer = answer.set_column(i, field.name, answer.column(i).cast(pa.int64()))
    return answer.to_pylist()


def rows(lake, table):
    """All rows of a table but for what says where they are from, in an order that hangs on the rows alone."""
    return plain(_without_places(lake if isinstance(lake, Lake) else Lake(str(lake)), table))


def _without_places(lake, table):
    answer = lake.arrow(f"SELECT * FROM {table} ORDER BY ALL")
    return answer.drop_columns([name for name in ("source", "size", "sha256") if name in answer.column_names])


def same(one, two, tables=tuple(DATASETS)):
    one, two = Lake(str(one)), Lake(str(two))
    for table in tables:
        if not _without_places(one, table).equals(_without_places(two, table)):  # or they hold a NaN
            assert rows(one, table) == rows(two, table), table
    return True
