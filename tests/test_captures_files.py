"""Unusable files are told in one line; what is written appears whole or not at all.

Of packed captures that end too early what came before is read, and that it was cut is said.
"""

from __future__ import annotations

import bz2
import errno
import gzip
import io
import json
import lzma
import os
import random
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from running import ran

import captures
from captures import CaptureError, Chunk, LineSettings, disposal, samples
from captures.errors import os_reason

READS = [Chunk(1000, b"\x11\x03"), Chunk(2000, b"\x00\x6b")]


def refused(path: Path, format: str | None = None) -> str:
    with pytest.raises(CaptureError) as caught:
        list(captures.open(path, format=format).blocks())
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "empty"),
        (b"\x89PNG\r\n\x1a\n....", "PNG image"),
        (b"PK\x03\x04....", "zip archive"),
        (b"Rar!\x1a\x07", "rar archive"),
        (b"PAR1....", "Parquet table"),
        (b"kind,index,port,start,length,seconds,t_start_ns\nframe,0,0,0,8,0.0,1\n", "a table exported by rtuscope"),
        (b"\xef\xbb\xbfindex;unit;t_start_ns\r\n", "open the capture it was made from"),
        (b'{\n  "source": "bus.jsonl",\n  "frames": 12\n}\n', "a report made by rtuscope"),
        (b"\x7fELF\x02\x01", "ELF program"),
        (b"%PDF-1.7", "PDF document"),
        (b"<?xml version='1.0'?>\n<map>\n<title>Holding registers</title>\n</map>\n", "XML document"),
        (b"\x1f\x8b\x08\x00", "gzip"),
    ],
)
@pytest.mark.parametrize("suffix", [".jsonl", ".bin", ".mcap", ".txt", ""])
def test_files_of_another_kind_are_named(tmp_path: Path, content: bytes, said: str, suffix: str) -> None:
    path = tmp_path / f"file{suffix}"
    path.write_bytes(content)
    text = refused(path)
    assert said in text
    assert str(path) in text


def test_a_table_of_frames_is_one_whatever_its_numbers_look_like(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A logic analyser's samples, by their numbers."""
    path = tmp_path / "frames.csv"
    assert ran(capsys, "export", samples.path("troubled.jsonl"), "-o", path).status == 0
    assert "a table exported by rtuscope" in refused(path)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path / "absent.jsonl")
    assert "directory" in refused(tmp_path)
    assert "no such file" in refused(tmp_path / "absent.bin", format="bin")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="every file is readable for this user")
def test_no_permission(tmp_path: Path) -> None:
    path = tmp_path / "secret.jsonl"
    path.write_text("{}")
    path.chmod(0)
    assert "permission" in refused(path)


