"""`rtuscope check`: each form holds and breaks where it should, mistakes are pointed at, results go where CI reads."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from buses import LINE, adu, spaced
from hypothesis import given
from hypothesis import strategies as st
from running import ran, refused

import captures
from analyzer import core
from analyzer.checks import CheckError, Outcome, compile_check, run
from analyzer.checks.model import forms
from analyzer.reference.checks import markdown
from analyzer.reports import summarize
from analyzer.simulation.field.cases.registry import field_cases
from captures import Capture, Chunk, samples

READ, ANSWER = adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")
EXCEPTION = adu("118302")
WRITE, MASK = adu("110600640001"), adu("11160065000f00f0")  # to 100; to 101
COILS = adu("110f0010000a02ff03")  # to 16 .. 25
OTHER = adu("0503000000010000"[:12]), adu("0503020001")
DAMAGED = ANSWER[:4] + bytes((ANSWER[4] ^ 8,)) + ANSWER[5:]


def judged(rule: str, frames: list[bytes], gap_ns: int = 10_000_000) -> Outcome:
    capture = Capture.of(LINE, spaced(frames, gap_ns=gap_ns))
    return run(capture, [compile_check(rule, capture.line)]).outcomes[0]


HEALTHY = [READ, ANSWER] * 8
WRITES = [*HEALTHY, WRITE, WRITE, MASK, MASK, COILS, adu("110f0010000a"), *HEALTHY]


@pytest.mark.parametrize(
    ("rule", "good", "bad", "places"),
    [
        ("no crc errors", HEALTHY, [*HEALTHY, READ, DAMAGED, *HEALTHY], 1),
        ("no crc error", HEALTHY, [*HEALTHY, READ, DAMAGED, *HEALTHY], 1),  # as people say it; crc-error is a code
        ("no bit-flip", HEALTHY, [*HEALTHY, READ, DAMAGED, *HEALTHY], 1),
        ("at most 1 exceptions", [*HEALTHY, READ, EXCEPTION], [READ, EXCEPTION] * 7, 5),
        ("no findings of severity error", [*HEALTHY, READ, EXCEPTION], [*HEALTHY, READ, DAMAGED, *HEALTHY], 1),
        ("no findings of severity warning", HEALTHY, [*HEALTHY, READ, EXCEPTION], 1),
        ("every poll answered", [*HEALTHY, READ], [*HEALTHY, READ, *HEALTHY], 1),
        ("every poll of unit 5 answered", [*HEALTHY, READ, *HEALTHY, *OTHER], [*HEALTHY, OTHER[0], *HEALTHY], 1),
        ("units are 5, 17", [*HEALTHY, *OTHER], HEALTHY, 0),
        ("no units but 17", HEALTHY, [*HEALTHY, *OTHER], 1),
        ("at least 10 frames", HEALTHY, [READ, ANSWER], 0),
        ("none where exception == 2", HEALTHY, [*HEALTHY, READ, EXCEPTION], 1),
        ("all where request: unit == 17", HEALTHY, [*HEALTHY, *OTHER], 1),
        ("no writes", HEALTHY, WRITES, 3),
    ],
)
def test_each_form_holds_and_breaks(rule: str, good: list[bytes], bad: list[bytes], places: int) -> None:
    assert judged(rule, good).word == "PASS"
    broken = judged(rule, bad)
    assert broken.word == "FAIL"
    assert len(broken.places) == places


def test_places_that_are_left_out_are_counted() -> None:
    broken = judged("none where exception == 2", [READ, EXCEPTION] * 36)
    assert (len(broken.places), broken.more) == (5, 31)
    assert [*broken.places_told][-1] == "and 31 more such places"
    assert judged("every poll answered", [*HEALTHY, READ] * 7).more == 1  # the last is still open


@pytest.mark.parametrize(
    ("rule", "passed"),
    [
        ("no writes outside 4x0-101, 00017-00026", True),
        ("no writes outside 40101-40102, 0x17..0x26", True),
        ("no writes outside 4x101, 4x102, 0x17-26", True),  # ranges that touch are one
        ("no writes outside 4x0-100, 00017-00026", False),
        ("no writes outside 4x0-101, 00017-00025", False),
        ("no writes outside 3x0-101, 00017-00026", False),
        ("no writes inside 40103-49999", True),
        ("no writes inside 0x26-0x30", False),
        ("no writes inside 0x27-0x30", True),
        ("no writes inside 4x0-100", False),
    ],
)
def test_addresses_of_writes(rule: str, passed: bool) -> None:
    assert judged(rule, WRITES).passed is passed


@pytest.mark.parametrize("compared", ["<", ">="])
@pytest.mark.parametrize("share", ["p50", "p95", "p99", "max", "min", "mean"])
def test_response_times(share: str, compared: str) -> None:
    slow, soon = judged(f"{share} response_time {compared} 9 ms", HEALTHY), f"{share} RESPONSE_TIME {compared} 11ms"
    assert slow.passed is (compared == ">=")
    assert judged(soon, HEALTHY).passed is (compared == "<")
    assert bool(slow.places) is (compared == "<")
    assert judged(f"{share} response_time of unit 17 {compared} 9 ms", HEALTHY).passed is slow.passed


def test_what_cannot_be_told_fails_and_says_so() -> None:
    untimed = Capture.of(LINE, [Chunk(0, frame) for frame in HEALTHY], timed=False)
    rules = ["p95 response_time < 1 s", "load < 99 %", "every poll of unit 9 answered", "all where unit == 9: request"]
    outcomes = run(untimed, [compile_check(rule) for rule in rules]).outcomes
    assert [outcome.passed for outcome in outcomes] == [False] * 4
    assert [outcome.measured.split(":")[0] for outcome in outcomes] == [
        "unknown", "unknown", "no polls seen", "none passes the first filter"
    ]  # fmt: skip


def test_results_do_not_hang_on_how_a_capture_is_cut_into_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = captures.open(samples.path("troubled.jsonl"))
    rules = [form.examples[0] for form in forms()]
    rules += ["no late-response", "none where late", "none where retry or unanswered", "no findings of severity note"]
    checks = [compile_check(rule, bus.line) for rule in rules]
    whole = run(bus, checks)
    monkeypatch.setattr(core, "_BLOCK", 150)
    assert len(list(core.analyse(bus))) > 5
    assert run(bus, checks) == whole


@pytest.mark.parametrize(("tap", "block"), [("precise", 1 << 16), ("ftdi16", 60)])
def test_what_an_adapter_shows_twice_is_one_poll(tap: str, block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(core, "_BLOCK", block)
    made = field_cases()["echo-dead-unit"].capture(tap, 2)
    capture = Capture.of(made.line, made.chunks)
    rows = {row.unit: row.counts for row in summarize(capture).units}
    (dead,) = made.expected.units
    checks = [compile_check(f"every poll of unit {unit} answered", capture.line) for unit in rows]
    for counts, outcome in zip(rows.values(), run(capture, checks).outcomes, strict=True):
        bad = counts.unanswered + counts.damaged
        polls, tail = counts.requests - counts.unheard, "; the last one was still open when the capture ended"
        assert outcome.measured == f"{polls - bad} of {polls} polls answered" + tail * counts.unheard
        assert outcome.passed == (not bad)
        assert len(outcome.places) == min(bad, 5)
    every = run(capture, [compile_check("every poll answered", capture.line)]).outcomes[0]
    assert len(every.places) == 5
    assert {place.text.split(",")[0] for place in every.places} == {f"unit {dead}"}


def test_the_load() -> None:
    assert judged("load < 60 %", HEALTHY).passed
    assert not judged("load > 60 %", HEALTHY).passed


@pytest.mark.parametrize(
    ("rule", "column", "words"),
    [
        ("no crc erors", 4, "did you mean crc errors?"),
        ("no gremlins", 4, "rtuscope help findings"),
        ("p95 respons < 3 ms", 5, "'response_time'"),
        ("p95 response_time < 80", 21, "needs a unit"),
        ("no findings of severity bad", 25, "note, warning, error"),
        ("none where unt == 3", 12, "did you mean unit?"),
        ("all where request: quantity == x", 32, "number"),
        ("none where text == 'a", 20, "quote"),
        ("no writes outside 4x100-50", 19, "backwards"),
        ("no writes outside 4x1-3x5", 19, "same area"),
        ("no writes outside 4x0-70000", 19, "65535"),
        ("no writes outside 100", 19, "not a logical address"),
        ("units are 1, 256", 14, "255"),
        ("at most 1.5 retries", 9, "whole number"),
        ("load < 200 %", 8, "100%"),
        ("no crc errors please or else", 4, "is unknown"),
        ("", 1, "expected"),
    ],
)
def test_mistakes_are_pointed_at(capsys: pytest.CaptureFixture[str], rule: str, column: int, words: str) -> None:
    said = refused(capsys, "check", samples.path("healthy.jsonl"), "--rule", rule)
    assert f"column {column}: " in said
    assert words in said


WORDS = ["no", "at", "most", "of", "unit", "where", "4x0-1", ":", "findings", "<", "5", "%", "p95", "'", "writes"]


@given(st.text() | st.lists(st.sampled_from(WORDS)))
def test_any_text_gives_a_rule_or_an_error(text: str | list[str]) -> None:
    text = text if isinstance(text, str) else " ".join(text)
    try:
        assert compile_check(text).text == text.strip()
    except CheckError as error:
        assert 0 <= error.column <= len(text)


def test_the_reference_is_of_these_forms() -> None:
    page = Path(__file__).resolve().parents[1] / "docs" / "check.md"
    assert page.read_text(encoding="utf-8") == markdown(), "write it anew: python -m analyzer.reference.checks"
    for number, form in enumerate(forms()):
        assert form.examples, number
        for example in form.examples:
            compile_check(example)
            compile_check(example.upper().replace("MS", "ms") if "where" not in example else example)


def test_without_rules_errors_are_looked_for(capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "check", samples.path("healthy.jsonl"))
    assert done.status == 0
    assert "PASS no findings of severity error" in done.out
    assert ran(capsys, "check", samples.path("troubled.jsonl")).status == 1


def test_a_file_of_rules_and_the_results_for_ci(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    rules, out = tmp_path / "bench.toml", tmp_path / "out.xml"
    rules.write_text(
        '[[rule]]\nname = "wire"\ncheck = "no timeouts"\n[[rule]]\ncheck = "no exceptions"\nseverity = "warning"\n'
        '[[rule]]\ncheck = "at least 3 frames"\n'
    )
    troubled = samples.path("troubled.jsonl")
    done = ran(capsys, "check", troubled, "--rules", rules, "--json", "--junit", out)
    assert done.status == 1
    told = json.loads(done.out)
    assert [rule["result"] for rule in told["rules"]] == ["fail", "warn", "pass"]
    assert told["rules"][0]["name"] == "wire"
    assert told["rules"][0]["places"][0]["index"] is not None
    suite = ElementTree.parse(out).getroot()[0]
    assert (suite.get("tests"), suite.get("failures")) == ("3", "1")
    assert [case.find("failure") is not None for case in suite] == [True, False, False]
    assert "frame" in (suite[0].findtext("failure") or "")
    rules.write_text('[[rule]]\ncheck = "at least 3 frames"\n')
    assert ran(capsys, "check", troubled, "--rules", rules).status == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rule = 3", "[[rule]]"),
        ("[[rule", "not a TOML file"),
        ("rule = " + "[" * 5000, "nested too deeply"),
        ("[[rule]]\nname = 'x'", "needs check"),
        ("[[rule]]\nchek = 'x'", "no key 'chek'"),
        ("[[rule]]\ncheck = 3", "text in quotes"),
        ("[[rule]]\ncheck = 'no writes'\nseverity = 'mild'", "error or warning"),
        ("[[rule]]\ncheck = 'no writes'\n[[rule]]\ncheck = 'no crcs'", "rule 2: 'no crcs': column 4"),
    ],
)
def test_a_bad_file_of_rules(capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, words: str) -> None:
    rules = tmp_path / "bench.toml"
    rules.write_text(text, encoding="utf-8")
    assert words in refused(capsys, "check", samples.path("healthy.jsonl"), "--rules", rules)


def test_what_a_device_says_does_no_harm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = b"\x1b[31m\x00<evil>]]>"
    frame = adu(f"1111{len(name) + 2:02x}00ff{name.hex()}")
    bus = tmp_path / "bus.jsonl"
    captures.write(bus, spaced([adu("1111"), frame] * 3), line=LINE)
    done = ran(capsys, "check", bus, "--rule", "none where response", "--junit", tmp_path / "out.xml")
    assert done.status == 1
    assert "\x1b" not in done.out
    assert b"\x1b" not in (tmp_path / "out.xml").read_bytes()
    ElementTree.parse(tmp_path / "out.xml")


def test_results_are_never_written_onto_the_capture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bus = tmp_path / "bus.jsonl"
    bus.write_bytes(samples.path("healthy.jsonl").read_bytes())
    done = ran(capsys, "check", bus, "--junit", bus)
    assert done.status == 2
    assert bus.read_bytes() == samples.path("healthy.jsonl").read_bytes()


def test_a_capture_without_frames_does_not_pass(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    captures.write(tmp_path / "none.jsonl", [Chunk(1, b"hello")], line=LINE)
    done = ran(capsys, "check", tmp_path / "none.jsonl", "--rule", "no crc errors")
    assert done.status == 1
    assert "no Modbus frame found" in done.err


@pytest.mark.parametrize("command", ["report", "export"])
def test_check_says_by_the_status_whether_errors_were_found(capsys: pytest.CaptureFixture[str], command: str) -> None:
    troubled, healthy = samples.path("troubled.jsonl"), samples.path("healthy.jsonl")
    assert ran(capsys, command, troubled).status == 0
    done = ran(capsys, command, troubled, "--check")
    assert done.status == 1
    assert done.out == ran(capsys, command, troubled).out
    assert ran(capsys, command, healthy, "--check").status == 0
    assert ran(capsys, command, troubled, "--check", "--filter", "not severity == error").status == 0


def test_parse_can_check_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "parse", "--check", READ.hex()).status == 0
    wrong = adu("110300000000").hex()  # no registers
    assert ran(capsys, "parse", wrong).status == 0
    flipped = adu("110500011234").hex()  # neither on nor off
    assert ran(capsys, "parse", flipped).status == 0
    assert ran(capsys, "parse", "--check", flipped).status == 1


@pytest.mark.parametrize("command", ["report", "export", "check"])
def test_limits_are_taken_and_refused(capsys: pytest.CaptureFixture[str], command: str) -> None:
    healthy = samples.path("healthy.jsonl")
    flags = ["--t15-ms", "0.75", "--t35-ms", "1.75", "--turnaround-ms", "200", "--idle-ms", "5"]
    assert ran(capsys, command, healthy, *flags).status == 0
    assert "between 5 and 5000 ms" in refused(capsys, command, healthy, "--idle-ms", "4")
    assert "'nan'" in refused(capsys, command, healthy, "--t15-ms", "nan")
    assert "longer" in refused(capsys, command, healthy, "--t15-ms", "2", "--t35-ms", "1")


def test_a_limit_changes_what_is_found(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bus = tmp_path / "bus.jsonl"
    assert ran(capsys, "simulate", bus, "--defect", "turnaround-short", "--transactions", "80").status == 0
    rule = ("check", bus, "--rule", "no turnaround-short")
    assert ran(capsys, *rule).status == 1
    assert ran(capsys, *rule, "--turnaround-ms", "0").status == 0
