"""`rtuscope convert`: the same reads in another format, cut by time, frames and filter, merged, shifted."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from running import ran, refused

import captures
from captures import Capture, Chunk, LineSettings, Mark
from captures.editing import cut_to_spans, merged
from captures.recording.notes import Note
from dissectors.crc import crc_bytes

LINE = LineSettings(baud=9600, char_bits=11, parity="E", notes={"site": "pump"})
BEGIN = 1_700_000_000_000_000_000  # 2023-11-14T22:13:20Z
FILES = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def rtu(text: str) -> bytes:
    return bytes.fromhex(text) + crc_bytes(bytes.fromhex(text))


ASK, ANSWER = rtu("010300100001"), rtu("0103020019")


def polls(count: int, begin: int = BEGIN, port: int = 0) -> list[Chunk]:
    steps = [(begin + i * 10**9, i) for i in range(count)]
    return [c for t, _ in steps for c in (Chunk(t, ASK, port, Mark.TX), Chunk(t + 10**7, ANSWER, port, Mark.RX))]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    captures.write("bus.jsonl", polls(10), line=LINE)


def chunks(name: str) -> list[Chunk]:
    return list(captures.open(name).chunks())


READS = st.lists(
    st.builds(
        Chunk,
        st.integers(BEGIN, BEGIN + 10**12),
        st.binary(min_size=1, max_size=9),
        st.integers(0, 3),
        st.sampled_from(Mark),
    ),
    min_size=1,
    max_size=20,
).map(lambda reads: sorted(reads, key=lambda chunk: chunk.t_ns))


@given(READS, st.sampled_from(["jsonl", "mcap", "pcapng"]), st.sampled_from(["jsonl", "mcap", "pcapng"]))
@FILES
def test_nothing_is_lost_from_format_to_format(tmp_path: Path, reads: list[Chunk], one: str, two: str) -> None:
    first, second = tmp_path / f"one.{one}", tmp_path / f"two.{two}"
    captures.write(first, reads, line=LINE)
    from analyzer.cli.app import main

    assert main(["convert", str(first), "-o", str(second), "--overwrite"]) == 0
    before, after = captures.open(first), captures.open(second)
    assert list(after.chunks()) == list(before.chunks()) == reads
    assert after.line == before.line


@pytest.mark.usefixtures("folder")
def test_the_same_file_comes_back(capsys: pytest.CaptureFixture[str]) -> None:
    captures.write("plain.jsonl", [Chunk(c.t_ns, c.data) for c in polls(20)], line=LINE)
    for name in ("a.mcap", "b.pcapng", "c.jsonl"):
        assert ran(capsys, "convert", "plain.jsonl", "-o", name).status == 0
        assert ran(capsys, "convert", name, "-o", "back.jsonl", "--overwrite").status == 0
        assert Path("back.jsonl").read_bytes() == Path("plain.jsonl").read_bytes()


@pytest.mark.usefixtures("folder")
def test_hex_text_keeps_bytes_times_and_marks_and_says_what_it_lacks(capsys: pytest.CaptureFixture[str]) -> None:
    run = ran(capsys, "convert", "bus.jsonl", "-o", "bus.txt")
    assert "cannot store the line's settings" in run.err
    assert (
        Path("bus.txt").read_text(encoding="utf-8").splitlines()[0]
        == f"2023-11-14T22:13:20.000000000Z TX {ASK.hex(' ')}"
    )
    assert chunks("bus.txt") == polls(10)
    assert "times and direction marks" in ran(capsys, "convert", "bus.jsonl", "-o", "bus.bin").err
    assert Path("bus.bin").read_bytes() == (ASK + ANSWER) * 10


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("begin", "end", "kept"),
    [
        ("2s", "4s", range(2, 5)),
        ("2.5", "1min", range(3, 10)),
        ("22:13:25", None, range(5, 10)),
        (None, "2023-11-14T22:13:22Z", range(3)),
        ("2023-11-14 23:13:23+01:00", "2023-11-14T22:13:23.5", range(3, 4)),
    ],
)
def test_times(capsys: pytest.CaptureFixture[str], begin: str | None, end: str | None, kept: range) -> None:
    words = [word for flag, text in (("--from", begin), ("--to", end)) if text for word in (flag, text)]
    assert ran(capsys, "convert", "bus.jsonl", "-o", "part.jsonl", "--tz", "UTC", *words).status == 0
    asked = [chunk.t_ns for chunk in chunks("part.jsonl") if chunk.data == ASK]
    assert asked == [BEGIN + i * 10**9 for i in kept]


@pytest.mark.usefixtures("folder")
def test_frames_by_number_cut_reads_that_hold_more(capsys: pytest.CaptureFixture[str]) -> None:
    captures.write("joined.jsonl", [Chunk(BEGIN + i * 10**9, ASK + ANSWER) for i in range(5)], line=LINE)
    assert ran(capsys, "convert", "joined.jsonl", "-o", "part.jsonl", "--frames", "1..4").status == 0
    assert [chunk.data for chunk in chunks("part.jsonl")] == [ANSWER, ASK + ANSWER, ASK]
    assert ran(capsys, "convert", "joined.jsonl", "-o", "one.jsonl", "--frames", "3").status == 0
    assert [chunk.data for chunk in chunks("one.jsonl")] == [ANSWER]
    assert ran(capsys, "convert", "joined.jsonl", "-o", "none.jsonl", "--frames", "77").status == 1


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    "words", [("--start", "500s"), ("--end", "2000-01-01T00:00Z"), ("--frames", "770"), ("--around", "unit == 9")]
)
def test_where_nothing_is_kept_what_has_the_name_stays(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    good = Path("part.jsonl")
    assert ran(capsys, "convert", "bus.jsonl", "-o", str(good)).status == 0
    before = good.read_bytes()
    run = ran(capsys, "convert", "bus.jsonl", "-o", str(good), "--overwrite", *words)
    assert run.status == 1 and good.read_bytes() == before
    assert "part.jsonl: not written: nothing is kept of the capture, which lasts" in run.err
    assert ran(capsys, "convert", "bus.jsonl", "-o", "new.jsonl", *words).status == 1
    assert not Path("new.jsonl").exists()


@pytest.mark.usefixtures("folder")
def test_around_what_passes(capsys: pytest.CaptureFixture[str]) -> None:
    refusal = rtu("018302")
    said = [Chunk(c.t_ns, refusal if i in (7, 15) else c.data) for i, c in enumerate(polls(10))]
    captures.write("bad.jsonl", said, line=LINE)
    run = ran(capsys, "convert", "bad.jsonl", "-o", "near.jsonl", "--around", "exception", "--seconds", "1.2")
    assert run.status == 0
    asked = [(chunk.t_ns - BEGIN) // 10**9 for chunk in chunks("near.jsonl") if chunk.data == ASK]
    assert asked == [2, 3, 4, 6, 7, 8]
    assert ran(capsys, "convert", "bad.jsonl", "-o", "none.jsonl", "--around", "unit == 9").status == 1


@pytest.mark.usefixtures("folder")
def test_merged_by_time_with_names_and_mended_clocks(capsys: pytest.CaptureFixture[str]) -> None:
    captures.write("other.jsonl", polls(10, BEGIN + 5 * 10**8 - 10**10), line=LINE)
    words = ["bus.jsonl", "other.jsonl", "-o", "both.mcap", "--port", "plc", "--port", "meter", "--shift", "2=+10s"]
    assert ran(capsys, "convert", *words).status == 0
    both = captures.open("both.mcap")
    reads = list(both.chunks())
    assert [chunk.t_ns for chunk in reads] == sorted(chunk.t_ns for chunk in reads)
    assert [chunk.port for chunk in reads] == [0, 0, 1, 1] * 10
    assert (both.line.baud, both.line.notes["port 0"], both.line.notes["port 1"]) == (9600, "plc", "meter")


@pytest.mark.usefixtures("folder")
def test_a_merge_tells_which_settings_it_leaves_out(capsys: pytest.CaptureFixture[str]) -> None:
    captures.write("other.jsonl", polls(2), line=LineSettings(baud=19200, char_bits=11, parity="O"))
    done = ran(capsys, "convert", "bus.jsonl", "other.jsonl", "-o", "both.mcap")
    assert (done.status, captures.open("both.mcap").line.baud) == (0, None)
    assert "differ in --baud, --parity;" in done.err


@given(st.lists(READS, min_size=1, max_size=4))
@settings(max_examples=40, deadline=None)
def test_a_merge_holds_every_read_once_in_each_ones_order(several: list[list[Chunk]]) -> None:
    made = merged([Capture.of(LINE, reads) for reads in several])
    found = [chunk for block in made.blocks(16) for chunk in map(block.chunk, range(len(block)))]
    first = 0
    for reads in several:
        ports = max(chunk.port for chunk in reads) + 1
        mine = [(c.t_ns, c.data, c.port - first, c.mark) for c in found if first <= c.port < first + ports]
        assert mine == [(c.t_ns, c.data, c.port, c.mark) for c in reads]
        first += ports
    assert [c.t_ns for c in found] == sorted(c.t_ns for c in found)


@given(st.data(), READS)
@settings(max_examples=40, deadline=None)
def test_spans_are_bytes_of_a_ports_stream(data: st.DataObject, reads: list[Chunk]) -> None:
    marked = [Chunk(c.t_ns, c.data, c.port, c.mark, (len(c.data) - 1,)) for c in reads]
    begin = data.draw(st.integers(0, 40))
    end = data.draw(st.integers(begin, 60))
    kept = list(cut_to_spans(Capture.of(LINE, marked), {1: [(begin, end)]}).chunks())
    stream = b"".join(chunk.data for chunk in marked if chunk.port == 1)
    assert b"".join(chunk.data for chunk in kept) == stream[begin:end]
    whole = [c for c in marked if c.port == 1]
    assert all(chunk.errors in ((), (len(chunk.data) - 1,)) for chunk in kept)
    if begin == 0 and end >= len(stream):
        assert kept == whole
    block = next(iter(Capture.of(LINE, marked).blocks()))
    back = block.taken(__import__("numpy").arange(len(block))[::-1])
    assert [back.chunk(i) for i in range(len(back))] == marked[::-1]


def test_notes_go_along_and_are_shifted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from captures.formats import by_name

    source = tmp_path / "rec.mcap"
    capture = Capture.of(LINE, polls(5))
    with source.open("wb") as file:
        write = by_name("mcap").write
        assert write is not None
        write(file, LINE, capture.blocks(), True, notes=[Note(BEGIN + 10**9, "lost", "unplugged")])
    out = tmp_path / "out.pcapng"
    assert ran(capsys, "convert", str(source), "-o", str(out), "--shift=-1s").status == 0
    assert captures.open(out).notes() == [Note(BEGIN, "lost", "unplugged")]
    run = ran(capsys, "convert", str(source), "-o", str(tmp_path / "out.jsonl"))
    assert "cannot store notes" in run.err


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["bus.jsonl", "-o", "bus.jsonl"], "is the capture being read"),
        (["bus.jsonl", "-o", "there.jsonl"], "already exists"),
        (["bus.jsonl", "-o", "x.csv"], "no format writes"),
        (["bus.jsonl", "-o", "x.jsonl", "--frames", "9..3"], "--frames 9..3"),
        (["bus.jsonl", "-o", "x.jsonl", "--from", "yesterday"], "--start yesterday"),
        (["bus.jsonl", "-o", "x.jsonl", "--from", "5s", "--to", "2s"], "is later than"),
        (["bus.jsonl", "-o", "x.jsonl", "--shift", "3=1s"], "that of an IN"),
        (["bus.jsonl", "-o", "x.jsonl", "--seconds", "3"], "needs --around"),
        (["bus.jsonl", "-o", "x.jsonl", "--around", "nonsense =="], "--around"),
        (["bus.jsonl", "-o", "-", "--to-format", "pcap"], "can be read, but not written"),
        (["raw.bin", "-o", "x.jsonl", "--from", "1s"], "has no times"),
        (["raw.bin", "bus.jsonl", "-o", "x.jsonl"], "has no times"),
    ],
)
def test_what_cannot_be_done_is_said(capsys: pytest.CaptureFixture[str], words: list[str], said: str) -> None:
    Path("there.jsonl").write_text("precious")
    Path("raw.bin").write_bytes(ASK + ANSWER)
    assert said in refused(capsys, "convert", *words)
    assert Path("there.jsonl").read_text(encoding="utf-8") == "precious"
    assert not Path("x.jsonl").exists()


@pytest.mark.usefixtures("folder")
def test_standard_output_gets_reads(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    from analyzer.cli.app import main

    assert main(["convert", "bus.jsonl", "-o", "-"]) == 0
    lines = capfdbinary.readouterr().out.splitlines()
    assert json.loads(lines[0])["format"] == "serial-chunks" and len(lines) == 21
