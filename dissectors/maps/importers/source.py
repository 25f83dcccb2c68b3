"""A file to import, read once in each way that is asked for: as text, as rows, as a tree of any of its languages."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from itertools import count
from pathlib import PurePath
from typing import Any, Final

from ..cells import one_line
from ..files import decoded
from ..model import MapError
from ..records import json_lines
from ..sheets import ZIP, notes_of_cut
from ..table import csv_rows
from ..vocabulary import expression, form, meet

_MOST_LINES: Final = 40_000  # of the CSV of a program
_MOST_CELLS: Final = 100  # of a row
_MOST_UNNAMED: Final = 1 << 18  # characters of a text that is read as what its name does not say
_MOST_MET: Final = 1 << 17  # characters whose words are looked up at once
_LOOK: Final = 60  # lines that tell how a text is cut
_COMMENT: Final = re.compile(r'("(?:\\.|[^"\\])*(?:"|\\?\Z))|//[^\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
_LAST_COMMA: Final = re.compile(r'("(?:\\.|[^"\\])*(?:"|\\?\Z))|,(?=\s*[}\]])')
_INCLUDED: Final = re.compile(r"^[^#\n]*!include\w*\s+(?:\{?\s*file:\s*)?([^\s,}#]{1,100})", re.MULTILINE)
_TEMPLATE_REMARK: Final = re.compile(r"^([ ]*)(address: *\S+)\s+#\s*(\S.*)$")
_TOP_KEY: Final = re.compile(r"^(\w+):", re.MULTILINE)
_MOST_INCLUDED: Final = 5
_DEEPEST: Final = 40  # elements in elements
_MAIL: Final = re.compile(rb"(?:[A-Z][A-Za-z-]{1,30}: [^\n]{0,400}\n(?:[ \t][^\n]{0,400}\n)*){2}")
_MAIL_HEAD: Final = 4096  # bytes
_ENCODED: Final = (b"content-transfer-encoding:", b"multipart/")
_FEW_QUOTED: Final = 3  # lines
_KINDS: Final = {".yaml": "YAML", ".yml": "YAML", ".toml": "TOML", ".conf": "TOML", ".json": "JSON", ".jinja": "JSON"}
_WAYS: Final = {  # in which a tree is read, by the suffix of its file and by its first sign
    **dict.fromkeys((".yaml", ".yml"), ("yaml",)),
    **dict.fromkeys((".toml", ".conf", ".ini", ".cfg"), ("toml", "ini")),
    "<": ("xml",),
    "{": ("lines",),
}


class MapSource:
    """The file `name` with its bytes `data`; what it is not (YAML, JSON ...) is None."""

    def __init__(self, name: str, data: bytes) -> None:
        self.name = name
        self.data = data
        self.suffix = PurePath(name).suffix.lower()
        self.stem = PurePath(name).stem
        self._problems: dict[str, str] = {}
        self._cut: tuple[str, ...] = ()

    @property
    def problem(self) -> str:
        """Why the file is not of the kind that its name promises, with the line; empty if it is."""
        kind = _KINDS.get(self.suffix, "")
        return f"no {kind}: {self._problems[kind]}" if kind in self._problems else ""

    @cached_property
    def included(self) -> list[str]:
        """The files that a YAML text takes in, as it names them."""
        return list(dict.fromkeys(_INCLUDED.findall(self.text)))[:_MOST_INCLUDED]

    @property
    def is_workbook(self) -> bool:
        return self.data.startswith(ZIP)

    @cached_property
    def tree(self) -> Any:
        """The content of JSON (also one JSON object per line), and of YAML, TOML or INI by the file's name; None of "
        "another."""
        ways = ("json", *_WAYS.get(self.suffix, ()), *_WAYS.get(self.text[:1], ()))
        return next(filter(None, (getattr(self, way) for way in ways)), None)

    @cached_property
    def template(self) -> Any:
        """The YAML that a template renders: what fills it in is left out, remarks behind addresses are a key, and keys
        that stand there again have a number."""
        text = self.yaml.get("render") if isinstance(self.yaml, Mapping) else None
        lines = [line for line in str(text or "").splitlines() if "{{" not in line]
        bare = "\n".join(_TEMPLATE_REMARK.sub(r"\1\2\n\1remark: \3", line) for line in lines)
        numbers = count()
        with suppress(ValueError):
            return _yaml_of(_TOP_KEY.sub(lambda key: f"{key[1]}.{next(numbers)}:", bare)) if lines else None

    @cached_property
    def lines(self) -> Any:
        """The objects of JSON lines."""
        return json_lines(self.text)

    @property
    def notes(self) -> list[str]:
        """What is to be said of the file: what it takes in from others, and where it was cut."""
        included = [f"what it includes is not read: {', '.join(self.included)}"] * bool(self.included)
        return [*included, *self._cut]

    @property
    def rows(self) -> Iterator[dict[str, str]]:
        """The rows of CSV by the numbers of their cells, their own under `row`; nothing behind one that is none."""
        lines = self.text.splitlines()
        delimiter = max("\t;,", key="\n".join(lines[:_LOOK]).count)
        with suppress(MapError):
            for number, cells in csv_rows(lines, delimiter, self.name):
                self._cut = notes_of_cut(number, _MOST_LINES, "rows")
                if self._cut:
                    break
                shown = [cell.strip() for cell in cells[:_MOST_CELLS]]
                line = "\t".join([*shown, *[""] * 8])
                yield {**dict(zip(map(str, range(len(shown))), shown, strict=True)), "row": str(number), "line": line}

    @property
    def table(self) -> Iterator[dict[str, str]]:
        """The rows of CSV by the headings of the first, those without a cell left out."""
        rows = self.rows
        head = {at: name.lower() for at, name in next(rows, {}).items()} | {"row": "row", "line": "line"}
        return ({head.get(at, at): cell for at, cell in row.items() if cell} for row in rows if row["line"].strip())

    def found(self, like: str) -> Iterator[dict[str, str]]:
        """The named parts of all that is like an expression in the text, those that are missing or empty left out."""
        return (dict(filter(all, one.groupdict("").items())) for one in expression(like).finditer(self.text))

    @cached_property
    def xml(self) -> Any:
        """The elements of an XML file, attributes and texts by name, others as lists; none of HTML or with entities."""
        from xml.etree import ElementTree

        try:
            return None if form("has_tables", self.text) else _elements(ElementTree.fromstring(self.text), 0)
        except (ElementTree.ParseError, ValueError):
            return None

    @cached_property
    def ini(self) -> Any:
        """The sections of an INI file, by their names."""
        import configparser

        parser = configparser.RawConfigParser(strict=False)
        parser.optionxform = str  # type: ignore[assignment, method-assign]
        try:
            parser.read_string(self.text)
        except configparser.Error:
            return None
        return {name: dict(parser[name]) for name in parser.sections()}

    @cached_property
    def text(self) -> str:
        """The text: of a mail what its parts hold, without the marks before lines that answer another."""
        text = _mail(self.data) or decoded(self.data) or ""
        bare, quoted = expression("{QUOTED}").subn("", text)
        text = bare if quoted >= _FEW_QUOTED else text
        meet(text[:_MOST_MET])
        return text

    @cached_property
    def json(self) -> Any:
        """The JSON content; comments and a comma behind the last of a list are no part of it."""
        if self.text.lstrip()[:1] not in ("{", "[", "/"):
            return None
        bare = _COMMENT.sub(lambda found: found[1] or re.sub(r"[^\n]", "", found[0]), self.text)
        return self._tried("JSON", json.loads, _LAST_COMMA.sub(lambda found: found[1] or "", bare))

    def _tried(self, kind: str, read: Callable[[str], Any], text: str) -> Any:
        """The content of a text of this kind; None where it is damaged, which is kept."""
        try:
            return read(text)
        except ValueError as error:
            told = f"line {error.lineno}: {error.msg}" if isinstance(error, json.JSONDecodeError) else one_line(error)
            self._problems[kind] = told[:200]
        except RecursionError:
            self._problems[kind] = "nested too deeply"
        return None

    def _may_be(self, kind: str, sign: str) -> bool:
        """Whether to read the text as what its name says, or a short one as anything that it has the lines of."""
        has_lines = len(self.text) < _MOST_UNNAMED and expression(sign).search(self.text)
        return _KINDS.get(self.suffix) == kind or bool(has_lines)

    @cached_property
    def toml(self) -> Any:
        return self._tried("TOML", tomllib.loads, self.text) if self._may_be("TOML", "{TOML}") else None

    @cached_property
    def yaml(self) -> Any:
        """The YAML content; tags that a program defines for itself stand for their plain values."""
        if self.json is not None:  # which is YAML, too
            return self.json
        return self._tried("YAML", _yaml_of, self.text) if self._may_be("YAML", "{YAML}") else None


def _yaml_of(text: str) -> Any:
    from ..yamlform import load_yaml

    return load_yaml(text, lenient=True)


def _mail(data: bytes) -> str:
    """The text of a mail that is written in other signs or has parts, of several forms of one the plain; nothing of
    another file, or of one that is damaged."""
    head = data[:_MAIL_HEAD].lower()
    if _MAIL.match(data) and any(sign in head for sign in _ENCODED):
        import email
        from email.policy import default

        with suppress(LookupError, ValueError):
            message = email.message_from_bytes(data, policy=default)
            return "".join(str(body.get_content()) for body in [message.get_body(("plain", "html"))] if body)
    return ""


def _elements(element: Any, depth: int) -> Any:
    """An element as a mapping, or its text where that is all."""
    text = str(element.text or "").strip()
    if not (len(element) or element.attrib) or depth > _DEEPEST:
        return text
    found: dict[str, Any] = dict(element.attrib)
    for inner in element:
        below = _elements(inner, depth + 1)
        name = inner.tag.rpartition("}")[2]
        if isinstance(below, str):
            found[name] = below
        else:
            found.setdefault(f"{name}:", []).append(below)
    if text:
        found.setdefault("description" if "name" in found else "name", text)
    return found
