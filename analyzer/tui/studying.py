"""The frame under study: its fields and its bytes, each lighting up what is chosen in the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .details import Details
from .look import Look, at_finding, at_row, finding_name
from .messages import FieldChosen, OctetChosen, PieceChosen
from .octets import Octets
from .part import Part
from .pastepane import PastePane

if TYPE_CHECKING:
    from analyzer.findings.model import Finding


class Studying(Part):
    """The part of the main screen below the views."""

    def study_row(self, row: int) -> None:
        """Show a row's fields and bytes."""
        self.row = row
        self.study(at_row(self.desk, row))
        if self.pinned is not None:
            self.frames.unpaint()
        self.say()

    def study_finding(self, finding: Finding, row: int | None) -> None:
        """Show a finding, and the row that it stands on."""
        if row is not None:
            self.row = row
        look = at_finding(finding) if row is None else at_row(self.desk, row)
        self.study(look, to=(finding_name(finding),))
        self.say()

    def study(self, look: Look, *, to: tuple[str, ...] = ()) -> None:
        """Show fields and bytes; the cursor of the fields goes to an item, or stays on the field it is on."""
        self.look = look
        details, octets = self.query_one(Details), self.query_one(Octets)
        item = details.show(look, to=to)
        details.border_title = look.title
        start, length = (0, 0) if item is None else (item.start, item.length)
        octets.show(look, start, length)
        self._title_octets(start, length)

    def on_field_chosen(self, event: FieldChosen) -> None:
        octets = self.query_one(Octets)
        octets.light(event.start, event.length)
        self._title_octets(event.start, event.length)

    def on_octet_chosen(self, event: OctetChosen) -> None:
        details = self.query_one(Details)
        details.light(event.offset)
        item = details.item
        octets = self.query_one(Octets)
        if item is not None and item.length:
            octets.lit = range(item.start, item.start + item.length)
        octets.unpaint()
        self._title_octets(event.offset, 1)

    def _title_octets(self, start: int, length: int) -> None:
        self.query_one(Octets).border_title = self.look.spot(start, length) if self.look.data else ""

    def on_piece_chosen(self, event: PieceChosen) -> None:
        event.stop()
        if self.view == "paste":
            self.study(self.query_one(PastePane).look)
