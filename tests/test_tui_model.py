"""The model behind the views holds what the analysis says, in any piece of it that is asked for."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import datetime, timedelta, timezone, tzinfo
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from carried import values_of
from google.protobuf.json_format import MessageToDict
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import analyzer
import captures
from analyzer import words
from analyzer.causes.registry import SYMPTOM_OF
from analyzer.core import Analysed
from analyzer.exports import export
from analyzer.model import search
from analyzer.model.activity import _octets_by_bin
from analyzer.model.bus import Bus
from analyzer.model.narrow import AlikeNumbers, BesideNumbers, NarrowNumbers, ShortTimes
from analyzer.model.polls import changed
from analyzer.model.registers import RegisterSeries
from analyzer.model.rowstores import ByteStore, by_cause
from analyzer.model.scope import ScopedFigures
from analyzer.model.selection import Everything, Selection, frames_only, in_span, transactions
from analyzer.model.source import CaptureSource
from analyzer.model.table import PIECE, BusRows, RowTable
from analyzer.model.times import GotoError
from analyzer.simulation import Scenario, simulate
from analyzer.tables.batch import Batch, Frame
from analyzer.tables.findings import Severity, codes
from analyzer.tables.schema import NO_GAP, Kind
from analyzer.tui.picking import save
from analyzer.usernotes import Notes, NotesError
from analyzer.words import (
    UNITS_NS,
    between,
    date_and_time,
    duration,
    pointed_ms,
    seconds,
    short,
    short_bound,
    time_of_day,
    zone_name,
)
from captures import samples
from captures.chunks import Capture


def read(capture: Capture, *, each: int = 0) -> Bus:
    """The model of a capture, its rows fed as they come or `each` at a time."""
    source = CaptureSource(capture, "bus")
    bus = Bus.of(source)
    for analysed in source.steps(lambda: False):
        if each:
            for part in cut(analysed.batch, each):
                bus.feed(replace(Analysed.nothing(), batch=part))
            analysed = replace(analysed, batch=Batch.empty())
        bus.feed(analysed)
    bus.close()
    return bus


def cut(batch: Batch, each: int) -> Iterator[Batch]:
    """A batch in batches of some rows, requests from before them in `earlier`."""
    for first in range(0, len(batch), each):
        rows = batch.rows[first : first + each]
        asked = {int(rows.request[i]): first + i for i in range(len(rows)) if rows.request[i] >= 0}
        own = set(rows.index.tolist())
        earlier = {i: batch.request_of(row, i) or b"" for i, row in asked.items() if i not in own}
        why = None if batch.evidence is None else batch.evidence[first : first + each]
        yield replace(batch, rows=rows, earlier=earlier, evidence=why)


@pytest.fixture(scope="module")
def troubled() -> Bus:
    return read(captures.open(samples.path("troubled.jsonl")))


@pytest.fixture(scope="module")
def brutal() -> Capture:
    made = simulate(Scenario("brutal", "precise", transactions=150, seed=5))
    return Capture.of(made.line, made.chunks)


def frames_of(bus: Bus) -> list[Frame]:
    return [bus.frame(row) for row in range(bus.count) if not bus.is_noise(row)]


def without_findings(frame: Frame) -> dict[str, object]:
    return {key: value for key, value in frame.to_json().items() if key != "findings"}


@pytest.mark.parametrize("each", [0, 1, 7])
def test_rows_of_the_model_are_those_of_the_analysis(brutal: Capture, each: int) -> None:
    bus = read(brutal, each=each)
    known = analyzer.Analysis(brutal)
    rows = known.rows()
    assert bus.count == len(rows)
    assert bus.frames == int((rows.kind != Kind.NOISE).sum())
    assert b"".join(bus.captured(row) for row in range(bus.count)) == b"".join(
        batch.data.tobytes() for batch in known.batches()
    )
    assert [without_findings(frame) for frame in frames_of(bus)] == [without_findings(f) for f in known.frames()]


def test_findings_of_the_model_are_those_of_the_pipeline(brutal: Capture) -> None:
    from analyzer.core import analyse

    expected = [
        [finding.code for finding in analysed.batch.findings_of(row)]
        for analysed in analyse(brutal)
        for row in range(len(analysed.batch))
    ]
    bus = read(brutal)
    assert [sorted(f.code for f in bus.findings(row)) for row in range(bus.count)] == [
        sorted(codes) for codes in expected
    ]
    assert any(expected)
    assert sum(bus.found.by_code.values()) == bus.found.count == sum(bus.found.by_severity.values())


def test_a_request_and_its_answer_know_each_other(troubled: Bus) -> None:
    for row in range(troubled.count):
        partner = troubled.partner(row)
        if troubled.is_noise(row):
            assert partner is None
        elif partner is not None and troubled.frame(row).row.request >= 0:
            assert troubled.frame(partner).index == troubled.frame(row).row.request
            assert troubled.partner(partner) is not None


def test_a_batch_of_any_rows_reads_like_the_rows(troubled: Bus) -> None:
    chosen = np.arange(3, troubled.count, 2)
    batch = troubled.batch(chosen)
    for place, row in enumerate(chosen.tolist()):
        assert batch.bytes_of(place) == troubled.captured(row)
        if not troubled.is_noise(row):
            assert batch.frame(place).to_json() == troubled.frame(row).to_json()


@pytest.mark.parametrize("each", [0, 1, 5])
def test_registers_are_the_newest_values_that_frames_carry(each: int) -> None:
    capture = captures.open(samples.path("healthy.jsonl"))
    bus = read(capture, each=each)
    expected: dict[tuple[int, str, str], list[int]] = {}
    for frame in analyzer.Analysis(capture).frames():
        values = values_of(frame, frame.fields())
        for name, value in (values.numbers if values else {}).items():
            expected.setdefault((frame.unit, values.area if values else "", name), []).append(value)
    areas = ("coils", "discrete", "input", "holding")
    found = bus.registers.all()
    assert {(r.unit, areas[r.area], f"{'b' if r.area < 2 else 'r'}{r.address}"): r.value for r in found} == {
        key: values[-1] for key, values in expected.items()
    }
    for register in found[:: max(1, len(found) // 10)]:
        name = f"{'b' if register.area < 2 else 'r'}{register.address}"
        past = expected[register.unit, areas[register.area], name]
        series = RegisterSeries(register.unit, register.area, register.address).extend(bus)
        assert series.readings()[2][:, 0].tolist() == past
        assert register.before == (past[-2] if len(past) > 1 else None)


@pytest.mark.parametrize("each", [0, 1, 5])
def test_how_registers_went_is_their_newest_value_in_each_stretch_of_the_capture(each: int) -> None:
    bus = read(captures.open(samples.path("healthy.jsonl")), each=each)
    found = bus.registers.all()
    read_at = {r: RegisterSeries(r.unit, r.area, r.address).extend(bus).readings()[1:] for r in found}
    first, last = (edge(int(edge(rows)) for rows, _ in read_at.values()) for edge in (min, max))
    stretch = 1
    while last - first >= 32 * stretch:
        stretch *= 2
    assert stretch > 1
    for register, (rows, values) in read_at.items():
        newest = dict(zip(((rows - first) // stretch).tolist(), values[:, 0].tolist(), strict=True))
        told = [newest[max(n for n in newest if n <= i)] for i in range(min(newest), max(newest) + 1)]
        begin, stood = bus.registers.samples(register.unit, register.area, register.address, 1)
        assert (begin, stood[:, 0].tolist()) == (min(newest), told)
    assert bus.registers.stretches == (last - first) // stretch + 1
    unit, area, address = found[-1].unit, found[-1].area, found[-1].address
    assert len(bus.registers.samples(unit, area, address + 1, 1)[1]) == 0


def test_selections_hold_the_rows_that_pass_whenever_they_are_asked(troubled: Bus) -> None:
    for test in (frames_only, transactions, in_span(troubled.t_first, troubled.t_first + 3_000_000_000)):
        selection = Selection(troubled, test)
        assert selection.extend()
        passed = np.flatnonzero(test(troubled, 0, 0, troubled.count))
        assert selection.rows().tolist() == passed.tolist()
        assert [selection.row(i) for i in range(selection.count)] == passed.tolist()
        for row in range(troubled.count):
            before = passed[passed <= row]
            assert selection.position(row) == max(0, len(before) - 1)
    assert Everything(troubled).position(10**9) == troubled.count - 1


@given(st.lists(st.integers(1, 700_000), max_size=6), st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), max_size=4))
@settings(max_examples=40, deadline=None)
def test_bytes_are_kept_whatever_the_pieces(sizes: list[int], shares: list[tuple[float, float]]) -> None:
    whole = np.arange(sum(sizes), dtype=np.uint32).astype(np.uint8)
    store, at = ByteStore(), 0
    for size in sizes:
        assert store.append(whole[at : at + size]) == at
        at += size
    for begin, share in shares:
        first = int(begin * at)
        length = int(share * (at - first))
        assert (store.get(first, length) == whole[first : first + length]).all()


def test_a_table_over_several_pieces() -> None:
    table, n = RowTable(), 3 * PIECE + 17
    kinds = np.ones(n, np.uint8)
    kinds[5::9] = 0
    made = BusRows.zeros(n)
    made.kind[:], made.frame[:] = kinds, np.cumsum(kinds > 0) - (kinds > 0)
    made.start[:] = made.t_start_ns[:] = np.arange(n) * 10
    made.length[:] = 4
    for first in range(0, n, 50_000):
        table.append(made[first : first + 50_000])
    frames = np.flatnonzero(kinds)
    some = np.concatenate((np.arange(0, len(frames), 9973), [len(frames) - 1, len(frames), -1]))
    rows = [int(frames[i]) if 0 <= i < len(frames) else -1 for i in some.tolist()]
    assert table.rows_of_frames(some).tolist() == rows
    assert [table.row_of_frame(int(i)) for i in some.tolist() if i >= 0] == rows[:-1]
    for row in (0, 1, PIECE - 1, PIECE, 2 * PIECE + 5, n - 1):
        assert table.row_at_time(row * 10 + 3) == row
        assert table.row_of_byte(0, row * 10) == table.row_of_byte(0, row * 10 + 3) == row
    assert table.row_of_byte(0, 7) == table.row_of_byte(1, 10) == table.row_of_byte(0, -1) == -1
    assert table.rows_of_bytes(np.zeros(3, np.uint8), np.array([n * 10, 10 * PIECE, -1])).tolist() == [-1, PIECE, -1]
    assert sum(high - low for _, low, high in table.slices(10, n - 10)) == n - 20


@pytest.mark.parametrize(
    ("wire", "defect", "tap"),
    [("clean", "flow-control-loss", "ftdi16"), ("clean", "noise", "precise"), ("clean", "collision", "precise"),
     ("brutal", None, "irq"), ("glitch", None, "precise")],
)  # fmt: skip
def test_every_finding_on_a_row_is_marked_there_and_can_be_jumped_to(wire: str, defect: str | None, tap: str) -> None:
    made = simulate(Scenario(wire, tap, transactions=160, seed=7, defect=defect))
    source = CaptureSource(Capture.of(made.line, made.chunks), "bus")
    bus = Bus.of(source)
    for step in source.steps(lambda: False):
        bus.feed(step)
    table, found = bus.table, bus.found
    spans = [(table.value("port", r), table.value("start", r), table.value("length", r)) for r in range(bus.count)]
    standing: set[int] = set()
    for number in range(found.count):
        finding, row = found.finding(number), found.row(number)
        if finding.start < 0:
            assert row == -1
            continue
        port, start, length = spans[row]
        assert row >= 0 and port == finding.port and start <= finding.start < start + length, finding
        assert finding in bus.findings(row) and table.value("mark", row) >= finding.severity
        standing.add(row)
    hits = search.with_findings(Everything(bus))
    assert hits(bus, 0, bus.count).tolist() == sorted(standing) and standing
    last = max(standing)
    assert search.find(bus, hits, last) is None
    assert search.find(bus, hits, last, back=True) == max(standing - {last})
    frames = Selection(bus, frames_only)
    frames.extend()
    some = search.with_findings(frames)(bus, 0, bus.count).tolist()
    assert some == [row for row in sorted(standing) if not bus.is_noise(row)]


@pytest.mark.parametrize("tap", ["precise", "irq", "ftdi16", "gateway"])
def test_response_times_of_the_model_are_those_of_the_report(tap: str) -> None:
    made = simulate(Scenario("clean", tap, transactions=200, seed=5))
    capture = Capture.of(made.line, made.chunks)
    bus, source = read(capture), CaptureSource(capture, "bus")
    due = analyzer.Analysis(capture).report()
    whole = ScopedFigures(bus, np.arange(bus.table.count))
    for found in (bus.report(source), whole.report(source)):
        assert found.times == due.times
        assert [unit.times for unit in found.units] == [unit.times for unit in due.units]


def test_causes_are_those_of_the_analysis(troubled: Bus) -> None:
    assert troubled.causes() == analyzer.open(samples.path("troubled.jsonl")).causes() != []


def test_an_answer_is_compared_with_the_one_to_the_same_poll(troubled: Bus) -> None:
    compared = differing = 0
    for row in range(troubled.count):
        before = troubled.polls.before(row)
        if before is None:
            continue
        compared += 1
        one, other = troubled.partner(row), troubled.partner(before)
        assert before < row and one is not None and other is not None and one != other
        assert troubled.captured(one) == troubled.captured(other)
        mine, old = troubled.frame(row), troubled.frame(before)
        pairs = list(changed(old.fields(), mine.fields()))
        differing += bool(pairs)
        told = {i for _, new in pairs for i in range(new.start, new.start + new.length)}
        body = range(2, len(mine.adu.data) - 2)
        assert {i for i in body if mine.adu.data[i] != old.adu.data[i]} <= told
    assert compared > 10 and differing


def test_search_finds_bytes_text_and_values(troubled: Bus) -> None:
    def all_hits(hits: search.Hits) -> list[int]:
        found, row = [], -1
        while (hit := search.find(troubled, hits, row)) is not None:
            found.append(hit)
            row = hit
        back, row = [], troubled.count
        while (hit := search.find(troubled, hits, row, back=True)) is not None:
            back.append(hit)
            row = hit
        assert back[::-1] == found
        return found

    rows = range(troubled.count)
    assert all_hits(search.for_bytes("0x00,0x6B")) == [r for r in rows if b"\x00\x6b" in troubled.captured(r)]
    words = [r for r in rows if not troubled.is_noise(r) and "discrete" in troubled.frame(r).summary()]
    assert set(words) <= set(all_hits(search.for_text("Discrete")))
    assert all_hits(search.for_text("noise")) == [
        r for r in rows if troubled.is_noise(r) or _says(troubled, r, "noise")
    ]
    unit = [r for r in rows if not troubled.is_noise(r) and troubled.table.value("unit", r) == 17]
    assert unit and set(unit) <= set(all_hits(search.for_text("Unit 17")))
    for code in troubled.found.by_code:
        marked = [r for r in rows if code in {each.code for each in troubled.findings(r)}]
        assert set(marked) <= set(all_hits(search.for_text(code))), code
    carried = all_hits(search.for_value("674"))
    assert carried and all(b"\x02\xa2" in troubled.captured(row) for row in carried)
    for make, wrong in ((search.for_bytes, "zz"), (search.for_text, " "), (search.for_value, "70000"),
                        (search.for_value, "x"), (search.for_value, "inf")):  # fmt: skip
        with pytest.raises(search.SearchError):
            make(wrong)


def _says(bus: Bus, row: int, words: str) -> bool:
    """Whether a finding of a row does."""
    return any(words in f"{each.code} {each.text}".casefold() for each in bus.findings(row))


@pytest.mark.parametrize("order", ["ABCD", "CDAB", "BADC", "DCBA"])
def test_search_finds_floats_in_every_order(order: str) -> None:
    from buses import LINE
    from diagnosed import Wire, with_crc

    octets = dict(zip("ABCD", bytes.fromhex("43668000"), strict=True))  # 230.5
    pair = bytes(octets[c] for c in order)
    wire = Wire().polls(3)
    wire.exchange(with_crc("110300000003"), with_crc(f"1103060001{pair.hex()}"))
    bus = read(Capture.of(LINE, wire.chunks))
    assert search.find(bus, search.for_value("230.5"), -1) == bus.count - 1
    assert search.find(bus, search.for_value("231.5"), -1) is None


def test_go_to_takes_numbers_times_steps_and_shares(troubled: Bus) -> None:
    last = troubled.count - 1
    assert troubled.frame(search.row_named("12", troubled, 0)).index == 12
    assert search.row_named("100%", troubled, 0) == last
    row = search.row_named("5s", troubled, 0)
    assert troubled.table.value("t_start_ns", row) <= troubled.t_first + 5_000_000_000
    assert search.row_named("+10s", troubled, row) > row
    assert search.row_named("-1min", troubled, row) == 0
    assert search.row_named("08:29:55", troubled, 0) > 0
    for wrong in ("", "abc", "9999999", "25:00:00", "5 apples", "9" * 5000, "9" * 400 + "%", "9" * 400 + "s"):
        with pytest.raises(GotoError):
            search.row_named(wrong, troubled, 0)


def test_activity_counts_everything_once_near_and_far(troubled: Bus) -> None:
    size = sum(len(troubled.captured(row)) for row in range(troubled.count))
    near = troubled.activity.over(troubled, troubled.t_first, troubled.t_last + 1, 50)
    assert near.octets.sum() == size
    assert near.frames.sum() == troubled.frames
    far = troubled.activity._bins.tables["all"]
    assert far[0].sum() == size
    rows = np.arange(troubled.count)
    marks = troubled.table.take_column("mark", rows)
    silent = marks >= Severity.WARNING  # a request that nobody answers too, as in the report's chart
    assert near.troubles.sum() == far[2].sum() == silent.sum()
    assert (silent & troubled.table.take_column("check", rows)).any()


def test_units_take_their_bytes(troubled: Bus) -> None:
    octets = [0] * 256
    for frame in frames_of(troubled):
        octets[frame.unit] += frame.length
    assert troubled.units.octets.tolist() == octets
    assert troubled.units.means(1).size


def test_the_report_can_be_asked_for_again_and_again() -> None:
    capture = captures.open(samples.path("troubled.jsonl"))
    source = CaptureSource(capture, "troubled.jsonl")
    bus = read(capture)
    from analyzer.reports import summarize

    assert bus.report(source) == bus.report(source)
    expected = summarize(capture, source="troubled.jsonl")
    assert bus.report(source).transactions == expected.transactions


def test_findings_by_code_and_severity(troubled: Bus) -> None:
    log = troubled.found
    everything = log.chosen(None, Severity.NOTE)
    assert len(everything) == log.count
    for code, count in log.by_code.items():
        numbers = log.chosen(code, Severity.NOTE)
        assert len(numbers) == count
        assert {log.finding(int(i)).code for i in numbers} == {code}
    errors = log.chosen(None, Severity.ERROR)
    assert all(log.finding(int(i)).severity is Severity.ERROR for i in errors)
    rows = [log.row(int(i)) for i in everything]
    assert rows == sorted(rows)


def test_saving_all_rows_is_the_export(tmp_path: Path, troubled: Bus) -> None:
    capture = captures.open(samples.path("troubled.jsonl"))
    source = CaptureSource(capture, "x")
    assert save(troubled, source, np.arange(troubled.count), tmp_path / "saved.csv") == troubled.count
    from analyzer.exports import ExportOptions

    export(capture, tmp_path / "whole.csv", options=ExportOptions(noise=True))
    assert (tmp_path / "saved.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    some = np.array([1, 4, 5])
    save(troubled, source, some, tmp_path / "some.jsonl")
    lines = [json.loads(line) for line in (tmp_path / "some.jsonl").read_text().splitlines()]
    assert [line["index"] for line in lines] == [troubled.frame(int(row)).index for row in some]
    assert lines[0]["request_start"] is not None


@pytest.mark.parametrize("kept", [Kind.REQUEST, Kind.RESPONSE, None])
def test_a_saved_transaction_is_whole_whatever_is_chosen_of_it(
    tmp_path: Path, troubled: Bus, kept: Kind | None
) -> None:
    """Requests alone, answers alone, and both: what became of each is what the whole capture's export says."""
    capture = captures.open(samples.path("troubled.jsonl"))
    export(capture, tmp_path / "whole.mcap")
    save_to = tmp_path / "some.mcap"
    rows = np.array([i for i in range(troubled.count) if kept is None or troubled.table.value("kind", i) == kept])
    save(troubled, CaptureSource(capture, "x"), rows, save_to)
    whole, some = (messages_of(path, "/transactions") for path in (tmp_path / "whole.mcap", save_to))
    chosen = {troubled.frame(int(row)).index for row in rows if not troubled.is_noise(int(row))}
    assert some == [one for one in whole if chosen & {one.get("request", 0), one.get("response", -1)}]
    assert len(some) > 10
    assert len({one.get("status") for one in some}) > 1
    frames = messages_of(save_to, "/frames")
    on_frames = {row: len(troubled.findings(int(row))) for row in rows if not troubled.is_noise(int(row))}
    assert [frame.get("findings", 0) for frame in frames] == list(on_frames.values())


