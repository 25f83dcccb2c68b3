"""Files underneath every format: opening them, reading lines of bounded length, and writing without leftovers.

A file is written beside its final name and takes that name only when it is whole, so that a full disk or Ctrl-C leaves
what was there before. Every failure of the operating system becomes a `CaptureError` of one line.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import BinaryIO, Final

from .disposal import device_stream, made, move_to_free_name, part_of, put_in_place, remove_made
from .errors import CaptureError, os_reason

HEAD_BYTES = 1 << 16  # what formats are recognised by
LINE_LIMIT = 64 << 20  # bytes: a longer line is no line of text
_HEADER_LIMIT = 1 << 20
PRIVATE: Final = 0o600  # the mode of new files whose content is their owner's alone: recordings, settings
_DEVICES: Final = "\\\\.\\"  # how Windows' whole paths of devices begin
_PIECE = 1 << 16
_SOURCE = "open the capture it was made from"

# What people hand over by mistake: how such a file begins, what it is, what to do.
_OTHER_KINDS = (
    (b"\x89PNG\r\n\x1a\n", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"GIF8", "a GIF image"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-zip archive: unpack it first"),
    (b"Rar!\x1a\x07", "a rar archive: unpack it first"),
    (b"\x7fELF", "an ELF program"),
    (b"MZ\x90\x00", "a Windows program"),
    (b"%PDF-", "a PDF document"),
    (b"SQLite format 3\x00", "an SQLite database"),
    (b"PAR1", f"a Parquet table: {_SOURCE}"),
    (b"snoop\0\0\0", "a snoop file: convert it, for example with `tshark -r FILE -w FILE.pcapng`"),
    (b"GMBU", "a Network Monitor file: convert it, for example with `tshark -r FILE -w FILE.pcapng`"),
    (b"RTSS", "a Network Monitor 1 file: convert it, for example with `tshark -r FILE -w FILE.pcapng`"),
    (b"<!DOCTYPE html", f"an HTML page: {_SOURCE}"),
)
EXPORTED: Final = f"a table exported by rtuscope: {_SOURCE}"
_XML: Final = b"<?xml"
_TAR = (257, b"ustar")  # offset and what stands there
_OWN_COLUMNS = {"index", "unit", "function", "severity", "address"}  # beside one with a time in ns
_OWN_KEYS = re.compile(
    rb'\{\s*"(?:source|line|capture|rules|outcomes|passed)":.*"(?:findings|outcomes|transactions|units|frames)":', re.S
)


def read_head(path: Path) -> bytes:
    """The first 64 KiB of a regular, non-empty file; CaptureError for anything else."""
    with opened(path) as file:
        head = file.read(HEAD_BYTES)
    if not head:
        raise CaptureError(f"{path}: the file is empty")
    return head


def first_line(path: Path, head: bytes) -> bytes:
    """The first line of a file that begins with `head`, its end left out; of a longer one than 1 MiB the beginning."""
    line, end, _ = head.partition(b"\n")
    if end or len(head) < HEAD_BYTES:
        return line
    with opened(path) as file:
        return file.readline(_HEADER_LIMIT).removesuffix(b"\n")


def other_kind(head: bytes, *, log: bool = False) -> str | None:
    """What a file that begins like this is, when it is a well-known kind that holds no capture.

    `log`: its lines hold bytes, as logs do, which some programs write as XML.
    """
    if head.startswith(_XML) and not log:
        return "an XML document"
    for magic, kind in _OTHER_KINDS:
        if head.startswith(magic):
            return kind
    if head[_TAR[0] :].startswith(_TAR[1]):
        return "a tar archive: unpack it first"
    columns = _columns(head)
    if _OWN_COLUMNS.intersection(columns) and any(column.endswith("_ns") for column in columns):
        return EXPORTED
    if _OWN_KEYS.match(head):
        return f"a report made by rtuscope: {_SOURCE}"
    return None


def is_exported(head: bytes) -> bool:
    """Whether it is the table of frames that this tool exports, whatever its numbers look like besides."""
    return {"kind", "index", "t_start_ns"}.issubset(_columns(head))


def _columns(head: bytes) -> list[str]:
    """What the first line names."""
    first = head.partition(b"\n")[0].decode("utf-8", "replace").lstrip("\ufeff")
    return re.split('[,;\t"\r]+', first)


_READ: Final[list[BinaryIO]] = []  # files being read, for `share_read`


def share_read() -> float | None:
    """How much of the largest file that is being read was read, 0 to 1; None where none is."""
    sizes = [(os.fstat(file.fileno()).st_size, file) for file in _READ if not file.closed]
    if not sizes:
        return None
    size, file = max(sizes, key=lambda each: each[0])
    return min(file.tell() / size, 1.0) if size else None


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """A regular file open for reading; failures to open or to read it raise CaptureError."""
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise CaptureError(f"{path}: is a directory: name a capture file in it")
        if not stat.S_ISREG(mode):  # opening a device could wait, or read, for ever (for pipes: `captures.packed`)
            raise CaptureError(f"{path}: a device, not a file: save its data to a file first")
        with path.open("rb") as file:
            _READ.append(file)
            try:
                yield file
            finally:
                _READ.remove(file)
    except FileNotFoundError as error:
        raise CaptureError(f"{path}: no such file") from error
    except PermissionError as error:
        raise CaptureError(f"{path}: no permission to read it") from error
    except OSError as error:
        raise CaptureError(f"{path}: cannot be read: {os_reason(error)}") from error


def line_batches(file: BinaryIO, note: Callable[[str, str], None], size: int) -> Iterator[tuple[int, list[bytes]]]:
    """Lines without their ends, in batches of about `size` bytes, each batch with the number of its first line.

    Numbers start at 1 where the file stands. A line over 64 MiB is noted and skipped.
    """
    for number, text in text_batches(file, note, size):
        yield number, lines_of(text)


def lines_of(text: bytes) -> list[bytes]:
    """The lines of a text without their ends; the last may lack one."""
    lines = text.split(b"\n")
    if not lines[-1]:
        lines.pop()
    return lines


def text_batches(file: BinaryIO, note: Callable[[str, str], None], size: int) -> Iterator[tuple[int, bytes]]:
    """The same lines as `line_batches` gives, each batch as one text; only the file's last line may lack its end."""
    number, rest, skipping = 1, bytearray(), False
    while octets := file.read(max(size, _PIECE)):
        rest += octets
        cut = rest.rfind(b"\n") + 1
        if cut == 0:
            if len(rest) > LINE_LIMIT:
                skipping = True
                rest.clear()
            continue
        text = bytes(rest[:cut])
        del rest[:cut]
        if skipping:
            note(f"line {number}", f"longer than {LINE_LIMIT >> 20} MiB: skipped")
            number, skipping = number + 1, False
            text = text[text.index(b"\n") + 1 :]
        yield number, text
        number += text.count(b"\n")
    if skipping:
        note(f"line {number}", f"longer than {LINE_LIMIT >> 20} MiB: skipped")
    elif rest:
        yield number, bytes(rest)