def test_devices_are_refused_at_once() -> None:
    assert "a device" in refused(Path("/dev/zero"))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"format": "serial-chunks", "version": 2}\n', "version '2'"),
        ('{"format": "other", "version": 1}\n', "'other'"),
        ('{"index": 0, "unit": 1, "function": 3, "crc_ok": true}\n', "exported"),
        ("[1, 2]\n", "not a JSON object"),
        ("{nothing\n", "not JSON"),
    ],
)
def test_other_json_lines_are_told_apart(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "file.jsonl"
    path.write_text(content, encoding="utf-8")
    text = refused(path)
    assert said in text
    assert "line 1" in text


def test_json_lines_in_utf_16_are_told_for_what_they_are(tmp_path: Path) -> None:
    path = tmp_path / "file.jsonl"
    path.write_text('{"format": "serial-chunks", "version": 1}\n', encoding="utf-16")
    assert "UTF-16" in refused(path)


def test_an_unknown_suffix_with_unknown_content_lists_the_formats(tmp_path: Path) -> None:
    path = tmp_path / "notes.xyz"
    path.write_text("nothing to see here\n" * 20)
    text = refused(path)
    assert "mcap" in text
    assert "serial-chunks" in text
    assert "no capture format 'nonsense'" in refused(path, format="nonsense")


def test_content_outweighs_the_suffix(tmp_path: Path) -> None:
    source = io.BytesIO()
    captures.write(source, READS, line=LineSettings(baud=9600))
    path = tmp_path / "wrong.bin"
    path.write_bytes(source.getvalue())
    assert captures.open(path).format == "serial-chunks"
    path.write_bytes(b"11 03 00 6B\n")
    assert captures.open(path).format == "bin", "text in a raw file may be an ASCII-mode bus"


def test_logs_are_read_whatever_programs_name_them(tmp_path: Path) -> None:
    lines = b"10:00:01.123 TX: 01 03 00 00 00 02 C4 0B\n10:00:01.153 RX: 01 03 04 00 11 00 22 2A 2F\n"
    tagged = (
        b"<?xml version='1.0'?>\n<log>\n" + b"".join(b"<m>%b</m>\n" % line for line in lines.splitlines()) + b"</log>"
    )
    for name, content in (("a.dat", lines), ("b.xml", tagged), ("c.dat", tagged)):
        (tmp_path / name).write_bytes(content)
        capture = captures.open(tmp_path / name)
        assert (capture.format, len(list(capture.chunks()))) == ("text", 2), name
    (tmp_path / "d.dat").write_bytes(b"300000002FA\r\n:010304001100220C5\r\n")
    assert captures.open(tmp_path / "d.dat").format == "bin", "an ASCII-mode bus as it stood on the line"


def test_bad_lines_are_noted_with_their_numbers_and_the_rest_is_given(tmp_path: Path) -> None:
    path = tmp_path / "bad.jsonl"
    path.write_text(
        '{"format": "serial-chunks", "version": 1, "baud": -3}\n'
        '{"t_ns": 1, "hex": "11"}\n'
        '{"t_ns": 2, "hex": "110"}\n'
        "\n"
        '{"t_ns": 3.5, "hex": "11"}\n'
        '{"t_ns": 4, "hex": "zz"}\n'
        '{"hex": "11"}\n'
        '{"t_ns": 5, "hex": "11", "port": 300}\n'
        '{"t_ns": 6, "hex": "11", "errors": [1]}\n'
        '{"t_ns": 7, "hex": "12", "colour": "red"}\n'
        '{"t_ns": 8, "hex": "1'
    )
    capture = captures.open(path)
    assert [chunk.data.hex() for chunk in capture.chunks()] == ["11", "12"]
    assert [damage.where for damage in capture.damage] == [f"line {n}" for n in (1, 3, 5, 6, 7, 8, 9, 11)]
    assert "odd" in capture.damage[1].what
    assert "cut short" in capture.damage[-1].what


def test_reads_without_their_header_are_taken_and_said(tmp_path: Path) -> None:
    path = tmp_path / "tail.jsonl"
    path.write_text('{"t_ns": 1, "hex": "11"}\n{"t_ns": 2, "hex": "03"}\n')
    capture = captures.open(path)
    assert len(list(capture.chunks())) == 2
    assert "no header" in capture.damage[0].what
    path.write_text('{"format": "seri\n{"t_ns": 1, "hex": "11"}\n')
    assert len(list(capture.chunks())) == 1


def test_a_written_file_takes_its_name_only_when_whole(tmp_path: Path) -> None:
    path = tmp_path / "out.jsonl"
    captures.write(path, READS)
    before = path.read_bytes()
    with pytest.raises(KeyboardInterrupt), captures.replacing(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    with pytest.raises(CaptureError, match="no space left"), captures.replacing(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_where_nothing_can_be_written_is_said(tmp_path: Path) -> None:
    for path, said in (
        (tmp_path / "absent" / "out.jsonl", "no folder"),
        (tmp_path / "out.nothing", "no format writes"),
        (tmp_path / "out.csv", "no format writes"),
    ):
        with pytest.raises(CaptureError, match=said):
            captures.write(path, READS)
    (tmp_path / "folder.jsonl").mkdir()
    with pytest.raises(CaptureError, match="directory"):
        captures.write(tmp_path / "folder.jsonl", READS)
    with pytest.raises(CaptureError, match="read, but not written"):
        captures.write(tmp_path / "out.vcd", READS, format="vcd")


@pytest.mark.skipif(sys.platform == "win32", reason="modes are POSIX")
def test_a_new_capture_is_for_its_owner_alone_and_a_replaced_one_keeps_its_mode(tmp_path: Path) -> None:
    path, plain, made = tmp_path / "out.jsonl", tmp_path / "plain", tmp_path / "made"
    plain.write_text("")
    captures.write(path, READS)
    assert path.stat().st_mode & 0o777 == 0o600
    with captures.replacing(made):
        pass
    assert made.stat().st_mode == plain.stat().st_mode
    path.chmod(0o640)
    captures.write(path, READS)
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_capture_can_replace_its_own_file(tmp_path: Path) -> None:
    path = tmp_path / "own.jsonl"
    captures.write(path, READS)
    captures.write(path, captures.open(path))
    assert list(captures.open(path).chunks()) == READS


def test_importing_the_package_and_pasted_text_load_no_arrays() -> None:
    code = "import sys, captures.hexwords; print([m for m in ('numpy', 'orjson', 'mcap') if m in sys.modules])"
    environment = {**os.environ, "PYTHONPATH": str(Path(captures.__file__).parents[1])}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert run.stdout.strip() == "[]"


@pytest.mark.parametrize("lines", [1, 3])
@pytest.mark.parametrize("separator", [" ", "", ", "])
def test_hex_in_lines_of_any_length(tmp_path: Path, separator: str, lines: int) -> None:
    """Longer than the head by which a format is told, wherever that cuts them."""
    frame = "11 03 00 6B 00 03 76 87".replace(" ", separator)
    path = tmp_path / "long.txt"
    for lead in ("", " ", "  "):
        path.write_text((lead + separator.join([frame] * 4000) + "\n") * lines)
        data = b"".join(bytes(block.data) for block in captures.open(path).blocks())
        assert data == bytes.fromhex("1103006b00037687") * 4000 * lines


def test_a_header_of_any_length(tmp_path: Path) -> None:
    path = tmp_path / "bus.jsonl"
    header = {"format": "serial-chunks", "version": 1, "baud": 19200, "remarks": "x" * 100_000, "tap": "last"}
    path.write_text(json.dumps(header) + '\n{"t_ns": 1, "hex": "1103"}\n')
    capture = captures.open(path)
    assert (capture.line.baud, capture.line.tap) == (19200, "last")
    assert [chunk.data for chunk in capture.chunks()] == [b"\x11\x03"]
    header["remarks"] = "x" * 2_000_000
    path.write_text(json.dumps(header) + '\n{"t_ns": 1, "hex": "1103"}\n')
    with pytest.raises(captures.CaptureError, match="line 1"):
        captures.open(path)


def test_a_file_that_is_open_elsewhere_is_waited_for_and_named_as_such(monkeypatch):
    monkeypatch.setattr(disposal, "_WAITS_S", (0, 0))

    class HeldError(PermissionError):
        winerror = 32

    held = HeldError(13, "Zugriff verweigert")
    answers: list[PermissionError | None] = [held, held, None]

    def rename():
        answer = answers.pop(0)
        if answer:
            raise answer

    disposal.patiently(rename)
    assert not answers
    answers += [held] * 3
    with pytest.raises(PermissionError) as refused:
        disposal.patiently(rename)
    assert os_reason(refused.value) == "open in another program"
    answers += [PermissionError(13, "denied"), None]
    with pytest.raises(PermissionError):  # no matter of waiting
        disposal.patiently(rename)
    assert answers == [None]


PACK: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": lambda data: bz2.compress(data, 1),
    "xz": lzma.compress,
    "zst": zstandard.compress,
}


def _log(lines: int, size: int = 24) -> bytes:
    """A log of hex bytes that no packer makes much smaller."""
    chance = random.Random(lines)
    return b"".join(
        b"%d.%03d %s\n" % (n // 10, n % 10 * 100, chance.randbytes(size).hex().encode()) for n in range(lines)
    )


def _octets(path: Path) -> tuple[bytes, list[str]]:
    capture = captures.open(path)
    data = b"".join(block.data.tobytes() for block in capture.blocks(1 << 19))
    return data, [str(damage) for damage in capture.damage]


@pytest.mark.parametrize(("suffix", "lines"), [("gz", 30), ("gz", 600), ("xz", 30), ("bz2", 600), ("zst", 800)])
def test_what_comes_before_a_cut_is_read(suffix: str, lines: int, tmp_path: Path) -> None:
    whole = tmp_path / "bus.log"
    whole.write_bytes(_log(lines, 240))
    data, _ = _octets(whole)
    packed = PACK[suffix](whole.read_bytes())
    path = tmp_path / f"bus.log.{suffix}"
    path.write_bytes(packed[: len(packed) * 3 // 4])
    left, damage = _octets(path)
    assert data.startswith(left[: len(left) - 240])  # of its last line there may be half
    assert len(left) > 0.5 * len(data)
    assert "cut" in damage[-1] and "everything before it was read" in damage[-1]


@pytest.mark.parametrize("suffix", PACK)
def test_packed_parts_end_to_end_are_one_file(suffix: str, tmp_path: Path) -> None:
    log = _log(180, 240)
    (tmp_path / "bus.log").write_bytes(log)
    path = tmp_path / f"bus.log.{suffix}"
    path.write_bytes(PACK[suffix](log[:67_000]) + PACK[suffix](log[67_000:]))
    assert _octets(path) == _octets(tmp_path / "bus.log")


@pytest.mark.parametrize("suffix", PACK)
def test_a_cut_before_anything_whole_is_said(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bus.log.{suffix}"
    path.write_bytes(PACK[suffix](_log(300))[:40])
    with pytest.raises(captures.CaptureError, match="cut"):
        captures.open(path)


def test_a_port_that_is_taken_is_told_in_the_systems_words_alone() -> None:
    """Whatever Python adds to them."""
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(OSError) as refused:
        socket.create_server(taken.getsockname())
    assert os_reason(refused.value) == os.strerror(errno.EADDRINUSE).lower()