def messages_of(path: Path, topic: str) -> list[dict[str, Any]]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = [content for *_, content in reader.iter_decoded_messages(topics=[topic], log_time_order=False)]
    return [MessageToDict(one, preserving_proto_field_name=True, unquote_int64_if_possible=True) for one in found]


def test_notes_are_kept_beside_the_capture(tmp_path: Path) -> None:
    capture = tmp_path / "bus.jsonl"
    notes = Notes.beside(capture)
    assert notes.toggle((0, 12))
    notes.comment((1, 40), "pump <start>")
    notes.refer((0, 12))
    again = Notes.beside(capture)
    assert again == notes
    assert not again.toggle((0, 12))
    again.refer(None)
    assert Notes.beside(capture).comments == {(1, 40): "pump <start>"}
    assert [path.name for path in tmp_path.iterdir()] == ["bus.jsonl.rtuscope.json"]


_NOTED = '{"version": 1, "bookmarks": [%s]}'


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"version": 9}', _NOTED % "3", "\xff", "[" * 200_000, '{"version": ' + "9" * 5000 + "}",
     _NOTED % '{"port": 1e999, "start": 0}', _NOTED % '{"port": 0, "start": -1}', _NOTED % '{"start": 0}',
     _NOTED % '{"port": 0, "start": 9223372036854775808}', '{"version": 1, "bookmarks": {"a": 1}}',
     '{"version": 1, "bookmarks": [], "time_reference": {"port": 0, "start": 1.5}}'],
)  # fmt: skip
def test_foreign_notes_are_left_alone(tmp_path: Path, text: str) -> None:
    capture = tmp_path / "bus.jsonl"
    path = tmp_path / "bus.jsonl.rtuscope.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(NotesError, match=r"bus\.jsonl\.rtuscope\.json"):
        Notes.beside(capture)


