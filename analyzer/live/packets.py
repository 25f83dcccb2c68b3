"""Rows as packets of a pcapng file that goes on, for Wireshark at the end of a pipe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..exports.targets.pcapng import PacketStream, finding_comment
from ..tables.findings import Finding
from ..tables.schema import Kind
from .lines import clock_time
from .recent import ShownRow

if TYPE_CHECKING:
    from dissectors.maps.model import RegisterMap

    from ..registers.revising import Revision
    from .session import Session


class LivePackets:
    """A packet a row; what is said later of a frame is an empty packet whose comments tell of which one."""

    def __init__(self, session: Session, *, noise: bool = False) -> None:
        self._session, self._noise = session, noise
        self._stream = PacketStream()
        self._now = 0  # ns, of what was written so far

    def begin(self) -> bytes:
        """What stands before all packets."""
        return self._stream.begin()

    def of(self, shown: ShownRow) -> bytes:
        """The packet of a row, or what is said of it later."""
        row = shown.values
        line = self._session.line
        self._now = max(self._now, row.t_end_ns)
        if row.kind == Kind.NOISE and not self._noise:
            if not shown.findings:
                return b""
        elif not shown.late:
            return self._stream.row(shown.batch, shown.row, line)
        where = f"(unit {row.unit}, {clock_time(row.t_end_ns)})" if row.kind else "(bytes in no frame)"
        texts = [f"{finding_comment(finding)} {where}" for finding in shown.findings]
        return self._stream.remark(self._now, row.port, line, texts)

    def use(self, _charts: Mapping[int, RegisterMap]) -> None:
        """Packets are bytes: maps change nothing."""

    def register(self, _revision: Revision) -> bytes:
        """Nothing: what a register means is no packet."""
        return b""

    def bus(self, finding: Finding) -> bytes:
        """A finding about the bus as a whole."""
        return self._stream.remark(self._now, finding.port, self._session.line, [finding_comment(finding)])
