"""Documents in place of a capture: a page of HTML, and packets that Wireshark wrote out as PDML or as JSON."""

from __future__ import annotations

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
from packets import Talk, pcap, read_answer, read_request
from running import ran, refused

import captures
from analyzer.paste import judge
from captures import Capture, Mark
from dissectors.crc import crc_bytes

TSHARK = shutil.which("tshark")
ASK, ANSWER = (body + crc_bytes(body) for body in map(bytes.fromhex, ("210400120002", "21040401c20037")))
PAGE = """<!DOCTYPE html>
<html><head><meta charset="utf-8"><title>Port 7</title><style>td {{ color: #01 02 03 04 }}</style></head><body>
<h2>Session</h2><table>
<tr><td>10:00:01.000</td><td>Write</td><td>{}</td></tr>
<tr><td>10:00:01.050</td><td>Read</td><td>{}</td></tr>
<tr><td>10:00:01.400</td><td>Write</td><td>{}</td></tr>
</table></body></html>
"""


def opened(folder: Path, name: str, content: str | bytes) -> Capture:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return captures.open(path, judge=judge)


def talk() -> Talk:
    made = Talk().begin()
    for number in range(3):
        made.ask(read_request(number)).answer(read_answer(number))
    return made


SAID = [part for n in range(3) for part in ((Mark.TX, read_request(n)), (Mark.RX, read_answer(n)))]


@pytest.mark.parametrize("blank", [" ", "&nbsp;"])
def test_the_text_of_a_page_is_read(tmp_path: Path, blank: str) -> None:
    frames = [data.hex(" ").upper().replace(" ", blank) for data in (ASK, ANSWER, ASK)]
    capture = opened(tmp_path, "session.html", PAGE.format(*frames))
    reads = list(capture.chunks())
    assert [(read.mark, read.data) for read in reads] == [(Mark.TX, ASK), (Mark.RX, ANSWER), (Mark.TX, ASK)]
    assert [after.t_ns - before.t_ns for before, after in pairwise(reads)] == [50_000_000, 350_000_000]


def test_lines_that_stand_as_they_are_stay_lines(tmp_path: Path) -> None:
    page = f"<html><body><pre>TX: {ASK.hex(' ')}\nRX: {ANSWER.hex(' ')}\n</pre></body></html>"
    assert [chunk.data for chunk in opened(tmp_path, "log.htm", page).chunks()] == [ASK, ANSWER]


def test_a_page_of_ours_and_one_without_bytes_are_no_captures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bus = tmp_path / "bus.txt"
    bus.write_text(f"TX: {ASK.hex(' ')}\nRX: {ANSWER.hex(' ')}\n")
    assert ran(capsys, "report", bus, "--html", tmp_path / "ours.html").status == 0
    (tmp_path / "other.html").write_text("<!DOCTYPE html>\n<html><body><p>Nothing of a line, 12 34.</p></body></html>")
    for name in ("ours.html", "other.html"):
        assert "an HTML page" in refused(capsys, "report", tmp_path / name)


def packet(number: int, mark: Mark, data: bytes, seq: int) -> dict[str, str]:
    ends = ("10.0.0.1", "10.0.0.9") if mark == Mark.TX else ("10.0.0.9", "10.0.0.1")
    ports = ("50001", "4001") if mark == Mark.TX else ("4001", "50001")
    return {
        "frame.time_epoch": f"170000000{number}.250000000", "ip.src": ends[0], "ip.dst": ends[1],
        "tcp.srcport": ports[0], "tcp.dstport": ports[1], "tcp.seq_raw": str(seq), "tcp.ack_raw": "1",
        "tcp.flags": "0x0018", "tcp.payload": data.hex(":"),
    }  # fmt: skip


def packets() -> list[dict[str, str]]:
    seqs, made = {Mark.TX: 100, Mark.RX: 900}, []
    for number, (mark, data) in enumerate([(Mark.TX, ASK), (Mark.RX, ANSWER)] * 3):
        made.append(packet(number, mark, data, seqs[mark]))
        seqs[mark] += len(data)
    return made


def as_json(fields: list[dict[str, str]]) -> str:
    layers = [{"_index": "packets", "_source": {"layers": {"frame": {}, "tcp": {"deep": each}}}} for each in fields]
    return json.dumps(layers, indent=2)


def as_pdml(fields: list[dict[str, str]]) -> str:
    shown = "".join(
        "<packet><proto name='tcp'>"
        + "".join(
            f"<field name='{name}' show='{text}' value='{text.replace(':', '')}'/>" for name, text in each.items()
        )
        + "</proto></packet>\n"
        for each in fields
    )
    return f'<?xml version="1.0"?>\n<pdml version="0">\n{shown}</pdml>\n'


@pytest.mark.parametrize(("name", "written"), [("net.json", as_json), ("net.pdml", as_pdml), ("net.xml", as_pdml)])
def test_packets_that_were_written_out_are_packets(tmp_path: Path, name: str, written: object) -> None:
    assert callable(written)
    capture = opened(tmp_path, name, written(packets()))
    assert [chunk.data for chunk in capture.chunks()] == [ASK, ANSWER] * 3
    assert [chunk.t_ns % 10**10 for chunk in capture.chunks()] == [n * 10**9 + 250_000_000 for n in range(6)]
    cut = opened(tmp_path, f"cut-{name}", written(packets())[:-600])
    assert [chunk.data for chunk in cut.chunks()] == ([ASK, ANSWER] * 3)[: len(list(cut.chunks()))]
    assert list(cut.chunks())


@pytest.mark.parametrize(
    "content",
    ['[{"_index": ' + "[" * 100_000, '[{"_index": "x"}, ' * 3, '<?xml version="1.0"?><pdml><packet>' * 50,
     '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><pdml>&c;</pdml>',
     '<?xml version="1.0"?><pdml>&nothing;</pdml>',
     as_json([{**packets()[0], "ip.src": "nowhere"}]), as_pdml([{**packets()[0], "tcp.payload": "0"}])],
    ids=range(7),
)  # fmt: skip
def test_what_is_no_such_document_is_one_line(tmp_path: Path, content: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "net.pdml"
    path.write_text(content)
    assert refused(capsys, "report", path)


@pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
@pytest.mark.parametrize("form", ["json", "pdml", "text"])
def test_what_wireshark_writes_out_is_what_it_was_given(tmp_path: Path, form: str) -> None:
    path = tmp_path / "net.pcap"
    path.write_bytes(pcap(talk().packets))
    command = [str(TSHARK), "-r", str(path), *(("-V", "-x") if form == "text" else ("-T", form))]
    written = subprocess.run(command, capture_output=True, check=True).stdout
    capture = opened(tmp_path, f"net.{form}", written)
    assert [(chunk.mark, chunk.data) for chunk in capture.chunks()] == SAID
    assert [chunk.t_ns for chunk in capture.chunks()] == [chunk.t_ns for chunk in captures.open(path).chunks()]