def test_notes_that_are_no_file_never_keep_a_capture_from_opening(tmp_path: Path) -> None:
    capture = tmp_path / "bus.jsonl"
    (tmp_path / "bus.jsonl.rtuscope.json").mkdir()
    with pytest.raises(NotesError, match="is a directory"):
        Notes.beside(capture)
    if hasattr(os, "mkfifo"):  # elsewhere there are no pipes by name, and a name that is too long is not found
        with pytest.raises(NotesError, match="cannot be read"):
            Notes.beside(tmp_path / ("n" * 250))
        os.mkfifo(tmp_path / "pipe.jsonl.rtuscope.json")
        with pytest.raises(NotesError, match="a device, not a file"):
            Notes.beside(tmp_path / "pipe.jsonl")


def test_half_a_character_in_a_comment_is_kept_and_written_again(tmp_path: Path) -> None:
    capture = tmp_path / "bus.jsonl"
    Notes.beside(capture).comment((0, 0), "\ud800")
    notes = Notes.beside(capture)
    notes.toggle((0, 9))
    assert Notes.beside(capture).comments == {(0, 0): "\ud800", (0, 9): ""}


_keys = st.sampled_from(("version", "bookmarks", "port", "start", "comment", "time_reference"))
_anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.just(1),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_keys, inner),
)
_notes = st.dictionaries(_keys, st.integers() | st.text() | st.none())


