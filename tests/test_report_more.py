"""What a report says besides: cards, polls, hours, what changed, bookmarks, another language; and that it all fits."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from pathlib import Path
from string import Formatter

import pytest
from buses import LINE, READ_AND_ANSWER, adu, spaced
from hypothesis import example, given
from hypothesis import strategies as st

import captures
from analyzer import languages
from analyzer.causes.ledger import Ledger
from analyzer.causes.reasoning import RunningStory, causes_of
from analyzer.causes.registry import Cause, suspects
from analyzer.cli import main
from analyzer.core import Analyzer
from analyzer.model.bus import Bus
from analyzer.reports import summarize, text
from analyzer.reports.against import differences
from analyzer.reports.model import Report
from analyzer.simulation.field.cases.registry import field_cases
from analyzer.tables.schema import bounds_of, delay_bounds
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

SAMPLES = Path(captures.__file__).parent / "samples"


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


def report_of(name: str) -> Report:
    return summarize(captures.open(SAMPLES / f"{name}.jsonl"), source=name)


def field_report(name: str, tap: str, seed: int) -> Report:
    made = field_cases()[name].capture(tap, seed)
    return summarize(Capture.of(made.line, made.chunks, timed=tap != "untimed"))


def test_what_a_cause_explains_has_no_remedy_of_its_own() -> None:
    report = field_report("emi-mains", "precise", 5)
    noise = next(row for row in report.findings if row.code == "noise")
    assert report.causes[0].cause == "emi-mains" and all(group.explained_by for group in noise.groups)
    page = " ".join(text(report).split())
    assert not any(group.remedy in page for group in noise.groups)


@pytest.mark.parametrize("tap", ["precise", "irq", "gateway"])
def test_no_line_is_longer_than_a_page(tap: str) -> None:
    report = field_report("dead-beside-driver", tap, 2)
    long = [line for line in text(report).splitlines() if len(line) > 80]
    assert long == []


@pytest.mark.parametrize("polls", range(2, 9))
def test_no_second_is_the_busiest_with_less_than_the_mean(polls: int) -> None:
    line = LineSettings(baud=9600, char_bits=10)
    request = adu("0103000b0001")
    chunks = [Chunk(900_000_000 + 400_000_000 * poll, request) for poll in range(polls)]
    load = summarize(Capture.of(line, chunks)).load
    assert load.mean is not None
    assert load.busiest_second is None or load.busiest_second >= load.mean


def test_silence_and_garbage_are_two_things() -> None:
    made = field_cases()["dead-beside-driver"].capture("precise", 3)
    report = summarize(Capture.of(made.line, made.chunks))
    dead, late = made.expected.units[0], made.expected.beside.units[0] if made.expected.beside else -1
    cards = {card.unit: card for card in report.cards}
    assert cards[dead].silent == cards[dead].asked > 0 == cards[dead].garbage
    assert cards[late].garbage > 0 == cards[late].silent
    assert max(cards[late].damage, key=lambda place: cards[late].damage[place]) == "head"
    for card in report.cards:
        assert card.answered + card.exceptions + card.silent + card.garbage == card.asked


def test_a_late_answer_is_an_answer_on_the_card_too() -> None:
    made = field_cases()["timeout-too-short"].capture("irq", 5)
    report = summarize(Capture.of(made.line, made.chunks))
    (late,) = (row for row in report.units_as_heard if row.counts.late)
    (card,) = (card for card in report.cards if card.unit == late.unit)
    assert card.late > 100
    assert (card.answered, card.silent, card.late) == (late.counts.answered, late.counts.unanswered, late.counts.late)


def test_a_unit_that_dies_has_a_change() -> None:
    made = field_cases()["end-dead-unit"].capture("precise", 1)
    report = summarize(Capture.of(made.line, made.chunks))
    card = next(card for card in report.cards if card.unit == made.expected.units[0])
    assert card.changes
    assert card.changes[0].t_ns == pytest.approx(made.begin_ns + 0.9 * (made.end_ns - made.begin_ns), rel=0.05)


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
def test_requests_that_an_adapter_shows_twice_are_counted_once(tap: str) -> None:
    made = field_cases()["echo-dead-unit"].capture(tap, 2)
    report = summarize(Capture.of(made.line, made.chunks))
    asked = {row.unit: row.counts.requests for row in report.units}
    assert report.transactions.echoes == report.transactions.requests == sum(asked.values()) > 100
    assert all(0 <= asked[card.unit] - card.asked <= 1 for card in report.cards)  # the last one may be cut
    assert all(row.counts.unanswered in (0, row.counts.requests) for row in report.units)
    assert "echoes of the adapter" in text(report)


def test_one_report_against_itself_says_nothing() -> None:
    report = report_of("troubled")
    assert differences(report, report) == ()


def test_what_is_new_there_is_gone_the_other_way_round() -> None:
    ill, well = report_of("troubled"), report_of("healthy")
    there, back = differences(ill, well), differences(well, ill)
    new = {(each.about, each.name) for each in there if each.change == "new"}
    assert {(each.about, each.name) for each in back if each.change == "gone"} <= new
    assert ("cause", "all-silent") in new
    assert any(each.about == "unit" and each.change == "worse" for each in there)


def test_the_command_tells_hours_and_what_changed(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [str(SAMPLES / "troubled.jsonl"), "--by", "hour", "--against", str(SAMPLES / "healthy.jsonl")]
    assert main(["report", *arguments]) == 0
    page = capsys.readouterr().out
    assert "\nagainst " in page
    assert "2026-11-21 08:00" in page
    assert main(["report", *arguments, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert sum(row["counts"]["requests"] for row in report["hours"]) == report["transactions"]["requests"]
    assert report["against"]
    assert report["causes"]


def test_bookmarks_stand_in_every_way_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bus.jsonl"
    path.write_bytes((SAMPLES / "troubled.jsonl").read_bytes())
    notes = {"version": 1, "bookmarks": [{"port": 0, "start": 8, "comment": "look \x1b here"}]}
    path.with_name("bus.jsonl.rtuscope.json").write_text(json.dumps(notes))
    assert main(["report", str(path)]) == 0
    page = capsys.readouterr().out
    assert "look" in page
    assert "\x1b" not in page
    assert main(["report", str(path), "--html", str(tmp_path / "bus.html")]) == 0
    assert "<h2>Bookmarks</h2>" in (tmp_path / "bus.html").read_text(encoding="utf-8")
    for name in ("bus.mcap", "bus.pcapng"):
        assert main(["export", str(path), "-o", str(tmp_path / name)]) == 0
    assert b"bookmark: look" in (tmp_path / "bus.pcapng").read_bytes()
    from mcap.reader import make_reader

    with (tmp_path / "bus.mcap").open("rb") as file:
        reader = make_reader(file)
        topics = {channel.topic for _, channel, _ in reader.iter_messages(topics=["/bookmarks", "/causes"])}
        assert topics == {"/bookmarks", "/causes"}
        assert any(record.name == "rtuscope/causes" for record in reader.iter_metadata())


def _places(template: str) -> set[tuple[str, str]]:
    """Figures and how each is written, but for a noun that goes with one, or thousands that are set apart as then."""
    parts = Formatter().parse(template)
    return {
        (name, "" if not spec or spec == "," or "|" in spec else spec) for _, name, spec, _ in parts if name is not None
    }


@pytest.mark.parametrize("language", [each for each in languages.LANGUAGES if each != "en"])
def test_a_catalogue_has_every_cause_with_its_numbers(language: str) -> None:
    known = languages.catalogue(language)["causes"]
    assert set(known) == {suspect.cause for suspect in suspects()}
    for suspect in suspects():
        parts = {"text": suspect.text, "share": suspect.share, "test": suspect.deciding_test, "remedy": suspect.remedy}
        for part, english in parts.items():
            assert _places(known[suspect.cause].get(part, "")) <= _places(english), (suspect.cause, part)
            assert bool(known[suspect.cause].get(part)) == bool(english), (suspect.cause, part)


def test_the_report_speaks_russian(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(SAMPLES / "troubled.jsonl"), "--lang", "ru"]) == 0
    page = capsys.readouterr().out
    assert "что не так" in page
    assert "Устройства 1, 2, 9, 17 замолкают" in page


@pytest.mark.parametrize("aside", [False, True])
@pytest.mark.parametrize("octets", [2000, 100])
def test_a_live_story_ends_as_the_whole_one(octets: int, aside: bool) -> None:
    made = field_cases()["dead-beside-driver"].capture("precise", 4)
    capture = Capture.of(made.line, made.chunks)
    story, told = RunningStory(capture.line, aside=aside), []
    analyzer = Analyzer(capture.line)
    for block in capture.blocks(octets):
        analyzer.feed(block)
        told += story.feed(analyzer.latest.batch, analyzer.latest.transactions, capture.line)
    analyzer.close()
    told += story.feed(analyzer.latest.batch, analyzer.latest.transactions, capture.line)
    told += story.close()
    whole = summarize(Capture.of(made.line, made.chunks)).causes
    assert [(c.cause, c.units) for c in story.causes] == [(c.cause, c.units) for c in whole]
    assert told[0].state == "new"
    assert octets > 100 or aside or told[0].exchanges <= 43  # rows wait for each other, a look that is due does not
    assert [each.revision for each in told] == sorted(each.revision for each in told)


def test_rows_wait_for_no_look_at_the_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first one takes most of a second: neither lines nor the interface's rows stand still for it."""
    looking, go_on = threading.Event(), threading.Event()

    def slow(ledger: Ledger) -> list[Cause]:
        looking.set()
        assert go_on.wait(60)
        return causes_of(ledger)

    monkeypatch.setattr("analyzer.causes.reasoning.causes_of", slow)
    made = field_cases()["dead-beside-driver"].capture("precise", 4)
    capture = Capture.of(made.line, made.chunks)
    story, bus, analyzer = RunningStory(capture.line, aside=True), Bus(capture.line), Analyzer(capture.line)
    blocks = list(capture.blocks(2000))
    asked: list[Cause] = []
    asking = threading.Thread(target=lambda: asked.extend(bus.causes()))
    for number, block in enumerate(blocks):
        if number == len(blocks) // 2:
            asking.start()
            assert looking.wait(60)
        analyzer.feed(block)
        bus.feed(analyzer.latest)
        assert story.feed(analyzer.latest.batch, analyzer.latest.transactions, capture.line) == []
    assert bus.count > 100
    go_on.set()
    asking.join(60)
    monkeypatch.undo()
    analyzer.close()
    bus.feed(analyzer.latest)
    bus.close()
    story.feed(analyzer.latest.batch, analyzer.latest.transactions, capture.line)
    story.close()
    whole = [(c.cause, c.units) for c in summarize(Capture.of(made.line, made.chunks)).causes]
    assert [(c.cause, c.units) for c in bus.causes()] == [(c.cause, c.units) for c in story.causes] == whole


