"""Every way out tells the same: frames, directions, pairs, response times, findings with their rows, load, values."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import orjson
import pytest
import ways_out
from buses import LINE, adu, spaced
from waves import drifting_bus

from analyzer.analysis import Analysis
from analyzer.checks import compile_check
from analyzer.checks import run as run_checks
from analyzer.exports import ExportOptions, export
from analyzer.filters import compile_filter
from analyzer.reports import summarize, text
from analyzer.simulation import Scenario, simulate
from analyzer.simulation.defects import defects
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import lrc

pytest.importorskip("pyarrow")

READ, ANSWER = adu("1103006b0003"), adu("110306ae415652434 0".replace(" ", ""))


def ascii_bus(stray: bytes = b"") -> Capture:
    """A bus in ASCII mode, with some bytes before it."""
    lines = []
    for body in ("1103006B0003", "110306AE4156524340") * 6:
        data = bytes.fromhex(body)
        lines.append(b":" + (data + bytes([lrc(data)])).hex().upper().encode() + b"\r\n")
    return Capture.of(LINE, spaced([stray, *lines] if stray else lines))


def two_ports() -> Capture:
    """Requests on one port, answers on the other."""
    chunks = []
    for number in range(8):
        now = 1_000_000_000 + number * 60_000_000
        chunks += [Chunk(now, READ, port=0), Chunk(now + 20_000_000, ANSWER, port=1)]
    return Capture.of(LINE, chunks)


def written_twice() -> Capture:
    """A register written 5, then 7."""
    pieces = [adu("110600010005")] * 2 + [adu("110600010007")] * 2
    return Capture.of(LINE, spaced(pieces))


@cache
def simulated(defect: str | None, tap: str) -> Capture:
    bus = simulate(Scenario("clean", tap, transactions=60, seed=3, defect=defect))
    return Capture.of(bus.line, bus.chunks)


def unknown_character() -> Capture:
    """A healthy bus whose header does not say how long a character is."""
    bus = simulated(None, "precise")
    return Capture.of(LineSettings(baud=bus.line.baud, tap=bus.line.tap), bus.chunks())


CASES: dict[str, Callable[[], Capture]] = {
    **{code: partial(simulated, code, defects()[code].taps[0]) for code in sorted(defects())},
    "healthy": lambda: simulated(None, "precise"),
    "healthy behind 16 ms": lambda: simulated(None, "ftdi16"),
    "untimed": lambda: simulated(None, "untimed"),
    "two ports": two_ports,
    "ascii": ascii_bus,
    "ascii behind a stray byte": lambda: ascii_bus(b"\xff"),
    "unknown character length": unknown_character,
    "written twice": written_twice,
}


@cache
def made(name: str) -> Capture:
    return CASES[name]()


@pytest.fixture(params=sorted(CASES))
def capture(request: pytest.FixtureRequest) -> Capture:
    return made(request.param)


@cache
def measure(capture: Capture) -> ways_out.Facts:
    return ways_out.of_batches(analysed.batch for analysed in Analysis(capture).analysed())


def test_every_finding_stands_on_a_row_or_on_the_bus(capture: Capture) -> None:
    findings = list(Analysis(capture).findings())
    on_rows = ways_out.codes_in(measure(capture))
    assert on_rows + ways_out.of_bus(Analysis(capture)) == Counter(finding.code for finding in findings)


def test_files_tell_the_same(capture: Capture, tmp_path: Path) -> None:
    facts = measure(capture)
    assert ways_out.json_lines(capture, tmp_path) == facts
    assert ways_out.csv_table(capture, tmp_path) == facts
    assert ways_out.arrow_rows(capture) == facts
    assert ways_out.parquet_rows(capture, tmp_path) == facts


def test_mcap_tells_the_same(capture: Capture, tmp_path: Path) -> None:
    facts = measure(capture)
    codes, counted = ways_out.mcap_findings(capture, tmp_path)
    assert codes == ways_out.codes_in(facts) + ways_out.of_bus(Analysis(capture))
    assert counted == sum(len(row.findings) for row in facts.values() if row.kind != "noise")


def test_pcapng_carries_each_finding(capture: Capture, tmp_path: Path) -> None:
    out = tmp_path / "out.pcapng"
    export(capture, out, options=ExportOptions(noise=True))
    data = out.read_bytes()
    for analysed in Analysis(capture).analysed():
        for row in range(len(analysed.batch)):
            for finding in analysed.batch.findings_of(row):
                assert finding.text.encode() in data


def test_filters_find_what_the_rows_carry(capture: Capture, tmp_path: Path) -> None:
    facts = measure(capture)
    for code in ways_out.codes_in(facts):
        out = tmp_path / f"{code}.jsonl"
        wanted = compile_filter(f'finding == "{code}"')
        export(capture, out, options=ExportOptions(noise=True, filter=wanted))
        lines = [orjson.loads(line) for line in out.open("rb")]
        passed = {(line.get("port", 0), line["start"]) for line in lines}
        assert passed == {key for key, row in facts.items() if code in row.findings}


def test_report_counts_the_same(capture: Capture) -> None:
    facts = measure(capture)
    report = summarize(capture)
    counted = {row.code: row.count for row in report.findings}
    assert counted == dict(ways_out.codes_in(facts) + ways_out.of_bus(Analysis(capture)))
    kinds = Counter(row.kind for row in facts.values())
    assert (report.requests, report.responses) == (kinds["request"], kinds["response"])
    units = {row.unit: row.counts for row in report.units_as_heard}
    for card in report.cards:
        counts = units[card.unit]
        told = (card.answered, card.exceptions, card.silent, card.late)
        assert told == (counts.answered, counts.exceptions, counts.unanswered, counts.late)
    page = text(report)
    for code in counted:
        assert re.search(rf"\b{code}\b", page)


def test_the_interface_tells_the_same(capture: Capture) -> None:
    facts, placeless = ways_out.model_rows(capture)
    assert facts == measure(capture)
    assert placeless == ways_out.of_bus(Analysis(capture))


def test_the_interface_s_page_is_the_report(capture: Capture) -> None:
    """Line for line, causes and all."""
    page = text(ways_out.model_page(capture))
    assert page == text(summarize(capture, source="bus"))


def test_values_are_told_once(capture: Capture) -> None:
    batches = [analysed.batch for analysed in Analysis(capture).analysed()]
    assert ways_out.model_values(capture) == ways_out.stream_values(batches)


def test_a_replay_tells_the_same(capture: Capture) -> None:
    facts, bus = ways_out.replayed(capture, None)
    assert ways_out.without_times(facts) == ways_out.without_times(measure(capture))
    assert bus == ways_out.of_bus(Analysis(capture))


def test_the_public_deframer_gives_the_same_rows(capture: Capture) -> None:
    facts = ways_out.without_findings(measure(capture))
    assert ways_out.without_times(ways_out.fed_by_bytes(capture)) == ways_out.without_times(facts)


def test_checks_count_the_same(capture: Capture) -> None:
    facts = measure(capture)
    results = run_checks(capture, [compile_check(f"no {code}") for code in sorted(ways_out.codes_in(facts))])
    assert not any(outcome.passed for outcome in results.outcomes)


def test_a_register_written_5_then_7_was_5_before() -> None:
    assert ways_out.model_values(written_twice())[0x11, 4, 1] == (7, 5)


def test_a_load_is_unknown_everywhere_or_nowhere() -> None:
    capture = unknown_character()
    report = summarize(capture)
    assert report.load.mean is None
    assert "load unknown" in " ".join(text(report).split()) or "load      unknown" in text(report)
    assert "of the time, and the client pauses for only" not in text(report)


@pytest.mark.parametrize("filter", ["", "unit == 3"])
def test_the_interface_tells_of_senders_clocks_what_the_report_does(tmp_path: Path, filter: str) -> None:
    capture = drifting_bus(tmp_path / "bus.vcd")
    told = summarize(capture, filter=compile_filter(filter) if filter else None).rates
    assert len(told) == (2 if filter else 3)
    assert ways_out.model_page(capture, filter).rates == told