@given(_anything | st.fixed_dictionaries({"version": st.just(1), "bookmarks": st.lists(_notes, max_size=3)}))
def test_any_notes_are_taken_or_left_alone(tmp_path_factory: pytest.TempPathFactory, known: object) -> None:
    capture = tmp_path_factory.getbasetemp() / "any.jsonl"
    path = capture.with_name(capture.name + ".rtuscope.json")
    path.write_text(json.dumps(known))
    with suppress(NotesError):
        notes = Notes.beside(capture)
        assert all(0 <= port < 256 and 0 <= start < 1 << 63 for port, start in notes.comments)
        notes.toggle((0, 0))
        assert Notes.beside(capture) == notes


@given(st.integers(-(10**18), 10**18))
def test_durations_fit_their_column(ns: int) -> None:
    assert len(short(ns)) <= 7
    assert abs(float(seconds(ns)) * 1e9 - ns) <= max(1000, abs(ns) * 1e-12)


@given(
    st.lists(st.one_of(st.integers(-1, 1 << 31), st.integers(-1, 1 << 62), st.just(NO_GAP)), min_size=1, max_size=40)
)
def test_short_times_give_what_was_put_in(times: list[int]) -> None:
    column = ShortTimes(len(times) + 1)
    column[: len(times)] = np.array(times, np.int64)
    assert column[: len(times)].tolist() == times
    assert column[: len(times)].dtype == np.int64
    column[np.array([0])] = times[-1]
    assert int(column[0]) == times[-1]
    assert column.nbytes == (8 if any(abs(t) >= 1 << 31 for t in times if t != NO_GAP) else 4) * (len(times) + 1)


