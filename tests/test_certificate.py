"""`rtuscope certify`: bounds are exact, verdicts follow from counts, and a count that carries none gives none."""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from running import ran, refused

from analyzer.cli import main
from analyzer.reports.certificate import certify, default_limits, load_limits
from analyzer.reports.certificate.bounds import (
    at_most,
    below,
    quantile_ranks,
    share_bounds,
    trials_for_quantile,
    trials_for_share,
)
from analyzer.reports.certificate.claims import FAIL, MARGINAL, PASS, UNKNOWN, Claim, worst
from analyzer.reports.certificate.limits import ClaimLimit
from analyzer.reports.certificate.model import not_shown
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture
from captures.line import LineSettings
from dissectors.crc import crc_bytes


def _summed(hits: int, of: int, share: float) -> float:
    return math.fsum(math.comb(of, k) * share**k * (1 - share) ** (of - k) for k in range(hits + 1))


@given(st.integers(1, 300), st.floats(0.0, 1.0), st.floats(0.001, 0.999))
@settings(max_examples=40, deadline=None)
def test_tails_are_those_of_the_binomial(of: int, part: float, share: float) -> None:
    hits = round(part * of)
    assert at_most(hits, of, share) == pytest.approx(_summed(hits, of, share), abs=1e-9)


