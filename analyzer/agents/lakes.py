"""What a lake under the root answers, as plain rows; a lake that names a file outside of it is refused."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from . import AgentError
from .answers import Untrusted
from .root import AgentRoot


def asked_rows(
    root: AgentRoot, name: str, question: str, words: tuple[str, ...], site: str | None, most: int
) -> tuple[str, list[dict[str, Any]]]:
    """The hash of the lake as it is, and the first rows of the answer. Raises FleetError and AgentError."""
    path = root.lake(name)
    try:
        from ..fleet.datasets import DATASETS
        from ..fleet.lake import Lake
        from ..fleet.questions import QUESTIONS, Asked, ready
    except ImportError as error:
        from ..extras import needs

        raise AgentError(needs("a lake", "duckdb", "fleet")) from error
    if any(not root.holds(each) for each in path.rglob("*")):
        raise AgentError("that lake holds a link that leads out of the root")
    lake = Lake(str(path))
    files = sorted(each for table in DATASETS for each in lake.files(table).names)
    if any(not root.holds(Path(each)) for each in files):
        raise AgentError("that lake names files outside the root")
    asked = Asked(words, None, site, most)
    answer = ready(lake, question, asked) if question in QUESTIONS else lake.arrow(question)
    own = "\n".join(Path(each).relative_to(path).as_posix() for each in files)
    return hashlib.sha256(own.encode()).hexdigest(), _rows(answer.slice(0, most))


def _rows(answer: Any) -> list[dict[str, Any]]:
    """Rows by name; moments as ns since 1970, texts as what they are: of somebody else."""
    import pyarrow as pa

    columns = {}
    for name, column in zip(answer.column_names, answer.columns, strict=True):
        if pa.types.is_timestamp(column.type):
            column = column.cast(pa.timestamp("ns")).cast(pa.int64())
        elif pa.types.is_temporal(column.type) or pa.types.is_dictionary(column.type):
            column = column.cast(pa.string())
        columns[str(name)] = [_plain(each) for each in column.to_pylist()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {str(name): _plain(each) for name, each in value.items()}
    if isinstance(value, bool | int) or value is None:
        return value
    try:
        number = float(value)  # a Decimal, too: sums of whole numbers are of that kind
    except (TypeError, ValueError):
        return Untrusted(value)
    if isinstance(value, str):
        return Untrusted(value)
    return None if number != number or abs(number) == float("inf") else int(number) if number == int(number) else number
