"""The display filter: its examples, its words, what it says of a mistake, what it offers while one types."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import buses
import numpy as np
import pytest
from buses import LINE, adu, joined, spaced

import captures
from analyzer.core import deframe
from analyzer.filters import BatchTable, FilterError, check, compile_filter, complete, narrowed
from analyzer.filters.fields import FIELDS
from analyzer.filters.parsing import parsed
from analyzer.filters.table import OUTCOMES, PLAIN
from analyzer.options import Options
from analyzer.reference.filters import markdown
from analyzer.tables.batch import Batch, Frame
from analyzer.tables.schema import Kind
from captures import samples
from captures.chunks import Capture
from captures.line import LineSettings
from dissectors.maps import shipped_map
from dissectors.maps.files import UnitMaps

CHARTS = UnitMaps(other=shipped_map("eastron-sdm630"))


@cache
def troubled() -> BatchTable:
    """The sample capture with troubles."""
    return buses.table(captures.open(samples.path("troubled.jsonl")))


def table(*frames: str, line: LineSettings = LINE) -> BatchTable:
    """Frames, from hex without CRC."""
    capture = Capture.of(line, spaced([adu(each) for each in frames]))
    return BatchTable(joined(deframe(capture)), line)


def passed(text: str, rows: BatchTable) -> list[int]:
    return np.flatnonzero(compile_filter(text).mask(rows)).tolist()


def chosen(text: str) -> list[Frame]:
    rows = troubled()
    return [rows.whole.frame(row) for row in passed(text, rows) if rows.whole.rows.kind[row] != Kind.NOISE]


READ = ("1103006B0003", "110306AE4156524340", "11060001FFFE", "11060001FFFE", "01010013000A", "010102CD01")


def test_the_issues_examples() -> None:
    assert all(f.unit == 17 and f.function in (3, 4) for f in chosen("unit == 17 and function in (3, 4)"))
    assert [f.index for f in chosen("exception")] == [f.index for f in troubled().whole.frames() if f.exception]
    assert len(chosen("crc_ok == false")) == 13
    assert all(f.response_time_ns is not None and f.response_time_ns > 50e6 for f in chosen("response_time > 50ms"))
    assert all(b"\x03\x02" in f.captured for f in chosen('hex contains "03 02"'))
    rows = troubled().whole.rows
    assert len(chosen("not noise")) == np.count_nonzero(rows.kind != Kind.NOISE)
    assert passed('finding == "retry"', troubled()) == [
        row for row in range(len(rows)) if any(each.code == "retry" for each in troubled().whole.findings_of(row))
    ]


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_every_field_has_an_example_that_works(field: object) -> None:
    found = next(each for each in FIELDS if each is field)
    filtered = compile_filter(found.example, charts=CHARTS)
    assert found.name in filtered.fields
    assert len(filtered.mask(troubled())) == len(troubled())
    for alias in found.aliases:
        renamed = compile_filter(found.example.replace(found.name, alias), charts=CHARTS)
        assert (renamed.mask(troubled()) == filtered.mask(troubled())).all()


def test_fields_ask_only_for_the_columns_that_tables_promise() -> None:
    class Watched(BatchTable):
        def column(self, name: str) -> np.ndarray:
            assert name in PLAIN or name in OUTCOMES, name
            return super().column(name)

    for field in FIELDS:
        compile_filter(field.example, charts=CHARTS).mask(Watched(troubled().whole, LINE))


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("register == 40108", [0, 1]),
        ("register == 400108", [0, 1]),
        ("register == 4x108", [0, 1]),
        ("register == 107", [0, 1]),
        ("register == 0x6B", [0, 1]),
        ("register == 30108", []),
        ("register in (40002, 40110)", [0, 1, 2, 3]),
        ("register in 40109..40200", [0, 1]),
        ("register > 40110", []),
        ("register >= 40110", [0, 1]),
        ("register != 40108", [2, 3]),
        ("bit == 19", [4, 5]),
        ("bit == 28", [4, 5]),
        ("bit == 29", []),
        ("bit == 000020", [4, 5]),
        ("address == 19", [4, 5]),
        ("address", [0, 1, 2, 3, 4, 5]),
        ("value > 44000", [1, 2, 3]),
        ("value == 1", [5]),
        ("signed_value == -2", [2, 3]),
        ("value != 65534", [1, 5]),
        ("quantity == 10", [4, 5]),
        ("register == 40108 and value > 44000", [1]),
        ("register == 40109 and value > 44000", []),
        ("register == 40109 and (value < 10 or value in 22098..22099)", [1]),
        ("register == 40108 and not value > 44000", []),
        ("register == 40109 and not value > 44000", [1]),
        ("not (register == 40109 and value > 44000)", [0, 1, 2, 3, 4, 5]),
        ("bit == 19 and value == 1 and unit == 1", [5]),
        ("bit == 20 and value == 1", []),
        ("(register == 40108 and value > 44000) and (register == 40109 and value < 23000)", [1]),
        ('text contains "READ 3"', [0]),
        ('text matches "read * holding*" or summary matches "?: *"', [0]),
        (f'hex == "{adu("11060001FFFE").hex(" ")}"', [2, 3]),
        ('hex == "11 06 00 01 FF FE"', []),
        ('hex contains "0001FFFE"', [2, 3]),
        ("length == 8 and request", [0, 2, 4]),
        ("function == 'read coils' || function == read_holding_registers", [0, 1, 4, 5]),
        ("function contains write", [2, 3]),
        ('function matches "*coil*"', [4, 5]),
        ("direction == response && !(unit == 1)", [1, 3]),
        ("direction != response", [0, 2, 4]),
        ("index in (0, 4..5)", [0, 4, 5]),
        ("unit not in 2..17", [4, 5]),
        ("UNIT = 17 AND NOT function IN [3]", [2, 3]),
        ("crc-ok and response-time > 1 h", []),
        ("protocol == rtu and crc_ok and not exception and not broadcast", [0, 1, 2, 3, 4, 5]),
        ("exception != 2", []),
        ("time < 20 ms", [0, 1]),
        ("time > 10000 days", None),
        ("  ", [0, 1, 2, 3, 4, 5]),
    ],
)
def test_words(text: str, rows: list[int] | None) -> None:
    if rows is None:
        assert check(text) is not None
    else:
        assert passed(text, table(*READ)) == rows


def test_a_comparison_never_holds_of_what_a_row_does_not_have() -> None:
    for text in ("unit", "function", "crc_ok", "index", "response_time", "exception", "register", "value", "text"):
        noise = compile_filter(f"noise and {text}").mask(troubled())
        assert not noise.any(), text
    requests = compile_filter("request and (response_time < 1 h or response_time > 0 or response_time != 1 s)")
    assert not requests.mask(troubled()).any()
    assert not compile_filter("not noise and not crc_ok == true and crc_ok == true").mask(troubled()).any()


def test_what_became_of_requests_counts_as_the_report_does() -> None:
    from analyzer.reports import summarize

    counts = summarize(captures.open(samples.path("troubled.jsonl"))).transactions
    assert len(chosen("retry")) == counts.retries
    assert len(chosen("unanswered")) == counts.unanswered
    assert len(chosen("late")) == counts.late
    assert all(each.direction == "request" for each in chosen("unanswered or retry"))


def test_times_in_characters_need_the_lines_speed() -> None:
    slow, unknown = LineSettings(baud=9600, char_bits=10), LineSettings()
    text = "gap > 3.5 chars"
    rows = table(*READ)
    gap = rows.whole.rows.gap_before_ns
    same = BatchTable(rows.whole, slow)
    assert passed(text, same) == np.flatnonzero(gap > 3.5 * 10e9 / 9600).tolist()
    assert check(text) is None
    wrong = check(text, unknown)
    assert wrong is not None
    assert wrong.column == 6
    with pytest.raises(FilterError, match="speed is not known"):
        compile_filter(text).mask(BatchTable(rows.whole, unknown))


def test_absolute_times() -> None:
    rows = troubled()
    first, last = int(rows.whole.rows.t_start_ns[0]), int(rows.whole.rows.t_start_ns[-1])
    moment = np.datetime64((first + last) // 2, "ns").astype("datetime64[us]")
    expected = np.flatnonzero(rows.whole.rows.t_start_ns >= moment.astype("datetime64[ns]").astype(np.int64)).tolist()
    assert 0 < len(expected) < len(rows)
    assert passed(f'time >= "{moment}"', rows) == passed(f"time >= '{moment}Z'", rows) == expected
    assert passed('time > "0001-01-01" and time < "9999-12-31"', rows) == list(range(len(rows)))


def test_ascii_mode_is_read_by_what_its_digits_stand_for() -> None:
    lines = [b":1103006B00037E\r\n", b":110306AE415652434049\r\n"]
    rows = BatchTable(joined(deframe(Capture.of(LINE, spaced(lines)), Options(protocol="ascii"))), LINE)
    assert passed('hex contains "00 6B" and protocol == ascii', rows) == [0]
    assert passed('hex contains "3A"', rows) == []
    assert passed("register == 40108 and value == 44609", rows) == [1]


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("unti == 3", 0, "no field 'unti'; did you mean unit?"),
        ("exception and zzz", 14, "no field 'zzz'"),
        ("noise or crc-error", 9, "no field 'crc-error'; write finding == crc-error"),
        ("rtu", 0, "write protocol == rtu"),
        ("unit == 300", 8, "300 is outside 0 to 255"),
        ("unit == 3.5", 8, "a whole number"),
        ("unit == 3 ms", 8, "without a unit"),
        ("unit 17", 5, "expected a comparison such as =="),
        ("unit ==", 7, "expected a value"),
        ("unit == 1 or", 12, "expected a field"),
        ("unit == 1 function == 3", 10, "'and'"),
        ("(unit == 1", 10, "expected ')'"),
        ("unit == 1)", 9, "not ')'"),
        ("unit in (1,2", 12, "a comma"),
        ("unit in 5..1", 8, "1..5"),
        ("unit contains 3", 5, "unit takes ==, !=, <, <=, >, >= and in, not contains"),
        ("noise > true", 6, "noise takes"),
        ("crc_ok == 1", 10, "true or false"),
        ('finding == "late-respons"', 11, "did you mean late-response?"),
        ("direction == sideways", 13, "there are request, response"),
        ("severity >= bad", 12, "note, warning, error"),
        ("response_time > 50", 16, "needs a unit"),
        ("response_time > fast", 16, "50 ms"),
        ("time > 3 chars", 7, "us, ms, s"),
        ('time > "soon"', 7, "is not a time"),
        ("gap > 3.5 foo", 10, "a unit such as ms"),
        ('finding == "late', 11, "the quote is not closed"),
        ('hex contains "0"', 13, "two hexadecimal digits each"),
        ("hex contains 1..2", 14, "expected"),
        ("hex in (1..2)", 8, "a range needs numbers"),
        ("text contains 3", 14, "in quotes"),
        ('text == ""', 8, "1 to 256 characters"),
        ("register == 10020", 12, "a discrete input: write bit == 10020"),
        ("register == 50001", 12, "not a logical address"),
        ("register in 30001..40010", 19, "in the same area"),
        ("address == 4x108", 11, "register and bit"),
        ("address == 65536", 11, "outside 0 to 65535"),
        ("exception == 'none'", 13, "no exception 'none'"),
        ("unit == 17 %", 11, "expected"),
        ("unit =! 3", 6, "expected a value"),
        ("(" * 51 + "noise" + ")" * 51, 50, "50 deep"),
        ("noise or " * 500 + "noise", 4096, "at most 4,096 characters"),
    ],
)
def test_a_mistake_is_told_with_its_column(text: str, column: int, words: str) -> None:
    wrong = check(text)
    assert wrong is not None
    assert (wrong.column, words in wrong.message) == (column, True), str(wrong)
    assert str(wrong) == f"column {column + 1}: {wrong.message}"


@pytest.mark.parametrize(
    ("text", "offered"),
    [
        ("un", ["unit", "unsure", "unanswered"]),
        ("not no", ["noise", "not"]),
        ("unit =", []),
        ("unit == ", []),
        ('finding == "la', ['"late-response"']),
        ("finding == late-r", ['"late-response"']),
        ("severity >= w", ["warning"]),
        ("direction == ", ["request", "response"]),
        ("crc_ok == ", ["true", "false"]),
        ("crc_ok ", ["==", "!=", "in", "and", "or", "not"]),
        ("gap > 3.5 c", ["chars"]),
        ("gap > 50m", ["ms", "min"]),
        ("unit == 17 a", ["and"]),
        ("function == 'read c", ['"Read Coils"']),
        ("exception in (2, 'illegal f", ['"illegal function"']),
        ("noise) and ", []),
        ("unti == ", []),
    ],
)
def test_completion(text: str, offered: list[str]) -> None:
    found = complete(text + " tail", len(text))
    assert [each.text for each in found] == offered
    for each in found:
        assert each.help or each.text in ("true", "false")
        assert text.startswith(text[: each.start])
        assert each.start <= len(text)


def test_every_field_is_offered_and_every_value_offered_is_taken() -> None:
    assert {field.name for field in FIELDS} <= {each.text for each in complete("", 0)}
    for field in FIELDS:
        for choice in field.kind.choices():
            assert check(f"{field.name} == {choice.text}") is None
            assert check(f"{field.name} in ({choice.text})") is None


def test_completing_leads_to_a_filter() -> None:
    text = ""
    for typed in ("fin", "", "crc-e", "an", "not", "dir", "", "resp"):
        first = complete(text + typed, len(text + typed))[0]
        text = text[: first.start] + first.text + " "
    assert text == 'finding == "crc-error" and not direction == response '
    assert check(text) is None


def test_a_narrowed_batch_reads_as_before() -> None:
    rows = table(*READ)
    kept = narrowed(rows.whole, compile_filter("response").mask(rows))
    assert [kept.frame(i).summary() for i in range(3)] == [rows.whole.frame(i).summary() for i in (1, 3, 5)]
    assert [frame.to_json() for frame in kept.frames()] == [rows.whole.frame(i).to_json() for i in (1, 3, 5)]
    again = BatchTable(kept, LINE)
    assert passed("register == 40108 and value > 44000", again) == [0]
    assert passed("bit == 19", again) == [2]
    some = narrowed(
        troubled().whole, compile_filter('finding == "crc-error" or finding == "bit-flip"').mask(troubled())
    )
    assert some.findings is not None
    assert all(some.findings_of(row) for row in range(len(some)))
    assert len(narrowed(some, np.zeros(len(some), np.bool_))) == 0


def test_a_filter_says_what_it_needs_to_know() -> None:
    assert compile_filter("unanswered or unit == 3").settled
    assert not compile_filter("unit == 3 and value > 5").settled
    assert compile_filter("unit == 3 and value > 5").fields == {"unit", "value"}


def test_what_is_dear_is_asked_only_of_rows_that_the_rest_leaves() -> None:
    whole = troubled()

    class Counting(BatchTable):
        rows = 0

        def __len__(self) -> int:
            return 50 * len(self.whole)  # long enough for several blocks

        def column(self, name: str) -> np.ndarray:
            return np.tile(super().column(name), 50)

        def findings(self) -> tuple[np.ndarray, np.ndarray]:
            return np.zeros(0, np.int64), np.zeros(0, np.int16)

        def batch(self, first: int, last: int) -> Batch:
            self.rows += last - first
            return self.whole

    rows = Counting(whole.whole, LINE)
    assert not compile_filter('text contains "x" and value > 3 and hex contains "11" and finding').mask(rows).any()
    assert rows.rows == 0


def test_the_reference_is_of_this_table() -> None:
    page = Path(__file__).resolve().parents[1] / "docs" / "filters.md"
    made = markdown()
    assert page.read_text(encoding="utf-8") == made, "write it anew: python -m analyzer.reference.filters"
    pages = [made, page.with_name("interface.md").read_text(encoding="utf-8")]
    for block in [block for each in pages for block in each.split("```text\n")[1:]]:
        for line in block.split("```")[0].splitlines():
            assert check(line, charts=CHARTS) is None, line
    for quoted in re.findall(r"`([a-z_]+ (?:==|!=|in|>|<) [^`]+)`", made):
        assert check(quoted) is None, quoted


def test_an_error_stays_on_one_line_whatever_was_typed() -> None:
    for text in ('crc_ok == "a\nb"', 'unit == "a\x1b[3m\n"', 'retry == "x\r\ny"'):
        with pytest.raises(FilterError) as refused:
            compile_filter(text)
        assert str(refused.value).isprintable()


def test_the_parser_s_library_waits_until_a_filter_is_typed() -> None:
    code = "import sys; from analyzer.filters import check, complete, Completion; print('lark' in sys.modules); "
    code += "assert not check('unit == 17') and complete('un', 2); print('lark' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("modbus.func_code in {3 4}", "function in (3, 4)"),
        ("modbus.func_code in {3, 4}", "function in (3, 4)"),
        ("mbrtu.unit_id == 17 && modbus.word_cnt > 2", "unit == 17 and quantity > 2"),
        ("mbtcp.unit_id in {1..5 7}", "unit in (1..5, 7)"),
        ("modbus.exception_code == 2 || frame.len > 64", "exception == 2 or length > 64"),
    ],
)
def test_what_wireshark_s_users_type_is_understood(theirs: str, ours: str) -> None:
    assert parsed(theirs) == parsed(ours)