@given(st.lists(st.one_of(st.integers(0, 3), st.integers(0, 1 << 20)), min_size=1, max_size=40))
def test_narrow_and_alike_numbers_give_what_was_put_in(numbers: list[int]) -> None:
    ascending, n = sorted(numbers), len(numbers)
    counted, lengths, ports = NarrowNumbers(n + 1), NarrowNumbers(n + 1, 0), AlikeNumbers(n + 1, np.dtype(np.uint8))
    for column, wanted, dtype in (
        (counted, [1 << 31 | each for each in ascending], np.uint32),
        (lengths, numbers, np.uint32),
        (ports, [each % 256 for each in numbers], np.uint8),
    ):
        half = n // 2
        column[:half] = np.array(wanted[:half], dtype)
        column[half:n] = np.array(wanted[half:], dtype)
        assert column[:n].tolist() == column[np.arange(n)].tolist() == wanted
        assert column[:n].dtype == dtype and int(column[n - 1]) == wanted[-1]
    assert counted.nbytes == (4 if ascending[-1] - ascending[0] > 0xFFFF else 2) * (n + 1)
    assert lengths.nbytes == (4 if max(numbers) > 0xFFFF else 2) * (n + 1)
    assert ports.nbytes <= n + 1


@given(st.data())
def test_alike_numbers_are_the_array_that_they_stand_for(data: st.DataObject) -> None:
    """Whatever is written where, in whatever pieces, also where it is written over, and read by whatever."""
    n = data.draw(st.integers(1, 60))
    dtype = data.draw(st.sampled_from([np.dtype(np.uint8), np.dtype(np.bool_), np.dtype(np.float32)]))
    base = np.cumsum(data.draw(st.lists(st.integers(0, 9), min_size=n, max_size=n)))
    alike, many = AlikeNumbers(n, dtype), AlikeNumbers(n, np.dtype(np.int64), lambda: ShortTimes(n))
    beside, other = BesideNumbers(n, base), base
    seldom = st.integers(0, 99).map(lambda drawn: drawn if drawn < data.draw(st.sampled_from([0, 5, 100])) else 0)
    plain, exact, beyond = np.zeros(n, dtype), np.zeros(n, np.int64), np.array(other, np.int64)
    done = 0
    while done < n:
        size = data.draw(st.integers(1, n - done))
        slots: Any = slice(done, done + size)
        values = np.array(data.draw(st.lists(seldom, min_size=size, max_size=size)))
        far = np.where(values > 50, NO_GAP, values * 10**9)
        alike[slots], many[slots], beside[slots] = values.astype(dtype), far, base[slots] + far
        plain[slots], exact[slots], beyond[slots] = values, far, base[slots] + far
        if done and data.draw(st.booleans()):
            slots = np.array(data.draw(st.lists(st.integers(0, done - 1), min_size=1, max_size=5, unique=True)))
            alike[slots], many[slots], beside[slots] = 7, 7, base[slots] + 7
            plain[slots], exact[slots], beyond[slots] = 7, 7, base[slots] + 7
        done += size
        reads: list[Any] = [slice(done), slice(done // 2, done), np.arange(done)[::-1], np.arange(0), done - 1]
        for read in reads:
            for own, wanted in ((alike, plain), (many, exact), (beside, beyond)):
                assert np.array_equal(own[read], wanted[read])
                assert own[read].dtype == wanted.dtype
    assert alike.nbytes <= n * dtype.itemsize


def test_a_row_that_is_otherwise_costs_no_more_than_itself() -> None:
    column = AlikeNumbers(1 << 16, np.dtype(np.int64))
    column[: 1 << 16] = np.where(np.arange(1 << 16) % 1000 == 3, 5, 0)
    assert column.nbytes == 66 * 10
    assert int(column[1003]) == 5 and int(column[1004]) == 0


@given(st.integers(0, 10**14), st.integers(1, 10**14))
def test_what_is_said_to_be_the_bounds_holds_the_bounds(low: int, wide: int) -> None:
    """Rounded, but outwards: the words never promise more than is known."""
    low_words, high, unit = re.split(r"\.\.| ", between(low, low + wide))
    scale = UNITS_NS[unit] * (1 + 1e-8)  # of what is counted in floating point
    assert float(low_words) * UNITS_NS[unit] <= low * (1 + 1e-8) and low + wide <= float(high) * scale
    assert between(low, low) == duration(low)


@pytest.mark.parametrize(("ns", "words"), [(552_300, "≤553us"), (35_040_000, "≤35.1ms"), (123_400_000_000, "≤2m04s")])
def test_an_upper_bound_is_rounded_up(ns: int, words: str) -> None:
    assert short_bound((0, ns)) == words


def test_answer_times_are_as_sure_as_the_report_has_them(troubled: Bus) -> None:
    bus, source = troubled, CaptureSource(captures.open(samples.path("troubled.jsonl")), "troubled")
    off_ns = bus.report(source).times.off_ns
    assert off_ns and bus.off_ns == off_ns
    took = {row: bus.table.value("response_ns", row) for row in range(bus.count)}
    bounded = [row for row, ns in took.items() if ns >= 0 and bus.response(row) != (ns, ns)]
    assert bounded, "some are near what the tap's clock carries"
    for row in bounded:
        low, high = bus.response(row) or (0, 0)
        assert low <= took[row] <= high
        first, last = pointed_ms(low, high).split("..")
        assert float(first) * 1e6 <= low and float(last) * 1e6 >= high
    assert bus.response(next(row for row, ns in took.items() if ns < 0)) is None
    assert pointed_ms(12_340_000, 12_340_000) == "   12.3  "


def test_findings_about_unit_255_are_none_about_the_bus() -> None:
    silent = codes().index("no-response")
    log = SimpleNamespace(
        rows_of=lambda numbers: np.array([0, -1])[numbers], rules_of=lambda numbers: np.array([silent, silent])[numbers]
    )
    table = SimpleNamespace(take_column=lambda _, rows: np.array([255], np.uint8)[rows])
    cause = SimpleNamespace(explains={(SYMPTOM_OF["no-response"], 255)})
    explained, rest = by_cause(cast(Any, SimpleNamespace(found=log, table=table)), np.arange(2), cast(Any, [cause]))
    assert (explained.by_code["no-response"].tolist(), rest.by_code["no-response"].tolist()) == ([0], [1])


def test_a_time_before_1970_is_told_where_the_system_knows_none(monkeypatch: pytest.MonkeyPatch) -> None:
    class WindowsDatetime(datetime):
        @classmethod
        def fromtimestamp(cls, timestamp: float, tz: tzinfo | None = None) -> Any:
            assert timestamp >= 0, "OSError: [Errno 22] Invalid argument"
            return super().fromtimestamp(timestamp, tz)

    monkeypatch.setattr(words, "datetime", WindowsDatetime)
    far = timezone(timedelta(hours=3))
    assert (time_of_day(-18_437_500), zone_name(-18_437_500, far)) == ("23:59:59.981562", "UTC+03:00")
    assert time_of_day(-18_437_500, far) == "02:59:59.981562"
    assert date_and_time(1795249791416938506, far) == "2026-11-21 11:29:51.416938 UTC+03:00"


def test_why_noise_is_noise_is_not_said_against_itself() -> None:
    from analyzer.languages import telling
    from analyzer.tui.why import why

    made = simulate(Scenario("noisy", "precise", transactions=200, seed=3))
    source = CaptureSource(Capture.of(made.line, made.chunks, timed=True), "noisy")
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    verdicts = {row: next(iter(why(bus, row))).text for row in range(bus.count)}
    noise = [verdict for row, verdict in verdicts.items() if bus.is_noise(row)]
    assert noise and not any(each.endswith("than noise") for each in noise)
    assert any(each.endswith(" noise with other bounds") for each in noise)
    assert any(verdict.endswith("than noise") for row, verdict in verdicts.items() if not bus.is_noise(row))
    with telling("ru"):
        told = {next(iter(why(bus, row))).text for row in range(bus.count)}
    assert "на 64 бита вероятнее, чем шум в других границах" in told
    assert not any(re.match(r"на \d*(?<!1)[234] бит ", each) for each in told)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(-2, 12), st.floats(0, 6), st.integers(1, 256)), min_size=1, max_size=40))
def test_bytes_are_counted_when_they_were_on_the_line(rows: list[tuple[float, float, int]]) -> None:
    begins, takes, lengths = (np.array(column) for column in zip(*rows, strict=True))
    shown = _octets_by_bin(lengths, begins, begins + takes, 10)
    for number in range(10):
        within = np.minimum(begins + takes, number + 1) - np.maximum(begins, number)
        share = np.where(takes > 0.01, np.maximum(within, 0) / np.maximum(takes, 0.01), within >= 0)
        assert shown[number] <= np.sum(lengths * np.minimum(share, 1)) + 2
    inside = (begins > 0.01) & (begins + takes < 10)
    assert shown.sum() >= lengths[inside].sum() - 2