@given(st.lists(st.integers(-1, 10**10), min_size=1), st.floats(0, 1e9))
@example([1], 1.5)
def test_an_interval_holds_what_was_measured(delays: list[int], off_ns: float) -> None:
    import numpy as np

    exact, low, high = delay_bounds(np.array(delays, np.int64), off_ns)
    for delay, one, least, most in zip(delays, exact.tolist(), low.tolist(), high.tolist(), strict=True):
        if delay < 0:
            assert (one, least, most) == (-1, -1, -1)
            continue
        assert 0 <= least <= delay <= most
        assert one in (-1, delay)
        assert bounds_of(delay, off_ns) == (least, most)


def test_a_transaction_s_time_is_an_interval_where_the_tap_is_coarse(tmp_path: Path) -> None:
    out = tmp_path / "t.csv"
    assert main(["export", str(SAMPLES / "troubled.jsonl"), "--table", "transactions", "-o", str(out)]) == 0
    head, *rows = [line.split(",") for line in out.read_text(encoding="utf-8").splitlines()]
    times = [dict(zip(head, row, strict=True)) for row in rows]
    bounded = [row for row in times if row["response_time_low_ns"] and not row["response_time_ns"]]
    assert bounded
    assert all(int(row["response_time_low_ns"]) < int(row["response_time_high_ns"]) for row in bounded)


