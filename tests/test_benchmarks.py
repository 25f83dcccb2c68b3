"""The benchmarks run from end to end, and their bus is what they say it is.

What a capture tells does not hang on how it is fed: a few streams of each kind of `benchmarks/feeding`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from random import Random

import pytest
from running import PATIENCE_S, ROOT, environment
from scripts import package, script

bus = script("bus")


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="a process's own CPU time is not to be had on this system")
def test_the_quick_comparison_says_what_it_measured_and_what_is_absent(tmp_path):
    figures = tmp_path / "figures.json"
    command = [sys.executable, ROOT / "benchmarks" / "compare.py", "--quick", "--frames", "400", "--json", figures]
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment(PATH=str(tmp_path)), timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(figures.read_text())
    assert {"tshark": "tshark is not installed", "sigrok": "sigrok-cli is not installed"}.items() <= said[
        "absent"
    ].items()
    assert "tshark (tshark is not installed)" in done.stdout
    jobs = {(job["section"], job["tool"]): job for job in said["jobs"]}
    assert not [job for job in said["jobs"] if "failed" in job]
    assert {section for section, _ in jobs} >= {"columns", "mcap", "jsonl", "csv", "pcapng"}
    assert jobs["columns", "rtuscope, from MCAP"]["peak"] > jobs["columns", "rtuscope, from MCAP"]["cpu"] > 0
    ours = [one for one in said["accuracy"] if one["tool"].startswith("rtuscope")]
    assert [(one["frames"], one["false"], one["direction"], one["pairs"]) for one in ours] == [(1, 0, 1, 1)] * 2
    assert len(said["hard"]) > 5
    assert "nothing of speed" in done.stdout


def frames(count, seed=1):
    found = []
    for made in bus.slices(count, seed):
        at = 0
        for size, t_ns, pair in zip(made.sizes.tolist(), made.t_ns.tolist(), made.pair.tolist(), strict=True):
            found.append((made.data[at : at + size].tobytes(), t_ns, pair))
            at += size
    return found


def test_a_small_corpus_is_the_head_of_a_large_one():
    few, more = frames(500), frames(50_000)
    assert len(more) == 50_000
    assert more[:500] == few
    assert frames(500, seed=2) != few


def test_answers_fit_their_requests_and_values_change():
    told = frames(20_000)
    answered = [(told[pair][0], frame) for frame, _, pair in told if pair >= 0]
    assert all(request[0] == answer[0] and request[1] == answer[1] & 0x7F for request, answer in answered)
    registers = [answer for request, answer in answered if answer[1] in (3, 4)]
    assert len(set(registers)) > 0.9 * len(registers)


@pytest.mark.skipif(os.name != "posix", reason="ptys are POSIX")
def test_the_interface_s_benchmark_tells_its_arguments():
    command = [sys.executable, "-m", "benchmarks.interface", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment(), timeout=PATIENCE_S)
    assert done.returncode == 0 and "[FRAMES] [CAPTURE]" in done.stdout, done.stderr


def test_every_script_tells_its_arguments():
    scripts = {path.name: path.read_text() for path in (ROOT / "benchmarks").glob("*.py")}
    runs = {name for name, text in scripts.items() if '__name__ == "__main__"' in text}
    assert "score_corpus.py" in runs
    assert [name for name in sorted(runs) if "ArgumentParser(" not in scripts[name]] == []


KINDS = list(package("feeding.streams").KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_at_once_read_by_read_byte_by_byte_and_live_tell_the_same(kind: str) -> None:
    for seed in range(2):
        stream = package("feeding.streams").stream(kind, seed)
        assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("one-port", 10363),
        ("one-port", 320195),
        ("one-port", 320295),
        ("cut-anywhere", 10009),
        ("cut-anywhere", 10238),
        ("cut-anywhere", 310156),
    ],
)
def test_a_run_ends_only_where_the_lattice_would_decide_too(kind: str, seed: int) -> None:
    """Streams of the campaign on which a run of frames was taken and the lattice, live, had not decided so far."""
    stream = package("feeding.streams").stream(kind, seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize(("kind", "seed"), [("gateway", 300100), ("gateway", 300161), ("vendor", 310026)])
def test_what_is_noise_does_not_hang_on_where_a_look_begins(kind: str, seed: int) -> None:
    """Streams of the campaign: a damaged frame behind one decided or on the same path; a function heard just before."""
    stream = package("feeding.streams").stream(kind, seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize("seed", [40039, 40116, 40136])
def test_what_modbus_tcp_leaves_open_is_told_when_it_is_settled(seed: int) -> None:
    """Streams of the campaign: the answer to a request that another overtook, and directions of two ports."""
    stream = package("feeding.streams").stream("tcp", seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


def test_a_breach_is_seen() -> None:
    """The comparison itself: a row that is another is told."""
    ways = package("feeding.ways")
    told = ways.at_once(package("feeding.streams").stream("one-port", 1))
    other = ways.Told(told.rows.copy(), told.transactions, told.findings[:0])
    other.rows.start[:] += 1
    assert len(list(ways._differences(told, other, set()))) >= 1 + bool(len(told.findings))


@pytest.mark.parametrize("seed", [1000021, 1001243])
def test_transactions_over_tcp_pair_by_what_stands_before_them_and_in_them(seed: int) -> None:
    """A connection asks from its first request on; a frame too short to say what it asks is answered by nothing."""
    stream = package("feeding.streams").stream("tcp", seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []


@pytest.mark.parametrize(("kind", "seed"), [("outages", seed) for seed in (88, 99, 122, 132)])
def test_an_outage_told_when_it_comes_says_what_one_known_before_says(kind: str, seed: int) -> None:
    """Many notes, and a loss that is noted when the frame that it cut was judged."""
    stream = package("feeding.streams").stream(kind, seed)
    assert list(package("feeding.ways").breaches(stream, Random(seed))) == []
