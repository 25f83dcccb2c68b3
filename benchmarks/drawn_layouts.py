"""The layouts of drawn files of register maps: tables, records and lines as people, programs and sources have them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

from drawn_styles import DrawnPoint, DrawnStyle, address_text, cells_of, heading_of, notes_of

_Rows = list[list[str]]


def _table(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> Iterator[tuple[str, list[str]]]:
    """The lines of a table: (title, text), (head, cells), (row, cells)."""
    heads = [heading_of(style, role) for role in columns]
    yield from (("title", [note]) for note in notes_of(style))
    area = ""
    for at, point in enumerate(points):
        if style.area == "title" and point.area != area:
            yield "title", [style.language[point.area][style.number // 2 % len(style.language[point.area])]]
        if at == 0 or (point.area != area and style.area == "title"):
            yield "head", heads
        if at in (0, 6) and "groups" in style.extras and style.area != "title":
            yield "group", [style.language["groups"][at // 6]]
        if at == 7 and "again" in style.extras:
            yield "head", heads
        if at == 4 and "blank" in style.extras:
            yield "row", [""] * len(columns)
        area = point.area
        cells = cells_of(style, point, at)
        yield "row", [cells[role] for role in columns]
    if "reserved" in style.extras and style.area not in ("column", "code"):
        cells = dict.fromkeys(columns, "") | {"label": style.language["reserved"]}
        cells["address"] = address_text(
            style, DrawnPoint(points[-1].area, points[-1].address + 4, "", "u16", 1, "", "")
        )
        yield "row", [cells[role] for role in columns]


def _csv(sign: str, quoted: bool = False) -> Callable[..., tuple[str, str]]:
    def written(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
        def cell(text: str) -> str:
            return f'"{text}"' if quoted or sign in text or '"' in text else text

        lines = []
        for kind, cells in _table(style, columns, points):
            filled = cells if kind in ("head", "row") else [*cells, *[""] * (len(columns) - 1)]
            lines.append(sign.join(map(cell, filled)))
        return ".tsv" if sign == "\t" else ".csv", "\r\n".join(lines) + "\r\n"

    return written


def _blocks(
    style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]
) -> Iterator[tuple[list[str], _Rows]]:
    """Titles with the tables below them; a group is a row with one cell."""
    titles: list[str] = []
    rows: _Rows = []
    for kind, cells in _table(style, columns, points):
        if kind == "title":
            if rows:
                yield titles, rows
                titles, rows = [], []
            titles.append(cells[0])
        else:
            rows.append([*cells, *[""] * (len(columns) - len(cells))] if kind == "group" else cells)
    yield titles, rows


def _markdown(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = ["# Device", ""]
    for titles, rows in _blocks(style, columns, points):
        lines += [*(("## " if len(titles) == 1 else "") + title for title in titles), ""]
        lines += [f"| {' | '.join(rows[0])} |", "|" + "---|" * len(columns)]
        lines += [*(f"| {' | '.join(row)} |" for row in rows[1:]), ""]
    return ".md", "\n".join(lines)


def _html(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = ["<html><body>"]
    for titles, rows in _blocks(style, columns, points):
        lines += [f"<p>{title}</p>" for title in titles]
        lines += ["<table>", "<tr>" + "".join(f"<th>{cell}</th>" for cell in rows[0]) + "</tr>"]
        lines += ["<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows[1:]]
        lines += ["</table>"]
    return ".html", "\n".join([*lines, "</body></html>"])


def _wiki(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = []
    for titles, rows in _blocks(style, columns, points):
        lines += [*(f"== {title} ==" for title in titles), '{| class="wikitable"', "! " + " !! ".join(rows[0])]
        lines += [line for row in rows[1:] for line in ("|-", "| " + " || ".join(row))]
        lines += ["|}"]
    return ".txt", "\n".join(lines)


def _jira(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = []
    for titles, rows in _blocks(style, columns, points):
        lines += [*(f"h3. {title}" for title in titles), "||" + "||".join(rows[0]) + "||"]
        lines += ["|" + "|".join(cell or " " for cell in row) + "|" for row in rows[1:]]
    return ".txt", "\n".join(lines)


def _asciidoc(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = []
    for titles, rows in _blocks(style, columns, points):
        lines += [*(f"== {title}" for title in titles), "", '[options="header"]', "|==="]
        lines += [*("|" + " |".join(row) for row in rows), "|===", ""]
    return ".adoc", "\n".join(lines)


def _latex(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = []
    for titles, rows in _blocks(style, columns, points):
        shown = [
            " & ".join(cell.replace("%", r"\%").replace("_", r"\_").replace("#", r"\#") for cell in row) + r" \\"
            for row in rows
        ]
        lines += [
            *titles,
            r"\begin{tabular}{" + "l" * len(columns) + "}",
            r"\hline",
            shown[0],
            r"\hline",
            *shown[1:],
            r"\hline",
            r"\end{tabular}",
        ]
    return ".tex", "\n".join(lines)


def _aligned(rows: _Rows) -> tuple[list[int], list[list[str]]]:
    widths = [max(_width(row[at]) for row in rows) for at in range(len(rows[0]))]
    return widths, [
        [cell + " " * (width - _width(cell)) for cell, width in zip(row, widths, strict=True)] for row in rows
    ]


def _width(text: str) -> int:
    return sum(1 + (sign > "\u10ff" and sign not in "–—…⁻¹²³") for sign in text)


def _spaced(gap: str, page: bool = False) -> Callable[..., tuple[str, str]]:
    def written(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
        lines = []
        for titles, rows in _blocks(style, columns, points):
            _, shown = _aligned(rows)
            body = [gap.join(row).rstrip() for row in shown]
            if page and len(body) > 6:
                body[6:6] = ["", f"{'Page 12':>70}", "Manual rev. 1.2", "", body[0]]
            lines += [*titles, "", *body, ""]
        return ".txt", "\n".join(lines)

    return written


def _rst(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = []
    for titles, rows in _blocks(style, columns, points):
        widths, shown = _aligned(rows)
        rule = "  ".join("=" * max(2, width) for width in widths)
        body = ["  ".join(cell.ljust(2) for cell in row).rstrip() for row in shown if row[0].strip()]
        lines += [*titles, "", rule, body[0], rule, *body[1:], rule, ""]
    return ".rst", "\n".join(lines)


def _grid(cross: str, bar: str, rule: str) -> Callable[..., tuple[str, str]]:
    def written(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
        lines = []
        for titles, rows in _blocks(style, columns, points):
            widths, shown = _aligned(rows)
            line = cross + cross.join(rule * (width + 2) for width in widths) + cross
            body = [bar + bar.join(f" {cell} " for cell in row) + bar for row in shown]
            lines += [*titles, "", line, body[0], line, *body[1:], line, ""]
        return ".txt", "\n".join(lines)

    return written


def _records(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> list[dict[str, Any]]:
    found = []
    for at, point in enumerate(points):
        cells = cells_of(style, point, at)
        record: dict[str, Any] = {}
        for role in columns:
            text = cells[role]
            key = _keys(style)[role]
            record[key] = int(text) if text.isdecimal() and not text.startswith("0") else text
        if style.area == "title":
            record["area"] = point.area
        found.append(record)
    return found


_KEYS: Final = (
    "address name type unit scale divisor access length signed function area comment id default range",
    "reg label dtype uom factor div rw count is_signed fc table note no factory limits",
    "registerAddress displayName dataType unitOfMeasure scaleFactor divisor accessMode registerCount signed"
    " functionCode registerType description index defaultValue valueRange",
)
_ROLES: Final = "address label type unit scale divisor access words signed function area remark number default range"


def _keys(style: DrawnStyle) -> dict[str, str]:
    """What the file calls what columns hold."""
    return dict(zip(_ROLES.split(), _KEYS[style.number % len(_KEYS)].split(), strict=True))


def _note_of_records(style: DrawnStyle) -> dict[str, str]:
    notes = notes_of(style)
    return {"note": " ".join(notes)} if notes else {}


def _json(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    content = {"device": "X-1", **_note_of_records(style), "registers": _records(style, columns, points)}
    return ".json", json.dumps(content, ensure_ascii=False, indent=1)


def _json_named(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    records = _records(style, columns, points)
    label = _keys(style)["label"]
    named = {record.pop(label): record for record in records}
    return ".json", json.dumps({**_note_of_records(style), "points": named}, ensure_ascii=False, indent=1)


def _yaml(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = [*(f"# {note}" for note in notes_of(style)), "device: X-1", "registers:"]
    for record in _records(style, columns, points):
        body = [f"{key}: {json.dumps(value, ensure_ascii=False)}" for key, value in record.items() if value != ""]
        lines += [f"  {'-' if not at else ' '} {line}" for at, line in enumerate(body)]
    return ".yaml", "\n".join(lines) + "\n"


def _toml(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = [f"# {note}" for note in notes_of(style)]
    for record in _records(style, columns, points):
        lines += [
            "[[register]]",
            *(
                f"{json.dumps(key, ensure_ascii=False)} = {json.dumps(value, ensure_ascii=False)}"
                for key, value in record.items()
            ),
            "",
        ]
    return ".toml", "\n".join(lines)


def _ini(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = [f"; {note}" for note in notes_of(style)]
    for at, record in enumerate(_records(style, columns, points)):
        lines += [f"[reg{at + 1}]", *(f"{key} = {value}" for key, value in record.items()), ""]
    return ".ini", "\n".join(lines)


def _xml(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    from xml.sax.saxutils import quoteattr

    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<device>", *(f"<!-- {note} -->" for note in notes_of(style))]
    for record in _records(style, columns, points):
        lines.append(
            "  <register "
            + " ".join(f"{key.replace('/', '')}={quoteattr(str(value))}" for key, value in record.items())
            + "/>"
        )
    return ".xml", "\n".join([*lines, "</device>"])


def _python(style: DrawnStyle, columns: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
    lines = [*(f"# {note}" for note in notes_of(style)), "REGISTERS = ["]
    lines += [f"    {json.dumps(record, ensure_ascii=False)}," for record in _records(style, columns, points)]
    return ".py", "\n".join([*lines, "]", ""])


_LATIN: Final = str.maketrans("äöüßéèáóí", "aousee" + "aoi")


def _identifier(text: str) -> str:
    plain = text.translate(_LATIN)
    return "".join(sign if sign.isalnum() else "_" for sign in plain).strip("_").upper()


def _parts(style: DrawnStyle, point: DrawnPoint, at: int) -> list[str]:
    """What stands behind a name on a line."""
    cells = cells_of(style, point, at)
    step = f"{point.step} {point.unit}".strip() if point.scale != 1 else point.unit
    access = {"r": "R", "rw": "R/W"}.get(point.access, "")
    kind = cells["type"] if style.kind == "word" else f"{point.words} words" if point.words > 1 else ""
    return [*filter(None, (kind, step, access))]


def _lines(
    opens: Callable[[DrawnStyle, str, str, list[str]], str], suffix: str, mark: str
) -> Callable[..., tuple[str, str]]:
    def written(style: DrawnStyle, _: Sequence[str], points: Sequence[DrawnPoint]) -> tuple[str, str]:
        style.kind = "word" if style.kind == "words signed" else style.kind
        lines = [f"{mark}{note}" for note in notes_of(style)]
        if style.area == "title":
            lines += [f"{mark}{style.language[points[0].area][0]}"]
        for at, point in enumerate(points):
            if suffix in (".h", ".st", ".py"):
                point.name = _identifier(point.name)
            lines.append(opens(style, address_text(style, point), point.name, _parts(style, point, at)))
        return suffix, "\n".join(lines) + "\n"

    return written


LAYOUTS: Final[Mapping[str, Callable[..., tuple[str, str]]]] = {
    "semicolons": _csv(";"),
    "commas": _csv(","),
    "tabs": _csv("\t"),
    "quoted": _csv(",", quoted=True),
    "bars": _csv("|"),
    "markdown": _markdown,
    "html": _html,
    "wiki": _wiki,
    "jira": _jira,
    "asciidoc": _asciidoc,
    "latex": _latex,
    "blanks": _spaced("   "),
    "two-blanks": _spaced("  "),
    "pages": _spaced("    ", page=True),
    "rst": _rst,
    "grid": _grid("+", "|", "-"),
    "box": _grid("┼", "│", "─"),
    "json": _json,
    "json-named": _json_named,
    "yaml": _yaml,
    "toml": _toml,
    "ini": _ini,
    "xml": _xml,
    "python": _python,
    "bullets": _lines(lambda _, a, n, p: f"- {a}: {n}" + f" ({', '.join(p)})" * bool(p), ".txt", ""),
    "colons": _lines(lambda _, a, n, p: ", ".join([f"{a}  {n}", *p]), ".txt", ""),
    "dashes": _lines(lambda _, a, n, p: " - ".join([a, n, *p]), ".txt", ""),
    "defines": _lines(lambda _, a, n, p: f"#define {n:32} {a}" + f"  /* {', '.join(p)} */" * bool(p), ".h", "// "),
    "constants": _lines(lambda _, a, n, p: f"{n} = {a}" + f"  # {', '.join(p)}" * bool(p), ".py", "# "),
}  # fmt: skip