def test_parts_of_the_time_without_a_request_do_not_part_an_outage() -> None:
    made = field_cases()["single-dead-unit"].capture("precise", 3)
    (card,) = summarize(Capture.of(made.line, made.chunks)).cards
    (change,) = card.changes
    assert (
        change.text == f"{card.silent} of {card.silent} requests without a good answer, 0 of {card.answered} otherwise"
    )


def _scan(units: range, answering: tuple[int, ...]) -> Capture:
    pieces = []
    for unit in units:
        pieces.append(adu(f"{unit:02x}0300000001"))
        if unit in answering:
            pieces.append(adu(f"{unit:02x}03020001"))
    return Capture.of(LINE, spaced(pieces, gap_ns=50_000_000))


def test_a_search_shows_who_answered() -> None:
    page = text(summarize(_scan(range(1, 60), (5, 17))))
    assert "asked once or twice, and silent: 57 units (1..4, 6..16, 18..59)" in page
    assert [line.split()[0] for line in page.splitlines() if line.strip().startswith(("5 ", "17 "))] == ["5", "17"]
    assert "units with bad answers" not in page


def test_a_few_silent_units_are_no_search() -> None:
    assert "asked once or twice" not in text(summarize(_scan(range(1, 8), (5,))))


def _with_a_pause(seconds: int) -> Capture:
    chunks = spaced(READ_AND_ANSWER * 40, gap_ns=20_000_000)
    late = [Chunk(chunk.t_ns + seconds * 1_000_000_000, chunk.data) for chunk in chunks[40:]]
    return Capture.of(LINE, chunks[:40] + late)


def test_a_long_silence_is_told() -> None:
    report = summarize(_with_a_pause(3600))
    assert report.quiet is not None
    assert abs(report.quiet[1] - report.quiet[0] - 3600e9) < 1e9
    assert "longest silence 1 h 0 min" in text(report)


def test_pauses_as_all_others_are_not() -> None:
    assert summarize(_with_a_pause(5)).quiet is None
    hourly = [Chunk(i * 3_600_000_000_000, data) for i, data in enumerate(READ_AND_ANSWER[:1] * 30)]
    assert summarize(Capture.of(LINE, hourly)).quiet is None


def test_a_unit_that_answers_otherwise_is_not_silent() -> None:
    pieces = [adu("1103006b0003"), adu("110402000a"), *READ_AND_ANSWER[:1]] * 20
    report = summarize(Capture.of(LINE, spaced(pieces, gap_ns=20_000_000)))
    (card,) = report.cards
    assert (card.silent, card.garbage) == (19, 20)  # the last request is not held against it


def test_two_answers_to_something_else_are_one_request_without_an_answer() -> None:
    pieces = [READ_AND_ANSWER[0], adu("110402000a"), adu("110402000b")] * 20
    (card,) = summarize(Capture.of(LINE, spaced([*pieces, *READ_AND_ANSWER[:1]], gap_ns=20_000_000))).cards
    assert (card.silent, card.garbage) == (0, 20)
