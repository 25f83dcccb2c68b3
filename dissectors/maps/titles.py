"""What titles and sentences say of the rows of a table that stand below them, and what its footnotes say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from .model import MapArea
from .roles import Table
from .vocabulary import expression, form
from .written import access_said, area_words, numbers_in, order_of

_FEW: Final = 2  # cells of a row that may be a footnote
_LONGEST: Final = 400  # characters of one


@dataclass(slots=True)
class Titles:
    """What titles and sentences say of the rows below them."""

    area: MapArea | None = None
    order: str | None = None
    access: str = ""
    accesses: dict[MapArea | None, str] = field(default_factory=dict)  # of the areas of which a sentence speaks
    numbering: str = ""  # how addresses are written, as words of a heading
    group: str = ""
    tables: dict[str, str] = field(default_factory=dict)  # what sentences say of tables by their numbers
    blocks: dict[str, int] = field(default_factory=dict)  # where blocks of the same offsets begin, by their names
    footnotes: dict[str, str] = field(default_factory=dict)  # by their marks

    def take(self, title: str, *, is_group: bool) -> None:
        """Take in a title, and what was said of its table before."""
        sentences = expression("[,;.]").split(title)
        for sentence in sentences:
            for number in expression("\\d+").findall(form("of_tables", sentence).get("numbers", "")):
                self.tables.setdefault(number, sentence)
        own = [part for part in sentences if not form("of_tables", part)]
        told = self.tables.get(form("table_title", title).get("number", ""), "")
        self._take(title if own == sentences and not told else ", ".join([*own, told]), own)
        self.blocks |= {said["name"]: numbers_in(said["base"])[0] for said in expression("{BLOCK}").finditer(title)}
        if is_group:
            self.group = _group(title) or self.group

    def _take(self, title: str, sentences: Sequence[str]) -> None:
        named = map(area_words, expression("[;.] ").split(title))
        area = next((one for one in named if one), None)  # the first
        self.order = order_of(form("says_order", title.lower()).get("", "")) or self.order
        self.numbering += " hex" * (form("in_hex", title) != {}) + " 1-based" * (form("from_one", title) != {})
        told = ((area_words(part), access_said(part)) for part in sentences)
        self.accesses |= {part: said for part, said in told if said}
        self.access = access_said(title) or self.access * (area in (None, self.area))
        self.area = area or self.area

    def without_marks(self, cells: Mapping[str, str]) -> dict[str, str]:
        """The cells without the marks of footnotes; what these say is a remark."""
        if not self.footnotes:
            return dict(cells)
        bare = {}
        said = cells.get("description", "")
        for key, cell in cells.items():
            marked = form("marked", cell)
            known = self.footnotes.get(marked.get("mark", ""), "")
            bare[key] = marked["rest"] if known else cell
            said += f" {known}" * bool(known)
        return bare | {"description": said.strip()}


def texts_alone(rows: Table) -> list[str]:
    """What stands in rows of one cell or two: titles, sentences, footnotes."""
    return [" ".join(filter(None, row))[:_LONGEST] for row in rows if 0 < sum(map(bool, row)) <= _FEW]


def footnotes_in(texts: Sequence[str]) -> dict[str, str]:
    """What footnotes say, by their marks."""
    return {said["mark"]: said["text"] for said in (form("footnote", text) for text in texts) if said}


def _group(text: str) -> str:
    """The title above rows, as a group; a sentence is none."""
    return form("group_title", text.strip("#*: ")).get("", "")