@given(st.integers(1, 5000), st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_each_bound_leaves_half_of_the_rest(of: int, part: float) -> None:
    hits = round(part * of)
    low, high = share_bounds(hits, of, 0.95)
    assert 0 <= low <= hits / of <= high <= 1
    if hits:
        assert 1 - below(hits, of, low) == pytest.approx(0.025, abs=1e-6)
    if hits < of:
        assert below(hits, of, high) == pytest.approx(0.025, abs=1e-6)


@pytest.mark.parametrize(("hits", "of"), [(0, 10), (1, 10), (5, 10), (10, 10), (3, 250)])
def test_what_was_seen_counts_half_beyond_a_bound(hits: int, of: int) -> None:
    low, high = share_bounds(hits, of, 0.95)
    under = {
        share: (_summed(hits - 1, of, share) + _summed(hits, of, share)) / 2 for share in (low, high) if 0 < share < 1
    }
    assert under.get(low, 0.975) == pytest.approx(0.975, abs=1e-9)
    assert under.get(high, 0.025) == pytest.approx(0.025, abs=1e-9)


def test_three_in_so_many_is_the_bound_of_none() -> None:
    """The rule of three: Hanley and Lippman-Hand 1983."""
    assert share_bounds(0, 1000, 0.95) == pytest.approx((0, 0.003), abs=1e-5)
    assert trials_for_share(1e-4, 0.95) == 29_956
    assert trials_for_quantile(0.99, 0.95) == 299


@pytest.mark.parametrize("expected", [5, 20, 200])
def test_bounds_hold_so_often_as_they_say(expected: int) -> None:
    """Over shares about one, by the chances of all counts."""
    held, of = [], 20_000
    bounds = {hits: share_bounds(hits, of, 0.95) for hits in range(2 * expected + 30)}
    for step in range(40):
        share = expected * (0.7 + 0.6 * step / 40) / of
        within = [hits for hits, (low, high) in bounds.items() if low <= share <= high]
        held.append(at_most(within[-1], of, share) - at_most(within[0] - 1, of, share))
    assert math.fsum(held) / len(held) == pytest.approx(0.95, abs=0.01)


def test_a_million_exchanges_are_bounded_as_well() -> None:
    low, high = share_bounds(100_000, 1_000_000, 0.95)
    assert low == pytest.approx(0.1 - 1.96 * 3e-4, abs=2e-6) and high == pytest.approx(0.1 + 1.96 * 3e-4, abs=2e-6)


@given(st.floats(1e-6, 0.2), st.floats(0.8, 0.999))
@settings(max_examples=40, deadline=None)
def test_so_many_are_needed_and_not_one_less(limit: float, confidence: float) -> None:
    needed = trials_for_share(limit, confidence)
    assert share_bounds(0, needed, confidence)[1] <= limit * (1 + 1e-9)
    assert needed == 1 or share_bounds(0, needed - 1, confidence)[1] > limit * (1 - 1e-9)


@pytest.mark.parametrize("quantile", [0.5, 0.9, 0.99])
def test_ranks_bound_a_quantile_in_so_many_of_a_hundred(quantile: float) -> None:
    needed = trials_for_quantile(quantile, 0.95)
    assert quantile_ranks(needed, quantile, 0.95)[1] == needed
    assert quantile_ranks(needed - 1, quantile, 0.95)[1] is None
    low, high = quantile_ranks(2000, quantile, 0.95)
    assert low is not None and high is not None
    random, held = Random(5), 0
    for _ in range(200):
        below = sum(random.random() < quantile for _ in range(2000))  # values under the true quantile
        held += low <= below < high
    assert held >= 180


def _claim(hits: int, of: int) -> Claim:
    limit = ClaimLimit(0.001, 0.01)
    low, high = share_bounds(hits, of, 0.95)
    return Claim("lost", 1, limit, hits / of, low, high, trials_for_share(0.001, 0.95), of, hits)


@pytest.mark.parametrize(
    ("hits", "of", "verdict"),
    [(0, 2995, PASS), (0, 2994, UNKNOWN), (1, 2995, MARGINAL), (8, 2000, MARGINAL), (1, 200, UNKNOWN), (60, 2000, FAIL),
     (200, 200, FAIL), (3, 10_000, PASS)],
)  # fmt: skip
def test_a_verdict_is_what_the_count_carries(hits: int, of: int, verdict: str) -> None:
    assert _claim(hits, of).verdict == verdict


def test_the_worst_verdict_is_the_line_s() -> None:
    assert worst([PASS, UNKNOWN, MARGINAL]) == MARGINAL and worst([PASS, FAIL]) == FAIL
    assert worst([PASS, UNKNOWN]) == UNKNOWN and worst([]) == UNKNOWN


def _frame(*body: int) -> bytes:
    data = bytes(body)
    return data + crc_bytes(data)


def bus(
    path: Path, polls: int, *, silent: frozenset[int] = frozenset(), refused_by: int = 0, open_end: bool = False
) -> Path:
    """Units 1 and 2, asked in turn at 19200 8E1; requests to unit 2 of these numbers stay without an answer."""
    lines = [json.dumps({"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11})]
    character, t_ns = 572_917, 1_700_000_000_000_000_000
    for number in range(polls):
        for unit in (1, 2):
            last = number == polls - 1 and unit == 2
            silence = (unit == 2 and number in silent) or (last and open_end)
            asked = _frame(unit, 3, 0, 10, 0, 2)
            answer = _frame(unit, 0x83, 2) if unit == refused_by else _frame(unit, 3, 4, 0, number % 250, 1, 2)
            for data, pause in ((asked, 2_500_000), (b"" if silence else answer, 20_000_000)):
                t_ns += pause + len(data) * character
                if data:
                    lines.append(json.dumps({"t_ns": t_ns, "hex": data.hex()}))
            t_ns += 200_000_000 if silence else 0
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def loose(tmp_path: Path) -> Path:
    """Limits that 300 exchanges can pass."""
    path = tmp_path / "limits.toml"
    path.write_text("".join(f"[{claim}]\npass = 0.05\nfail = 0.2\n" for claim in ("lost", "damaged", "retries")))
    with path.open("a") as file:
        file.write("[response]\nquantile = 0.9\npass_ms = 50\n[load]\nquantile = 0.5\n")
    return path


def test_a_healthy_line_passes_and_names_what_it_rests_on(
    tmp_path: Path, loose: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = bus(tmp_path / "bus.jsonl", 300, open_end=True)
    loose.write_text(loose.read_text() + "[exceptions]\npass = 0.05\n")
    done = ran(capsys, "certify", str(path), "--limits", str(loose), "--json", "--check")
    told = json.loads(done.out)
    assert told["verdict"] == "pass" and done.status == 0
    assert told["capture_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    lost = {claim["unit"]: claim for claim in told["claims"] if claim["claim"] == "lost"}
    assert (lost[None]["seen"], lost[1]["seen"], lost[2]["seen"]) == (599, 300, 299)  # the last one is open
    assert lost[2]["needed"] == 59 and lost[2]["value"] == 0 and 0 < lost[2]["high"] < 0.05
    (times,) = (claim for claim in told["claims"] if claim["claim"] == "response" and claim["unit"] == 1)
    assert times["low"] <= 20_000_000 <= times["high"] < 21_000_000


def test_what_is_wrong_with_one_unit_is_said_of_that_unit(
    tmp_path: Path, loose: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = bus(tmp_path / "bus.jsonl", 300, silent=frozenset(range(0, 300, 10)), refused_by=1)
    done = ran(capsys, "certify", str(path), "--limits", str(loose), "--json", "--check")
    told = json.loads(done.out)
    verdicts = {(claim["claim"], claim["unit"]): claim["verdict"] for claim in told["claims"]}
    assert done.status == 1 and told["verdict"] == "fail"
    assert verdicts["exceptions", 1] == "fail" and verdicts["lost", 1] == "pass"
    assert verdicts["lost", 2] == "marginal" and verdicts["exceptions", 2] != "fail"


def test_a_short_capture_says_that_it_cannot_say(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = bus(tmp_path / "bus.jsonl", 20)
    page = ran(capsys, "certify", str(path)).out
    assert "**CANNOT SAY.**" in page and "2,995 / 20" in page and "cannot say; needs" in page
    assert "| signature |" in page
    page = ran(capsys, "certify", str(path), "--lang", "ru").out
    assert "**НЕ УСТАНОВЛЕНО.**" in page and "подпись" in page


def test_losses_in_bursts_are_said_to_be_no_independent_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    apart = bus(tmp_path / "apart.jsonl", 60, silent=frozenset(range(0, 60, 10)))
    burst = bus(tmp_path / "burst.jsonl", 60, silent=frozenset(range(20, 26)))
    dead = bus(tmp_path / "dead.jsonl", 60, silent=frozenset(range(60)))
    for path, said in ((apart, False), (burst, True), (dead, False)):
        assert ("lost in bursts, 6 on end at unit 2" in ran(capsys, "certify", str(path)).out) == said


def test_the_page_is_whole_and_a_hostile_name_is_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = bus(tmp_path / "a|<b>x.jsonl", 20)
    out = tmp_path / "page.html"
    assert ran(capsys, "certify", str(path), "--html", str(out)).status == 0
    page = out.read_text(encoding="utf-8")
    assert "size: A4" in page and "a|&lt;b&gt;x.jsonl" in page and "<b>x" not in page and "<script" not in page
    assert "already exists" in refused(capsys, "certify", str(path), "--html", str(out))
    assert r"a\|\<b\>x.jsonl" in ran(capsys, "certify", str(path)).out


def test_a_capture_without_times_has_no_response_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "raw.bin"
    path.write_bytes((_frame(1, 3, 0, 10, 0, 2) + _frame(1, 3, 4, 0, 1, 1, 2)) * 30)
    told = json.loads(ran(capsys, "certify", str(path), "--json").out)
    (times,) = (claim for claim in told["claims"] if claim["claim"] == "response" and claim["unit"] is None)
    assert times["verdict"] == "unknown" and times["value"] is None and times["seen"] == 0
    assert any("no times" in sentence for sentence in told["not_shown"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[lots]\npass = 1", "did you mean lost?"),
        ("[lost]\npas = 1", "no key 'pas'"),
        ("[lost]\npass = 2", "must be a number from"),
        ("[lost]\npass = true", "must be a number from"),
        ("lost = 1", "must be a table"),
        ("[lost]\npass = 0.1\nfail = 0.01", "fail is lower than pass"),
        ("[unit.300.lost]\npass = 0.1", "a unit must be a number"),
        ("[unit.1.load]\npass = 0.1", "the load belongs to the line"),
        ("unit = 3", "must hold a table for each unit"),
        ("confidence = 2", "must be a number from"),
        ("[[", "is not a TOML file"),
    ],
)
def test_limits_that_cannot_be_are_refused_in_one_line(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "limits.toml").write_text(text)
    assert said in refused(capsys, "certify", str(tmp_path / "bus.jsonl"), "--limits", str(tmp_path / "limits.toml"))


def test_limits_are_those_of_the_file_and_else_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "limits.toml"
    path.write_text("confidence = 0.9\n[lost]\npass = 0.02\n[response]\npass_ms = 80\n[unit.17.lost]\npass = 0.05\n")
    limits, usual = load_limits(path), default_limits()
    assert limits.of("lost", 1).passes == 0.02 and limits.of("lost", 17).passes == 0.05
    assert limits.of("lost", 1).fails == 0.02 and limits.confidence == 0.9  # never under what passes
    assert limits.of("response", None).passes == 80_000_000
    assert limits.of("retries", 17) == usual.of("retries", None)


def test_no_frame_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "none.jsonl"
    path.write_text(
        '{"format": "serial-chunks", "version": 1, "baud": 9600, "char_bits": 11}\n{"t_ns": 5, "hex": "00"}\n'
    )
    assert main(["certify", str(path)]) == 1
    assert "no Modbus frame" in capsys.readouterr().err
    assert LineSettings(baud=9600, char_bits=11).character_ns


def test_what_the_tap_lost_fails_no_line() -> None:
    made = field_cases()["tap-loses"].capture("precise", 6)
    certificate = certify(Capture.of(made.line, made.chunks), default_limits())
    spoilt = [claim for claim in certificate.claims if claim.claim in ("lost", "damaged") and claim.hits]
    assert spoilt and {claim.verdict for claim in spoilt} == {UNKNOWN}
    assert certificate.verdict == UNKNOWN and not any(map(certificate.longer_ns, spoilt))
    assert any("the tap's doing" in sentence for sentence in not_shown(certificate))
