"""The different requests of a bus, held against what a map says that its device takes (`dissectors.maps.limits`).

Of each unit every function, address and quantity that was asked for is kept once, with the value of a single write;
what a write of several registers holds is checked with the other values. Modbus RTU alone is looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from dissectors.maps.limits import MapBreach, MapRequest, breaches
from dissectors.maps.model import MapArea, RegisterMap

from ..languages import register_words
from ..tables.batch import Batch
from ..tables.schema import Kind, Protocol
from .checking import MapRemark

_AREAS: Final[Mapping[int, MapArea]] = {
    1: "coil", 5: "coil", 15: "coil", 2: "discrete", 3: "holding", 6: "holding", 16: "holding", 4: "input",
}  # fmt: skip
_HEAD: Final = 6  # bytes: unit, function, address, and a quantity or a value
_MOST: Final = 4096  # different requests
_SINGLE: Final = (5, 6)
REQUEST_WORDS: Final = {
    "function": "function {function:02d} was asked for, the map has only {listed}",
    "frame": "an exchange of {asked:g} bytes, the device takes {limit:g}",
    "quantity": "{asked:g} were asked for at once, the device takes {limit:g}",
    "read-only": "written by function {function:02d}, but it is read only",
    "writer": "written by function {function:02d}, the device takes only {listed}",
    "part": "{asked:g} of its {limit:g} registers were written alone",
    "low": "{seen} was asked for, its least value is {limit:g}",
    "high": "{seen} was asked for, its greatest value is {limit:g}",
    "state": "{seen} was asked for, a state without a name",
}


class AskedRequests:
    """Fed with batches; what was asked for, each once."""

    def __init__(self) -> None:
        self._heads: set[bytes] = set()

    def feed(self, batch: Batch) -> None:
        """Take in the requests of a batch."""
        rows = batch.rows
        asked = (rows.kind == Kind.REQUEST) & rows.check & (rows.protocol == Protocol.RTU)
        places = rows.at[asked & (rows.length > _HEAD) & np.isin(rows.function, list(_AREAS))]
        if not len(places) or len(self._heads) >= _MOST:
            return
        octets = batch.data[places[:, None] + np.arange(_HEAD)]
        self._heads.update(head.tobytes() for head in np.unique(octets, axis=0)[:_MOST])

    def of(self, unit: int) -> Iterator[MapRequest]:
        """The requests of one unit, by function and address."""
        for head in sorted(self._heads):
            if head[0] == unit:
                function, address, last = head[1], int.from_bytes(head[2:4], "big"), int.from_bytes(head[4:6], "big")
                words = (last if function == _SINGLE[1] else int(last > 0),) if function in _SINGLE else ()
                yield MapRequest(function, _AREAS[function], address, 1 if words else last, words)


def request_remarks(asked: AskedRequests, charts: Mapping[int, RegisterMap]) -> list[MapRemark]:
    """What of the requests of these units their maps do not allow; each kind once of a value, or of a function."""
    remarks: dict[tuple[int, str, str, int], MapRemark] = {}
    for unit, chart in charts.items():
        for request in asked.of(unit):
            for breach in breaches(chart, request):
                row = breach.row
                words = request.quantity if row is None else row.length
                address, name = (request.address, "") if row is None else (row.address, row.name)
                text = breach_text(request, breach)
                remark = MapRemark("request", unit, request.area, address, words, name, text)
                about = request.function if row is None else address
                remarks.setdefault((unit, breach.kind, request.area, about), remark)
    return list(remarks.values())


def breach_text(request: MapRequest, breach: MapBreach) -> str:
    """A breach in the language in use."""
    unit = breach.row.unit if breach.row is not None else ""
    listed = ", ".join(f"{code:02g}" for code in breach.limit)
    limit = breach.limit[0] if breach.limit else 0
    seen = f"{breach.asked:g} {unit}".rstrip()
    numbers = {"function": request.function, "listed": listed, "asked": breach.asked, "limit": limit, "seen": seen}
    return register_words(REQUEST_WORDS[breach.kind], **numbers)
