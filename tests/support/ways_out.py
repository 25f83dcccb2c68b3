"""One capture through every way out of the product, each boiled down to the same facts, to be compared.

A fact is what any view may tell of a row: what it is, where it stands, whom it answers, how soon, and which findings
stand on it. Views tell different parts of it; each way here gives what it tells, by (port, start).
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import orjson
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from analyzer.analysis import Analysis
from analyzer.deframing.protocols import Deframer
from analyzer.exports import ExportOptions, export
from analyzer.live import Replay, Session
from analyzer.model.bus import Bus
from analyzer.model.scope import Scope, ScopedFigures
from analyzer.model.selection import compiled
from analyzer.model.source import CaptureSource
from analyzer.reports.model import Report
from analyzer.tables.batch import Batch, Frame
from analyzer.tables.columns import decode
from analyzer.tables.findings import Finding, described
from analyzer.tables.schema import Kind
from analyzer.tables.values import confirmed_values
from captures.chunks import Capture


class RowFacts(NamedTuple):
    """What there is to say of a row; None where this way out does not tell it."""

    kind: str  # request, response or noise
    length: int
    unit: int | None
    function: int | None
    request_start: int | None
    taken_for_start: int | None
    unsure: bool
    response_time_ns: tuple[int, int] | None  # between what it lies, twice the same where it is exact
    findings: tuple[str, ...]  # codes, sorted


Facts = dict[tuple[int, int], RowFacts]  # by port and start


def of_batches(batches: Iterable[Batch]) -> Facts:
    """The rows as `Analysis.analysed` gives them: the measure of all others."""
    facts: Facts = {}
    for batch in batches:
        for row in range(len(batch)):
            frame = batch.frame(row)
            facts[frame.port, frame.start] = _of_frame(frame, frame.row.kind == Kind.NOISE, batch.findings_of(row))
    return facts


def _of_frame(frame: Frame, noise: bool, findings: Iterable[Finding]) -> RowFacts:
    return RowFacts(
        "noise" if noise else frame.direction,
        frame.length,
        None if noise else frame.unit,
        None if noise else frame.function,
        None if noise else frame.request_start,
        None if noise else frame.taken_for_start,
        not noise and frame.unsure,
        None if noise else frame.response_time_bounds_ns,
        tuple(sorted(finding.code for finding in findings)),
    )


def of_bus(analysis: Analysis) -> Counter[str]:
    """Codes of the findings about the bus as a whole."""
    return Counter(finding.code for finding in analysis.findings() if finding.start < 0)


def json_lines(capture: Capture, folder: Path) -> Facts:
    """`export --format jsonl --noise`."""
    out = folder / "out.jsonl"
    export(capture, out, options=ExportOptions(noise=True))
    return {(line.get("port", 0), line["start"]): _of_json(line) for line in map(orjson.loads, out.open("rb"))}


def _of_json(line: Mapping[str, Any]) -> RowFacts:
    return RowFacts(
        line.get("direction", "noise"),
        line["length"],
        line.get("unit"),
        line.get("function"),
        line.get("request_start"),
        line.get("taken_for_start"),
        line.get("unsure", False),
        _bounds(line),
        tuple(sorted(finding["code"] for finding in line["findings"])),
    )


def csv_table(capture: Capture, folder: Path) -> Facts:
    """`export --format csv --noise`."""
    out = folder / "out.csv"
    export(capture, out, options=ExportOptions(noise=True))
    facts: Facts = {}
    for row in csv.DictReader(io.StringIO(out.read_text(encoding="utf-8-sig"))):
        codes = re.findall(r"(?:^'?|; )([a-z]+(?:-[a-z]+)*): ", row["findings"])
        number = {key: int(row[key]) if row[key] else None for key in row if row[key] is not None and _is_int(row[key])}
        facts[number["port"] or 0, number["start"] or 0] = RowFacts(
            row["direction"] or "noise",
            number["length"] or 0,
            number.get("unit"),
            number.get("function"),
            number.get("request_start"),
            number.get("taken_for_start"),
            row["unsure"] == "true",
            _bounds(number),
            tuple(sorted(codes)),
        )
    return facts


def _is_int(text: str) -> bool:
    return text == "" or text.lstrip("-").isdigit()


def arrow_rows(capture: Capture) -> Facts:
    """`to_arrow(noise=True)`, which polars, pandas and Parquet share."""
    return _of_table(Analysis(capture).to_arrow(noise=True))


def parquet_rows(capture: Capture, folder: Path) -> Facts:
    """`export --format parquet --noise`, read back."""
    import pyarrow.parquet as pq

    out = folder / "out.parquet"
    export(capture, out, options=ExportOptions(noise=True))
    return _of_table(pq.read_table(out))


def _of_table(table: Any) -> Facts:
    rows: list[Mapping[str, Any]] = table.drop_columns(["t_start_ns", "t_end_ns"]).to_pylist()
    return {
        (row["port"], row["start"]): RowFacts(
            row["direction"] or "noise",
            row["length"],
            row["unit"],
            row["function"],
            row["request_start"],
            row["taken_for_start"],
            bool(row["unsure"]),
            _bounds(row),
            tuple(sorted(row["findings"])),
        )
        for row in rows
    }


def _bounds(row: Mapping[str, Any]) -> tuple[int, int] | None:
    exact, low, high = (row.get(f"response_time_{name}ns") for name in ("", "low_", "high_"))
    if exact is not None:
        assert low in (None, exact) and high in (None, exact)
        return int(exact), int(exact)
    return None if low is None or high is None else (int(low), int(high))


def mcap_findings(capture: Capture, folder: Path) -> tuple[Counter[str], int]:
    """Codes on the findings' topic of an exported MCAP, and findings counted on frames."""
    out = folder / "out.mcap"
    export(capture, out, options=ExportOptions(noise=True))
    codes: Counter[str] = Counter()
    counted = 0
    with out.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message in reader.iter_messages(topics=["/findings"]):
            assert schema is not None
            if channel.message_encoding == "json":
                codes[orjson.loads(message.data)["name"]] += 1
            else:
                codes[reader_of(schema, channel, message).name] += 1
        for _, channel, _, frame in reader.iter_decoded_messages(topics=["/frames"]):
            assert channel.topic == "/frames"
            counted += frame.findings
    return codes, counted


