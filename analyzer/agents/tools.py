"""The eight tools, without the protocol: each takes plain arguments and gives the JSON text of an answer.

What a method is called, its arguments and its docstring are what an agent sees of a tool.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from dissectors.values import floating, integer

from ..reports.hashes import file_sha256
from ..tables.schema import Kind
from . import AgentError
from .answers import HASH, AnswerPage, Untrusted, answered, citation, cut
from .bus import CaptureFacts, KeptFacts, narrowed
from .root import AgentRoot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dissectors.fields import Field

    from ..causes.registry import Cause
    from ..paste.model import PastedFrame
    from ..registers.recognition import Recognised
    from ..registers.roles import RegisterValue
    from ..reports.model import FindingGroup, FindingRow, PollRow, UnitRow
    from ..tables.batch import Batch, Frame

Area = Literal["coil", "discrete", "input", "holding"]
Order = Literal["ABCD", "CDAB", "BADC", "DCBA"]
ValueType = Literal["u16", "s16", "u32", "s32", "f32", "u64", "s64", "f64"]
_HEX: Final = 48  # digits of a frame that a list has
_LONG_HEX: Final = 520  # and one that is asked for alone: all of an ADU
_HASHED: Final = 64 << 20  # bytes of a file that a list of captures hashes
_CHARACTERS: Final = 1 << 20  # of a paste
_ROWS: Final = 200  # of a lake's answer
_LAST_UNIT, _LAST_ADDRESS = 255, 0xFFFF


class AgentTools:
    """The tools over one root."""

    def __init__(self, root: AgentRoot) -> None:
        self._root, self._facts = root, KeptFacts()

    def by_name(self) -> dict[str, Callable[..., str]]:
        """All of them."""
        return {
            "captures": self.captures,
            "info": self.info,
            "report": self.report,
            "frames": self.frames,
            "registers": self.registers,
            "values": self.values,
            "parse": self.parse,
            "ask": self.ask,
        }

    def captures(self, offset: int = 0) -> str:
        """List the captures (recordings of a Modbus bus) and lakes (many captures, analysed) under the root."""
        found = [each for name, lake in self._root.names() if (each := self._listed(name, lake)) is not None]
        page = AnswerPage({}, offset)
        page.add_statements(len(found), lambda number: found[number]())
        return page.text()

    def _listed(self, name: str, lake: bool) -> Callable[[], Mapping[str, Any]] | None:
        """What makes the statement on a file or a lake; None where it is no capture."""
        from captures.errors import CaptureError
        from captures.files import read_head
        from captures.formats import likely

        if lake:
            return lambda: {"lake": Untrusted(name)}
        try:
            path = self._root.file(name)
            octets = path.stat().st_size
            if not likely(name, read_head(path)):
                return None
        except (OSError, CaptureError, AgentError):
            return None
        return lambda: {
            "capture": Untrusted(name),
            "bytes": octets,
            "cite": f"{file_sha256(path)[:HASH]}:" if octets <= _HASHED else None,
        }

    def info(self, capture: str) -> str:
        """What a capture is: format, line settings, span, how many frames, what could not be read of it."""
        facts = self._of(capture)
        report, line = facts.report, facts.analysis.line
        about = {
            "format": report.format,
            "baud": report.baud,
            "char_bits": report.char_bits,
            "parity": line.parity,
            "t_start_ns": report.t_start_ns,
            "span_s": None if report.span_ns is None else round(report.span_ns / 1e9, 6),
            "bytes": report.bytes,
            "noise_bytes": report.noise_bytes,
        }
        statements: list[Mapping[str, Any]] = [about]
        numbers = {"not noise": ("frames", report.frames), "request": ("requests", report.requests)}
        told = [{"what": what, "count": count, "all": all_of} for all_of, (what, count) in numbers.items()]
        statements.append({"counts": told})
        statements += [{"note": Untrusted(f"{name}: {value}")} for name, value in line.notes.items()]
        statements += [{"not_read": Untrusted(each)} for each in report.damage]
        return answered(_head(facts), (_cited(facts, each, ()) for each in statements))

    def report(
        self,
        capture: str,
        section: Literal["all", "causes", "findings", "units", "polls"] = "all",
        offset: int = 0,
    ) -> str:
        """What is wrong on the bus and how its units do: causes (best first, with remedy), findings, units, polls.

        `all` is a filter that gives exactly the frames counted: hand it to `frames`.
        """
        facts = self._of(capture)
        report = facts.report
        parts: dict[str, Iterator[Mapping[str, Any]]] = {
            "causes": (_cause(facts, each) for each in report.causes),
            "findings": (_finding(facts, row) for row in report.findings),
            "units": (_unit(facts, row) for row in report.units),
            "polls": (_cited(facts, _poll(row), facts.frames_of_unit(row.unit)) for row in report.polls),
        }
        chosen = parts if section == "all" else {section: parts[section]}
        return answered(_head(facts), (each for rows in chosen.values() for each in rows), offset)

    def frames(self, capture: str, filter: str = "", offset: int = 0, fields: bool = False) -> str:
        """The frames that pass a display filter, such as `unit == 17 and exception`, `crc_ok == false`,
        `response_time > 50ms`, `finding == "late-response"`, `register == 40108`, `index in (12, 15..17)`; their number
        is `of`. `fields` tells the first ones field by field.
        """
        facts = self._of(capture)
        page = AnswerPage(_head(facts), offset)
        for analysed in narrowed(facts, filter).analysed():
            batch = analysed.batch
            rows = np.flatnonzero(batch.rows.kind != Kind.NOISE).tolist()

            def statement(number: int, batch: Batch = batch, rows: list[int] = rows) -> Mapping[str, Any]:
                return _frame(facts, batch.frame(rows[number]), fields=fields)

            page.add_statements(len(rows), statement)
        return page.text()

    def registers(self, capture: str, unit: int | None = None, map: str = "", offset: int = 0) -> str:
        """What the registers hold: type, word order, range, with confidence; names where a map is given or the device
        is recognised. `map` is a shipped one's name or a file under the root, `MAP` or `MAP@UNIT`.
        """
        from dissectors.maps.files import unit_maps

        facts = self._of(capture)
        maps = unit_maps([self._root.map_name(map)]) if map else None
        values = facts.registers(_number(unit, _LAST_UNIT, "unit"), maps)
        statements = [_look(facts, each) for each in facts.recognised if unit in (None, each.unit)]
        statements += [_register(facts, value) for value in values]
        return answered(_head(facts), statements, offset)

    def values(
        self,
        capture: str,
        unit: int,
        area: Area,
        address: int,
        type: ValueType = "u16",
        order: Order = "ABCD",
        changes: bool = True,
        offset: int = 0,
    ) -> str:
        """What a register held over time, by the answers that tell it; `address` counts from 0, `order` ABCD is most
        significant word first. With `changes` only answers that tell another value than the one before.
        """
        facts = self._of(capture)
        words = int(type[1:]) // 16
        place = _number(unit, _LAST_UNIT, "unit"), _number(address, _LAST_ADDRESS, "address")
        told: list[tuple[int, int, list[int]]] = []
        for each in facts.values(place[0] or 0, area, place[1] or 0, words):
            if not changes or not told or told[-1][2] != each[2]:
                told.append(each)

        def statement(number: int) -> Mapping[str, Any]:
            frame, t_ns, held = told[number]
            return _cited(facts, {"t_ns": t_ns, "value": _value(held, type, order), "raw": held}, (frame,))

        page = AnswerPage(_head(facts), offset)
        page.add_statements(len(told), statement)
        return page.text()

    def parse(self, text: str, offset: int = 0) -> str:
        """Read pasted bytes or lines of a log: the frames in them, with what is wrong and what to send instead.

        A citation is of the text's own hash, and of frames by their number in it.
        """
        from ..paste import read

        if len(text) > _CHARACTERS:
            raise AgentError(f"over {_CHARACTERS:,} characters are too many: put them into a file under the root")
        paste = read(text, "auto", "auto", None)
        sha256 = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
        frames = list(paste.frames())
        page = AnswerPage({"sha256": sha256, "protocol": paste.protocol}, offset)
        page.add_statements(len(frames), lambda number: _pasted(sha256, frames[number], number))
        unread = [
            {"not_read": Untrusted(each.text), "line": each.line, "why": Untrusted(each.why)} for each in paste.unread
        ]
        page.add_statements(len(unread), unread.__getitem__)
        return page.text()

    def ask(
        self, lake: str, question: str, words: list[str] | None = None, site: str | None = None, offset: int = 0
    ) -> str:
        """Ask a lake: SQL (one SELECT over the tables frames, transactions, values, findings, causes, hours, captures),
        or a ready question: worst-units, new-causes, drift, silent, damaged, `register` with `words` UNIT ADDRESS,
        `compare` with `words` SITE SITE. A citation is of the lake's hash, and of the answer's row.
        """
        from .lakes import asked_rows

        sha256, rows = asked_rows(self._root, lake, question, tuple(words or ()), site, _ROWS)
        page = AnswerPage({"lake": Untrusted(lake), "sha256": sha256}, offset)
        page.add_statements(len(rows), lambda number: {**rows[number], "cite": f"{sha256[:HASH]}:r{number}"})
        return page.text()

    def _of(self, capture: str) -> CaptureFacts:
        return self._facts.of(self._root.file(capture))


def _number(value: int | None, most: int, what: str) -> int | None:
    if value is not None and not 0 <= value <= most:
        raise AgentError(f"{what} is a number from 0 to {most}")
    return value


def _head(facts: CaptureFacts) -> dict[str, Any]:
    return {"sha256": facts.sha256}


def _cited(
    facts: CaptureFacts, statement: Mapping[str, Any], frames: Sequence[int], octets: Sequence[int] = ()
) -> dict[str, Any]:
    """A statement with its citation; of the bus as a whole by its first and last frame, or by its first byte."""
    if not frames and not octets:
        frames, octets = ((), (0,)) if facts.whole is None else (facts.whole.frames, ())
    return {**statement, "cite": citation(facts.sha256, frames, octets)}


def _look(facts: CaptureFacts, looks: Recognised) -> dict[str, Any]:
    statement = {
        "unit": looks.unit,
        "looks_like": looks.chart.called,
        "map": looks.name or None,
        "confidence": round(looks.confidence, 3),
    }
    return _cited(facts, statement, facts.frames_of_unit(looks.unit))


def _cause(facts: CaptureFacts, cause: Cause) -> dict[str, Any]:
    statement = {
        "cause": cause.cause,
        "severity": cause.severity,
        "units": list(cause.units),
        "confidence": round(cause.confidence, 3),
        "else": cause.runner_up,
        "text": cause.text,
        "share": cause.share or None,
        "to_be_sure": cause.deciding_test or None,
        "remedy": cause.remedy or None,
    }
    return _cited(facts, statement, cause.frames)


def _finding(facts: CaptureFacts, row: FindingRow) -> dict[str, Any]:
    shown: list[FindingRow | FindingGroup] = [row, *row.groups]
    frames = [each.index for each in shown if each.index is not None]
    octets = [each.start for each in shown if each.index is None and each.start >= 0]
    statement = {
        "finding": row.code,
        "severity": row.severity,
        "about": None if frames or octets else "bus",
        "count": row.count,
        "units": list(row.units),
        "text": row.text,
        "explained_by": list(row.explained_by) or None,
    }
    return _cited(facts, statement, frames, octets)


def _unit(facts: CaptureFacts, row: UnitRow) -> dict[str, Any]:
    counts, all_of = row.counts, f"unit == {row.unit} and"
    numbers = {
        "requests": (counts.requests + counts.echoes, "request and not crc_ok == false"),
        "unanswered": (counts.unanswered, "unanswered"),
        "exceptions": (counts.exceptions, "exception"),
    }
    told = [{"what": name, "count": n, "all": f"{all_of} {what}"} for name, (n, what) in numbers.items() if n]
    times = {f"{name}_ms": row.times.worded(name) for name in ("p50", "p95", "max")} if row.times.count else {}
    return _cited(facts, {"unit": row.unit, "counts": told, **times}, facts.frames_of_unit(row.unit))


def _poll(row: PollRow) -> dict[str, Any]:
    return {
        "poll": {
            "unit": row.unit,
            "function": row.function,
            **({"address": row.address, "quantity": row.quantity} if row.quantity else {}),
        },
        "asked": row.asked,
        "good": row.ok,
        "period_ms": None if row.period_ns is None else round(row.period_ns / 1e6, 3),
    }


def _frame(facts: CaptureFacts, frame: Frame, *, fields: bool) -> dict[str, Any]:
    told = frame.fields()
    statement = {
        "frame": frame.index,
        "t_ns": frame.t_start_ns if facts.report.timed else None,
        "direction": frame.direction,
        "unit": frame.unit,
        "summary": _as_said(frame.summary(), told),
        "crc_ok": frame.crc_ok,
        "response_time_ns": frame.response_time_ns,
        "findings": [each.code for each in frame.findings] or None,
        "hex": _hex(frame.adu.data, fields),
        "fields": [_field(each) for each in told] if fields else None,
    }
    return _cited(facts, statement, (frame.index,))


def _pasted(sha256: str, frame: PastedFrame, number: int) -> dict[str, Any]:
    advice = frame.advice
    return {
        "frame": number,
        "direction": frame.role.name.lower(),
        "unit": frame.adu.unit,
        "summary": _as_said(frame.summary(), frame.fields()),
        "crc_ok": frame.check_ok,
        "bytes_missing": frame.missing or None,
        "problems": [each.problem for each in frame.fields() if each.problem] or None,
        "findings": [each.text for each in frame.findings] or None,
        "to_send": None if frame.to_send is None else frame.to_send.hex(),
        "reason": None if advice is None else advice.reason,
        "ask_instead": None if advice is None else [each.adu.hex() for each in advice.ask_instead],
        "hex": _hex(frame.adu.data, True),
        "cite": citation(sha256, (number,)),
    }


def _hex(data: bytes, whole: bool) -> str:
    return cut(data.hex(), _LONG_HEX if whole else _HEX)


def _as_said(text: str, fields: Sequence[Field]) -> str:
    """A frame in words; untrusted where the sender's own characters are among them."""
    return Untrusted(text) if any(map(_holds_text, fields)) else text


