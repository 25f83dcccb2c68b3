"""The frame under study: its fields and its bytes, each lighting up what is chosen in the other."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Horizontal

from .details import Details
from .items import NOTHING, FrameDetail
from .messages import FieldChosen, OctetChosen
from .octets import BytesPane


class DetailPane(Horizontal):
    """The pane below the views."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.look: FrameDetail = NOTHING

    def compose(self) -> ComposeResult:
        yield Details(id="details")
        yield BytesPane(id="octets")

    @property
    def fields(self) -> Details:
        return self.query_one(Details)

    @property
    def octets(self) -> BytesPane:
        return self.query_one(BytesPane)

    def show(self, detail: FrameDetail, *, to: tuple[str, ...] = ()) -> None:
        """Show fields and bytes; the cursor of the fields goes to an item, or stays on the field it is on."""
        self.look = detail
        self.octets.display = bool(detail.data) or not detail.items
        item = self.fields.show(detail, to=to)
        self.fields.border_title = detail.title
        start, length = (0, 0) if item is None else (item.start, item.length)
        self.octets.show(detail, start, length)
        self._title_octets(start, length)

    def light(self, start: int, length: int) -> None:
        """Light some bytes, and the field that they belong to."""
        self.fields.light(start)
        self.octets.light(start, length)
        self._title_octets(start, length)

    def open(self, name: str) -> None:
        """Open an item, and let its tree have the keys."""
        self.fields.open(name)
        self.fields.focus()

    @property
    def chosen_bytes(self) -> bytes:
        """The bytes of the field that has the keys, or all."""
        item = self.fields.item
        if self.fields.has_focus and item is not None and item.length:
            return self.look.data[item.start : item.start + item.length]
        return self.look.data

    def on_field_chosen(self, event: FieldChosen) -> None:
        self.octets.light(event.start, event.length)
        self._title_octets(event.start, event.length)

    def on_octet_chosen(self, event: OctetChosen) -> None:
        self.fields.light(event.offset)
        item = self.fields.item
        if item is not None and item.length:
            self.octets.lit = range(item.start, item.start + item.length)
        self.octets.unpaint()
        self._title_octets(event.offset, 1)

    def _title_octets(self, start: int, length: int) -> None:
        self.octets.border_title = self.look.spot(start, length) if self.look.data else ""
