"""Parquet in row groups of some size, whatever the size of what comes."""

from __future__ import annotations

from typing import Any, Final

from ..extras import needs
from .sink import ExportError

GROUP: Final = 1 << 16  # rows of a row group, at least: more cost memory


def arrow_imported() -> Any:
    """pyarrow. Raises ExportError where it is not installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ExportError(needs("parquet", "pyarrow", "columns")) from error
    return pyarrow


class RowGroups:
    """Gathers record batches of one schema for a ParquetWriter; `most`: rows of a row group, if those are bounded."""

    def __init__(self, writer: Any, most: int | None = None) -> None:
        self._writer, self._most = writer, most
        self._parts: list[Any] = []
        self._count = 0

    def add(self, part: Any) -> None:
        """A record batch; written once there are enough."""
        self._parts.append(part)
        self._count += len(part)
        if self._count >= GROUP:
            self._write()

    def close(self) -> None:
        """The rest, and the file's footer."""
        if self._parts:
            self._write()
        self._writer.close()

    def _write(self) -> None:
        table = arrow_imported().Table.from_batches(self._parts, self._writer.schema)
        self._writer.write_table(table, row_group_size=self._most)
        self._parts, self._count = [], 0
