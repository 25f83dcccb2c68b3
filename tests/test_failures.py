"""A judge or look with a defect: what else there is stands, and one line tells what failed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from seats import Seat, opened, sample_in, using

import captures
from analyzer.causes.reasoning import RunningStory
from analyzer.causes.registry import suspects
from analyzer.cli import main
from analyzer.core import Analyzer
from analyzer.failures import Failures, PartFailedWarning
from analyzer.model.bus import Bus
from analyzer.reports import summarize, text
from analyzer.reports.model import Report
from analyzer.tables.findings import Findings, all_looks, fresh_looks
from captures import samples

pytestmark = pytest.mark.filterwarnings("default::analyzer.failures.PartFailedWarning")
TROUBLED = samples.path("troubled.jsonl")


def fails(*_: object) -> Iterator[Any]:
    raise ZeroDivisionError("division by zero")


def reported() -> Report:
    return summarize(captures.open(TROUBLED))


def break_judge(monkeypatch: pytest.MonkeyPatch, cause: str) -> None:
    broken = tuple(replace(each, judge=fails) if each.cause == cause else each for each in suspects())
    monkeypatch.setattr("analyzer.causes.reasoning.suspects", lambda: broken)


def break_look(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """The look that finds `code` fails at its first rows, whether a function or something that remembers."""
    from analyzer.diagnosis import judge
    from analyzer.tables.findings import codes_of

    class Broken:
        def __call__(self, view: object) -> list[Findings]:
            fails(view)
            raise ZeroDivisionError("division by zero")

    of_broken = {each: codes_of(each) for each in fresh_looks()}
    wanted = next(name for name in of_broken.values() if code in name.split(", "))
    monkeypatch.setattr(
        judge, "fresh_looks", lambda: [Broken() if codes_of(each) == wanted else each for each in fresh_looks()]
    )
    monkeypatch.setattr(judge, "codes_of", lambda look: wanted if isinstance(look, Broken) else codes_of(look))


def test_a_broken_judge_takes_no_other_cause_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = reported()
    first, *others = [cause.cause for cause in whole.causes]
    innocent = next(each.cause for each in suspects() if each.cause not in (first, *others))
    break_judge(monkeypatch, innocent)
    with pytest.warns(PartFailedWarning, match=innocent):
        report = reported()
    assert [cause.cause for cause in report.causes] == [first, *others]
    assert (report.findings, report.units) == (whole.findings, whole.units)
    assert [part.part for part in report.failed] == [innocent]
    assert f"{innocent}: ZeroDivisionError: division by zero" in " ".join(text(report).split())


def test_a_broken_look_takes_no_other_finding_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = {row.code: row.count for row in reported().findings}
    assert {"retry", "no-response"} <= whole.keys()
    break_look(monkeypatch, "retry")
    with pytest.warns(PartFailedWarning, match="retry"):
        report = reported()
    assert all("retry" in part.part for part in report.failed) and len(report.failed) == 1
    lost = set(report.failed[0].part.split(", "))
    assert {row.code: row.count for row in report.findings} == {
        code: count for code, count in whole.items() if code not in lost
    }


def test_every_look_has_a_name_to_be_told_by() -> None:
    from analyzer.tables.findings import codes_of

    assert len(all_looks()) > 5
    assert all(codes_of(look) for look in fresh_looks())


def test_a_report_with_a_broken_part_does_not_end_as_a_whole_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    break_judge(monkeypatch, "dead-unit")
    assert main(["report", str(TROUBLED), "--json"]) == 2
    out, err = capsys.readouterr()
    assert json.loads(out)["failed"] == [{"part": "dead-unit", "trouble": "ZeroDivisionError: division by zero"}]
    assert err.count("part of the analysis failed") == err.count("\n") == 1
    assert main(["report", str(TROUBLED), "--lang", "ru"]) == 2
    out, err = capsys.readouterr()
    assert "сбой части анализа: dead-unit" in " ".join(out.split())
    assert "сбой части анализа: dead-unit" in err


def test_causes_that_fail_altogether_leave_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = reported()
    monkeypatch.setattr("analyzer.causes.ledger.Ledger.feed", fails)
    with pytest.warns(PartFailedWarning, match="causes"):
        report = reported()
    assert report.units == whole.units and report.failed and not report.causes
    assert [row.code for row in report.findings] == [row.code for row in whole.findings]


@pytest.mark.parametrize("aside", [False, True])
def test_a_live_line_goes_on_where_its_causes_fail(monkeypatch: pytest.MonkeyPatch, aside: bool) -> None:
    monkeypatch.setattr("analyzer.causes.reasoning.Evidence", fails)
    capture = captures.open(TROUBLED)
    story, bus, analyzer = RunningStory(capture.line, aside=aside), Bus(capture.line), Analyzer(capture.line)
    with pytest.warns(PartFailedWarning, match="causes"):
        for block in capture.blocks(4000):
            analyzer.feed(block)
            bus.feed(analyzer.latest)
            assert story.feed(analyzer.latest.batch, analyzer.latest.transactions, capture.line) == []
        assert story.close() == []
    assert bus.frames > 100


def test_an_error_is_raised_where_one_looks_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RTUSCOPE_DEBUG", "1")
    with pytest.raises(ZeroDivisionError), Failures().contained("home"):
        fails()


def test_home_says_that_a_judge_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    break_judge(monkeypatch, "dead-unit")

    async def work(sitting: Seat) -> None:
        await sitting.press("0")
        await sitting.until(lambda: "FAILED dead-unit" in sitting.shown())
        assert "what is wrong" in sitting.shown()  # of the other causes
        assert any("dead-unit: ZeroDivisionError" in notice for notice in sitting.notices())

    using(opened(sample_in(tmp_path)), work)


@pytest.mark.parametrize("key", ["0", "7", "9"])
def test_a_view_whose_figures_fail_does_not_wait_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    monkeypatch.setattr("analyzer.model.bus.with_story", fails)
    monkeypatch.setattr("analyzer.model.bus.with_cards", fails)

    async def work(sitting: Seat) -> None:
        await sitting.press(key)
        await sitting.until(lambda: "art of the analysis failed" in sitting.shown())
        assert "reading …" not in sitting.shown()
        await sitting.press("1")
        assert "FAILED" in sitting.shown()  # it stays, and so do the rows
        assert sitting.screen.transactions.count() > 100

    using(opened(sample_in(tmp_path)), work, size=(120, 30))


def test_why_reading_ended_stays_in_sight(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.model.registers.RegisterLog.feed", fails)

    async def work(sitting: Seat) -> None:
        await sitting.until(lambda: "reading ended: " in sitting.shown())
        assert "FAILED reading" in sitting.shown()

    using(opened(sample_in(tmp_path)), work)
