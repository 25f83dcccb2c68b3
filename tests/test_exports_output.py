"""Where an export goes: whole or not at all."""

import contextlib
import io
import os
import sys

import pytest

from analyzer.exports.sink import ExportError, output
from captures import CaptureError


def test_a_file_appears_when_the_block_ends(tmp_path):
    out = tmp_path / "out.bin"
    with output(out) as stream:
        stream.write(b"abc")
        assert not out.exists()
        assert stream.tell() == 3
    assert out.read_bytes() == b"abc"
    assert list(tmp_path.iterdir()) == [out]


def test_an_exception_leaves_what_was_there(tmp_path):
    out = tmp_path / "out.bin"
    out.write_bytes(b"before")
    with pytest.raises(KeyboardInterrupt), output(out) as stream:
        stream.write(b"half")
        raise KeyboardInterrupt
    assert out.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [out]


def test_the_capture_being_read_is_not_written_over(tmp_path):
    source = tmp_path / "bus.jsonl"
    source.write_bytes(b"precious")
    link = tmp_path / "link.jsonl"
    with contextlib.suppress(OSError):  # not for everybody on Windows
        link.symlink_to(source)
    for name in (source, *([link] if link.exists() else [])):
        with pytest.raises(ExportError, match="is the capture being read"), output(name, source=source):
            pass
    assert source.read_bytes() == b"precious"


def test_what_cannot_be_written_is_one_line(tmp_path):
    for path in (tmp_path, tmp_path / "no" / "such" / "folder.csv"):
        with pytest.raises((ExportError, CaptureError)) as caught, output(path):
            pass
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_standard_output_counts_what_a_pipe_cannot_tell(monkeypatch):
    class Stdout(io.StringIO):
        buffer = io.BytesIO()

    monkeypatch.setattr(sys, "stdout", Stdout())
    with output("-") as stream:
        stream.write(b"abc")
        assert stream.tell() == 3
    assert Stdout.buffer.getvalue() == b"abc"


@pytest.mark.skipif(os.name != "posix" or not os.path.exists("/dev/full"), reason="no /dev/full here")  # noqa: PTH110
def test_a_device_is_written_to_and_not_replaced():
    with pytest.raises((ExportError, CaptureError), match="no space left on device"), output("/dev/full") as stream:
        stream.write(b"abc")
    assert os.path.exists("/dev/full")  # noqa: PTH110
    assert not os.path.isfile("/dev/full")  # noqa: PTH113
