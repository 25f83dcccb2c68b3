"""What titles and sentences say of the rows of a table that stand below them, and what its footnotes say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from .model import MapArea
from .roles import Table, column_cells, is_heading
from .vocabulary import expression, form, meaning, vocabulary
from .written import access_said, area_words, functions_in, numbers_in, order_of

_FEW: Final = 2  # cells of a row that may be a footnote
_LONGEST: Final = 400  # characters of one
NUMBERINGS: Final = {"in_hex": " hex", "from_one": " 1-based", "in_protocol": " protocol address"}
_CODED: Final = 0.5  # of the cells of a column are codes of which a sentence says what they stand for


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
    type: str = ""  # what a sentence says of the type of all values
    base: int = 0  # from which offsets count
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
        self.group = form("group_title", title.strip("#*: ") * is_group).get("", "") or self.group  # no sentence

    def _take(self, title: str, sentences: Sequence[str]) -> None:
        named = map(area_words, expression(r"[;.] |\S+\s*(?:->|→)[^,;.]*").split(title))  # not what codes stand for
        area = next((one for one in named if one), None)  # the first
        self.order = order_of(form("says_order", title.lower()).get("", "")) or self.order
        bases = (numbers_in(form("based", part).get("base", "")) for part in expression("[,;.()]").split(title))
        self.base = next((found[0] for found in bases if found), self.base)
        self.type = next(filter(_says_type, sentences), self.type)
        self.numbering += "".join(words for kind, words in NUMBERINGS.items() if form(kind, title))
        told = ((area_words(part), access_said(part)) for part in sentences)
        self.accesses |= {part: said for part, said in told if said}
        self.access = access_said(title) or self.access * (area in (None, self.area))
        self.area = area or self.area

    def without_marks(self, cells: Mapping[str, str]) -> dict[str, str]:
        """The cells without the marks of footnotes; what these say is a remark."""
        marked = {key: form("marked", cell) for key, cell in cells.items()}
        known = {key: self.footnotes.get(said.get("mark", ""), "") for key, said in marked.items()}
        bare = {key: marked[key]["rest"] if known[key] else cell for key, cell in cells.items()}
        return {**bare, "description": " ".join(filter(None, (cells.get("description", ""), *known.values())))}


def _says_type(sentence: str) -> bool:
    """Whether a sentence says of which type all values are."""
    return bool(form("says_type", sentence) and meaning("typed", sentence))


def text_of(row: Sequence[str]) -> str:
    """The text of a row without values, which commas may have cut."""
    cells = [*filter(None, row)]
    return (" ", ", ")[len(cells) > _FEW].join(cells)


def is_title(row: Sequence[str]) -> bool:
    """Whether a row is a title that blanks have cut: it names functions, or an area and its access, and no address."""
    text, first = " ".join(row), "".join(row[:1])
    tells = (functions_in(text), all((area_words(first), access_said(text))))
    return any(tells) > any((first == "", is_heading(row), *(form("place", cell) for cell in row)))


def texts_alone(rows: Table) -> list[str]:
    """What stands in rows of one cell or two: titles, sentences, footnotes."""
    return [" ".join(filter(None, row))[:_LONGEST] for row in rows if 0 < sum(map(bool, row)) <= _FEW]


def footnotes_in(texts: Sequence[str]) -> dict[str, str]:
    """What footnotes say, by their marks."""
    return {said["mark"]: said["text"] for said in (form("footnote", text) for text in texts) if said}


def without_codes(rows: Table, texts: Sequence[str]) -> Table:
    """The rows, in columns of codes with what sentences say that these stand for: `FIX1 = factor 0.1`."""
    found = [said for text in texts for said in expression(vocabulary()["legend"]).finditer(text)]
    legend = {said["mark"]: said["text"] for said in found}
    tables = [row for row in rows if len(row) > _FEW] * (legend != {})
    columns = [column_cells(tables, at) for at in range(max(map(len, tables), default=0))]
    coded = {at for at, cells in enumerate(columns) if sum(cell in legend for cell in cells) > _CODED * len(cells)}
    return [[legend.get(cell, cell) if at in coded else cell for at, cell in enumerate(row)] for row in rows]
