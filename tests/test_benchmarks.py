"""The benchmarks run from end to end, and their bus is what they say it is."""

import json
import os
import subprocess
import sys

import pytest
from running import ROOT, environment
from scripts import script

bus = script("bus")


@pytest.mark.skipif(not hasattr(os, "wait4"), reason="a process's own CPU time is not to be had on this system")
def test_the_quick_comparison_says_what_it_measured_and_what_is_absent(tmp_path):
    figures = tmp_path / "figures.json"
    command = [sys.executable, ROOT / "benchmarks" / "compare.py", "--quick", "--frames", "400", "--json", figures]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(PATH=str(tmp_path)), timeout=120)
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
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment(), timeout=60)
    assert done.returncode == 0 and "[FRAMES] [CAPTURE]" in done.stdout, done.stderr