def _holds_text(field: Field) -> bool:
    return (isinstance(field.value, str) and field.value != field.raw) or any(map(_holds_text, field.fields))


def _field(field: Field) -> dict[str, Any]:
    return {"name": field.name, "at": field.start, "text": _as_said(field.text, (field,)), "problem": field.problem}


def _register(facts: CaptureFacts, value: RegisterValue) -> dict[str, Any]:
    seen = {"min": value.minimum, "max": value.maximum, "last": value.last}
    statement = {
        "unit": value.unit,
        "area": value.area,
        "address": value.address,
        "words": value.words,
        "type": value.type if value.kind not in ("constant", "unknown") else value.kind,
        "order": value.order,
        "role": value.role,
        "confidence": round(value.confidence, 3),
        "name": None if value.name is None else Untrusted(value.name),
        "unit_of_measure": None if value.unit_of_measure is None else Untrusted(value.unit_of_measure),
        "scale": value.scale,
        **{name: Untrusted(each) if isinstance(each, str) else each for name, each in seen.items()},
    }
    frames = facts.frames_of_register(value.unit, value.area, value.address, value.words)
    return _cited(facts, statement, frames)


def _value(held: Sequence[int], type: ValueType, order: Order) -> float | int | None:
    if type[0] != "f":
        return integer(held, order, signed=type[0] == "s")
    number = floating(held, order)
    return number if np.isfinite(number) else None