class Unfinished:
    """Whether only a part of a file was written: that replaces no file; `path` is where it went then."""

    def __init__(self, stopped: Callable[[], bool] = bool) -> None:
        self.stopped = stopped
        self.path: Path | None = None

    def where(self, target: str) -> str:
        """Where what was written is."""
        return str(self.path or target)

    def set_aside(self, part: Path, target: Path) -> None:
        """Give a part a name beside the file that stays."""
        names = (target.with_name(f"{target.stem}.partial{n}{target.suffix}") for n in ("", *range(2, 1000)))
        self.path = move_to_free_name(part, names)


@contextmanager
def replacing(path: Path | str, *, private: bool = False, unfinished: Unfinished | None = None) -> Iterator[BinaryIO]:
    """A file to write that takes its name only when the block ends well, replacing what had that name.

    `private`: for its owner alone, where it is new; one that is there keeps its mode. What is not a regular file (a
    pipe, /dev/null) is written directly. CaptureError says which file could not be
    written and why; whatever ends the block early, nothing is left under the name, nor beside it. What `unfinished`
    calls a part replaces nothing.
    """
    unfinished = unfinished or Unfinished()
    path = Path(path)
    refuse_device_name(path)
    try:
        target = path.resolve()
        there = target.exists()
        if there and not target.is_file():
            if target.is_dir():
                raise CaptureError(f"{path}: is a directory: give a file name")
            with device_stream(target) as file:
                yield file
            return
        mode = stat.S_IMODE(target.stat().st_mode) if there else (PRIVATE if private else 0o666) & ~_umask()
        handle, part = part_of(target)
        mine = made(part)
        try:
            with os.fdopen(handle, "wb") as stream:
                yield stream
            part.chmod(mode)
            if there and unfinished.stopped():
                unfinished.set_aside(part, target)
            elif there:
                put_in_place(part, target)
            else:
                _settle(part, target)
        except BaseException:
            with suppress(OSError):
                remove_made(part, mine)
            raise
    except FileNotFoundError as error:
        raise CaptureError(f"{path}: cannot be written: no folder {path.parent}") from error
    except OSError as error:
        raise CaptureError(f"{path}: cannot be written: {os_reason(error)}") from error


def _settle(part: Path, target: Path) -> None:
    """Give a whole file its name, which nothing had when it was begun; where something has it now, one beside it."""
    names = (target.with_name(f"{target.stem}-{number}{target.suffix}") for number in range(2, 1000))
    taken = move_to_free_name(part, chain((target,), names))
    if taken != target:
        raise CaptureError(f"{target}: another program created it meanwhile; the output is in {taken}")


def refuse_device_name(path: Path) -> None:
    """CaptureError for a file's name that Windows takes for a device: bytes for `COM1.csv` would go onto the bus."""
    device = os.path.abspath(path).rstrip("\\")  # noqa: PTH100 - pathlib leaves it as it is
    if os.name == "nt" and device.startswith(_DEVICES) and path.name.lower() != "nul":
        device = device.removeprefix(_DEVICES).upper()
        raise CaptureError(f"{path}: on Windows this name means the device {device}: give another")


def _umask() -> int:
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