def reader_of(schema: Any, channel: Any, message: Any) -> Any:
    """A protobuf message decoded by the schema in its file."""
    decode_message = DecoderFactory().decoder_for(channel.message_encoding, schema)
    assert decode_message is not None
    return decode_message(message.data)


def _model(capture: Capture) -> Bus:
    source = CaptureSource(capture, "bus")
    bus = Bus.of(source)
    for analysed in source.steps(lambda: False):
        bus.feed(analysed)
    bus.close()
    return bus


def model_rows(capture: Capture) -> tuple[Facts, Counter[str]]:
    """The interface's model, and the codes of findings that it shows on no row."""
    bus = _model(capture)
    facts: Facts = {}
    for row in range(bus.count):
        frame = bus.frame(row)
        facts[frame.port, frame.start] = _of_frame(frame, bool(bus.is_noise(row)), bus.findings(row))
    placeless = Counter(bus.found.finding(i).code for i in range(bus.found.count) if bus.found.row(i) < 0)
    return facts, placeless


def model_page(capture: Capture, filter: str = "") -> Report:
    """What the interface shows as its report, of all rows or of what a filter leaves."""
    bus = _model(capture)
    if not filter:
        return bus.report(CaptureSource(capture, "bus"), story=True)
    rows, _ = Scope(compiled(filter, capture.line)).selections(bus)
    assert rows is not None
    rows.extend()
    return ScopedFigures(bus, rows.rows()).report(CaptureSource(capture, "bus"))


def model_values(capture: Capture) -> dict[tuple[int, int, int], tuple[int, int | None]]:
    """Newest and former value of each register (unit, area, address) in the interface's list."""
    bus = _model(capture)
    return {(r.unit, r.area + 1, r.address): (r.value, r.before) for r in bus.registers.all()}


def stream_values(batches: Iterable[Batch]) -> dict[tuple[int, int, int], tuple[int, int | None]]:
    """The same from the batches' confirmed values, one by one."""
    newest: dict[tuple[int, int, int], tuple[int, int | None]] = {}
    for batch in batches:
        confirmed = confirmed_values(batch, decode(batch))
        areas = confirmed.area.repeat(confirmed.counts).tolist()
        for area, row, address, value in zip(areas, *(part.tolist() for part in confirmed.spread()), strict=True):
            key = (int(batch.rows.unit[row]), area, address)
            newest[key] = (value, newest[key][0] if key in newest else None)
    return newest


def replayed(capture: Capture, speed: float | None) -> tuple[Facts, Counter[str]]:
    """A session over a replay: rows with the findings that came with them or later, and those about the bus.

    What times are worth shows little by little: see `without_times`.
    """
    facts: Facts = {}
    late: list[tuple[int, int, str]] = []
    bus: Counter[str] = Counter()
    with Session(Replay(capture, speed)) as session:
        for step in session.steps():
            for key, row in of_batches([step.batch]).items():
                facts[key] = row._replace(findings=())
            for finding in described(step.findings):
                if finding.start < 0:
                    bus[finding.code] += 1
                else:
                    late.append((finding.port, finding.start, finding.code))
    starts = sorted(facts)
    for port, start, code in late:
        key = max(key for key in starts if key <= (port, start))
        row = facts[key]
        facts[key] = row._replace(findings=tuple(sorted((*row.findings, code))))
    return facts, bus


def fed_by_bytes(capture: Capture) -> Facts:
    """The public `Deframer`, fed chunk by chunk; it tells no findings."""
    deframer = Deframer(capture.line)
    batches = [deframer.feed(chunk) for chunk in capture.chunks()]
    return of_batches([*batches, deframer.close()])


def without_times(facts: Facts) -> Facts:
    """The same rows, nothing said of response times."""
    return {key: row._replace(response_time_ns=None) for key, row in facts.items()}


def without_findings(facts: Facts) -> Facts:
    """The same rows, nothing said of findings."""
    return {key: row._replace(findings=()) for key, row in facts.items()}


def codes_in(facts: Facts) -> Counter[str]:
    """How often each finding stands on a row."""
    return Counter(code for row in facts.values() for code in row.findings)
