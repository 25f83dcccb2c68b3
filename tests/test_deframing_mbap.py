"""Modbus TCP in captures: frames by their headers, transactions, findings that apply, several protocols at once."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from buses import collect, proven
from hypothesis import given, settings
from hypothesis import strategies as st
from packets import Talk, mbap, pcap, read_answer, read_request

import captures
from analyzer.cli.app import main
from analyzer.core import analyse, deframe
from analyzer.deframing import mbap as mbap_engine
from analyzer.deframing.protocols import Deframer
from analyzer.options import Options
from analyzer.tables.batch import Frame
from analyzer.tables.findings import described
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes, lrc

LINE = LineSettings()
SECOND = 10**9


def capture(*said: tuple[float, bytes] | tuple[float, bytes, int]) -> Capture:
    """Reads: time in ms, bytes, port."""
    return Capture.of(LINE, [Chunk(SECOND + int(each[0] * 1e6), *each[1:]) for each in said])


def frames(capture: Capture) -> list[Frame]:
    return [frame for batch in deframe(capture) for frame in batch.frames()]


def codes(capture: Capture) -> list[str]:
    return [finding.code for part in analyse(capture) for finding in described(part.findings)]


def rtu(text: str) -> bytes:
    return bytes.fromhex(text) + crc_bytes(bytes.fromhex(text))


def test_frames_directions_and_response_times() -> None:
    found = frames(capture((0, read_request(1)), (12, read_answer(1)), (50, mbap(2, 1, b"\x83\x02")), (60, b"\0")))
    assert [(f.protocol, f.direction, f.crc_ok) for f in found] == [
        ("tcp", "request", None),
        ("tcp", "response", None),
        ("tcp", "response", None),
    ]
    assert found[1].request_start == 0 and found[1].response_time_ns == 12_000_000
    assert found[2].exception == 2
    assert found[1].to_json()["hex"] == read_answer(1).hex()
    assert [field.name for field in found[0].fields()][:4] == ["transaction", "protocol_id", "length", "unit"]


def test_transactions_that_overlap_are_paired_by_their_number() -> None:
    asked = [(i, read_request(i, start=i)) for i in range(6)]
    answered = [(20 + i, read_answer(5 - i)) for i in range(6)]
    found = frames(capture(*asked, *answered))
    assert [f.response_time_ns for f in found[6:]] == [(20 + i - (5 - i)) * 1_000_000 for i in range(6)]
    assert codes(capture(*asked, *answered)) == []


def test_a_write_and_its_echo() -> None:
    write = mbap(7, 1, bytes.fromhex("06000100FF"))
    found = frames(capture((0, write), (5, write), (20, mbap(8, 0, bytes.fromhex("050001FF00")))))
    assert [f.direction for f in found] == ["request", "response", "request"]
    assert found[1].request_start == 0


@pytest.mark.parametrize("unit", [0, 255])
def test_units_0_and_255_are_servers_like_any(unit: int) -> None:
    polls = [each for i in range(20) for each in ((i * 10, read_request(i, unit)), (i * 10 + 3, read_answer(i, unit)))]
    assert codes(capture(*polls)) == []


def test_what_nobody_answers_or_answers_twice_or_otherwise() -> None:
    polls = [each for i in range(4) for each in ((i * 10, read_request(i)), (i * 10 + 3, read_answer(i)))]
    assert codes(capture(*polls, (100, read_request(9)), (300, read_request(10)), (303, read_answer(10)))) == [
        "no-response",
        "retry",
    ]
    assert codes(capture(*polls, (100, read_answer(3)))) == ["duplicate-response"]
    assert codes(capture(*polls, (100, read_answer(77)))) == ["unexpected-response"]
    wrong = (100, read_request(5, count=3)), (103, read_answer(5)), (200, read_request(6)), (203, read_answer(6))
    assert "response-mismatch" in codes(capture(*polls, *wrong))


def test_no_finding_speaks_of_a_wire() -> None:
    line = LineSettings(baud=9600, char_bits=11)
    polls = [Chunk(SECOND + i * 10**5, read_request(i // 2) if i % 2 == 0 else read_answer(i // 2)) for i in range(900)]
    found = [finding.code for part in analyse(Capture.of(line, polls)) for finding in described(part.findings)]
    assert found == []


def test_what_is_cut_is_noise_and_the_next_frame_is_found() -> None:
    whole, cut = read_answer(1), read_answer(2)[:9]
    found = collect(list(deframe(capture((0, read_request(1)), (1, whole), (2, cut), (3, read_request(3))))))
    assert found.rows.length.tolist() == [12, len(whole), 9, 12]
    assert found.rows.kind.tolist() == [1, 2, 0, 1]


@pytest.mark.parametrize(
    "text",
    ["010300000002", "01030000000A", "011000000006" + "0C" + "030100020000000000000000", "000300100006"],
)
def test_rtu_that_begins_like_a_header_stays_rtu(text: str) -> None:
    head = rtu(text) * 3
    assert proven(head) == "rtu"
    assert {f.protocol for f in frames(capture((0, rtu(text)), (5, rtu("0103020019"))))} == {"rtu"}


PIECES = st.lists(
    st.one_of(
        st.builds(read_request, st.integers(0, 3), st.integers(0, 255), st.integers(0, 9)),
        st.builds(read_answer, st.integers(0, 3)),
        st.builds(lambda number, data: mbap(number, 1, b"\x65" + data), st.integers(0, 3), st.binary(max_size=30)),
        st.binary(max_size=30),
        st.just(bytes(5000)),
    ),
    min_size=1,
    max_size=12,
)


@given(PIECES, st.integers(1, 40))
@settings(deadline=None, max_examples=25)
def test_however_it_is_read_the_rows_are_the_same_and_tile(pieces: list[bytes], size: int) -> None:
    data = read_request(1) + b"".join(pieces)
    size = max(size, len(data) // 500)
    cuts = [data[i : i + size] for i in range(0, len(data), size)]
    one, many = (Deframer(LINE, Options(protocol="tcp")) for _ in range(2))
    at_once = collect([one.feed([Chunk(1, data)]), one.close()])
    by_reads = collect([*(many.feed(Chunk(1 + i, cut)) for i, cut in enumerate(cuts)), many.close()])
    for found in (at_once, by_reads):
        assert found.data == data
        assert (found.rows.start + found.rows.length)[:-1].tolist() == found.rows.start[1:].tolist()
    for name in ("start", "length", "kind", "unit", "function", "request"):
        assert at_once.rows.column(name).tolist() == by_reads.rows.column(name).tolist()


def test_a_pause_behind_a_frame_tells_its_end_whether_it_was_waited_for_or_not() -> None:
    """Behind the first frame stand two headers, one inside the other; only the pause tells which is whole."""
    begin = mbap(4, 5, bytes.fromhex("0240f5000e")) + bytes.fromhex("000500000006")
    end = bytes.fromhex("000500000006 0505125400000005")
    line = [Chunk(SECOND, begin + end[:6]), Chunk(2 * SECOND, end[6:] + read_request(6))]
    whole = list(deframe(Capture.of(LINE, line)))
    deframer, told = Deframer(LINE), []
    for chunk in line:
        told += [deframer.feed(chunk), deframer.tick(chunk.t_ns + SECOND // 2)]
    told.append(deframer.close())
    bounds = [[start for batch in batches for start in batch.rows.start.tolist()] for batches in (told, whole)]
    assert bounds[0] == bounds[1]


@given(st.data())
@settings(deadline=None, max_examples=40)
def test_three_protocols_on_three_ports_however_they_are_read(data: st.DataObject) -> None:
    body = bytes.fromhex("010300000001")
    spelt = b":" + (body + bytes((lrc(body),))).hex().upper().encode() + b"\r\n"
    said = [
        (i * 20, one, port) for i in range(6) for port, one in enumerate((rtu("010300100001"), read_request(i), spelt))
    ]
    chunks = [Chunk(SECOND + int(ms * 1e6) + port * 10**6, octets, port) for ms, octets, port in said]
    one, many = Deframer(LINE), Deframer(LINE)
    at_once = collect([one.feed(chunks), one.close()])
    cuts = data.draw(st.lists(st.integers(1, len(chunks) - 1), unique=True).map(sorted))
    parts = [chunks[low:high] for low, high in zip([0, *cuts], [*cuts, len(chunks)], strict=True)]
    by_reads = collect([*(many.feed(part) for part in parts), many.close()])
    assert at_once.rows.protocol.tolist() == [0, 2, 1] * 6
    for name in ("index", "start", "length", "kind", "protocol", "port", "t_start_ns"):
        assert at_once.rows.column(name).tolist() == by_reads.rows.column(name).tolist()


def test_few_stray_bytes_on_a_port_hold_the_others_for_seconds_at_most() -> None:
    deframer = Deframer(LINE)
    deframer.feed(Chunk(SECOND, b"\0", 1))
    given = [
        deframer.feed(Chunk((2 + i) * SECOND, rtu("010300100001"), 0), (2 + i) * SECOND + SECOND // 2) for i in range(6)
    ]
    assert sum(map(len, given)) > 4


def test_a_text_of_two_protocols_gives_each_its_port(tmp_path: Path) -> None:
    log = tmp_path / "gateway.log"
    answer = rtu("0103020019").hex(" ")
    log.write_text(f"TX {rtu('010300100001').hex(' ')}\nRX {answer}\nTCP {read_request(1).hex(' ')}\nRX {answer}\n")
    from analyzer.paste import judge

    opened = captures.open(log, judge=judge)
    assert opened.line.notes["protocols"] == "rtu,tcp"
    assert [(f.protocol, f.port) for f in frames(opened)] == [("rtu", 0), ("rtu", 0), ("rtu", 0), ("tcp", 1)]


def test_one_frame_of_ascii_mode_or_of_tcp_is_enough() -> None:
    body = bytes.fromhex("01030000000A")
    spelt = b":" + (body + bytes((lrc(body),))).hex().upper().encode() + b"\r"
    assert [f.protocol for f in frames(capture((0, spelt)))] == ["ascii"]
    assert [f.protocol for f in frames(capture((0, read_request(0))))] == ["tcp"]


def test_every_way_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, two = Talk().begin(), Talk(client=("10.0.0.2", 4000)).begin()
    for number in range(8):
        one.ask(read_request(number)).answer(read_answer(number))
        two.ask(read_request(100 + number, unit=3)).answer(read_answer(100 + number, unit=3))
    path = tmp_path / "net.pcap"
    path.write_bytes(pcap(sorted(one.packets + two.packets)))
    assert main(["export", str(path), "--format", "jsonl", "-o", "-"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) == 32 and {line["protocol"] for line in lines} == {"tcp"}
    assert all(line["crc_ok"] is None for line in lines)
    assert sum(line["response_time_ns"] == 2_000_000 for line in lines) == 16
    assert {line.get("port", 0) for line in lines} == {0, 1}
    assert main(["export", str(path), "--format", "csv", "-o", "-"]) == 0
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert [row["hex"].replace(" ", "").lower() for row in rows] == [line["hex"] for line in lines]
    assert {(row["protocol"], row["crc_ok"]) for row in rows} == {("tcp", "")}
    for name in ("out.mcap", "out.pcapng"):
        out = tmp_path / name
        assert main(["export", str(path), "-o", str(out)]) == 0
        assert main(["export", str(out), "--format", "jsonl", "-o", "-"]) == 0
        assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == lines
    assert b"mbtcp" in (tmp_path / "out.pcapng").read_bytes()
    assert main(["export", str(path), "--format", "jsonl", "-o", "-", "--filter", "protocol == tcp and unit == 3"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 16
    assert main(["report", str(path)]) == 0
    assert "CRC" not in capsys.readouterr().out


def test_functions_that_nobody_knows_cost_no_more_each_the_more_there_are(monkeypatch):
    """Behind each header the whole rest of the stream was searched for a better one."""
    looked = []

    def no_roles(pdu):
        looked.append(pdu)
        return ()

    monkeypatch.setattr(mbap_engine, "sound_roles", no_roles)
    count = 300
    stream = b"".join(bytes((0, n % 256, 0, 0, 0, 6, 0x11, 0x63, 0, 1, 0, 1)) for n in range(count))
    mbap_engine.frames_in(stream, last=True)
    assert count <= len(looked) <= 8 * count
