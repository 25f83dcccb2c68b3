"""Standard input, pipes and packed files, as the plain files that readers open.

Readers go back and forth in a file, and read it again: so what comes from a pipe or is packed (gzip, bzip2, xz, zstd, a
zip with one capture, a page, Wireshark's PDML) is first put into a temporary file, which goes when nobody needs it any
more. A packed file that grows out of all proportion is refused: it is made to fill a disk.
"""

from __future__ import annotations

import shutil
import stat
import sys
import tempfile
import weakref
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any, BinaryIO, Final

from .disposal import TemporaryFolder
from .errors import CaptureError, os_reason
from .files import HEAD_BYTES, opened

STANDARD_INPUT: Final = "-"
_PIECE: Final = 1 << 18
_ZSTD_PIECE: Final = 1 << 10  # each of them may grow 32,000 times
_ROOM: Final = 1 << 28  # bytes that are left free on the disk
_SMALL: Final = 1 << 22  # bytes up to which a packed file may grow whatever its size
_GROWTH: Final = 50  # times its size, beyond that: captures shrink to a half as bytes, to a twentieth as text
_DEPTH: Final = 3  # packed files in packed files
_BEGIN: Final = 1 << 14  # bytes of a document by which it is known
_LINE: Final = 64  # bytes of a first line
_USB_ENDPOINTS: Final = frozenset(kind + way for kind in (b"B", b"C", b"I", b"Z") for way in (b"i", b"o"))
_NO_CAPTURE: Final = ("__MACOSX/", ".DS_Store")

Member = Callable[[str, bytes], bool]  # whether a file of this name that begins so is likely a capture


@dataclass(frozen=True, slots=True)
class LocalFile:
    """A file as a reader can open it.

    `path` is what is opened, `name` what the user calls it, `steps` how it was unpacked, `cut` what was missing at its
    end. `folder` holds temporary files, which are removed when the object that `keep` is given goes.
    """

    path: Path
    name: str
    steps: tuple[str, ...] = ()
    cut: str | None = None
    folder: TemporaryFolder | None = None

    def keep(self, owner: object) -> None:
        """Temporary files stay as long as `owner` does."""
        if self.folder is not None:
            weakref.finalize(owner, self.folder.remove)

    def remove(self) -> None:
        """Remove temporary files now."""
        if self.folder is not None:
            self.folder.remove()

    def blamed(self, error: CaptureError) -> CaptureError:
        """The same error about the file as the user calls it."""
        return CaptureError(str(error).replace(str(self.path), self.name))


def local_file(path: Path) -> LocalFile:
    """A file that is there as it stands; what a pipe or standard input (`-`) gives is put into a temporary one."""
    if str(path) == STANDARD_INPUT:
        if sys.stdin is None or sys.stdin.isatty():  # None: outside of a command of ours
            raise CaptureError("standard input is a terminal: put a capture into it, as in: rtuscope report - < FILE")
        return _spooled(sys.stdin.buffer, "standard input", "stdin")
    try:
        piped = stat.S_ISFIFO(path.stat().st_mode)
    except OSError:
        piped = False  # `opened` says what is wrong with it
    if not piped:
        return LocalFile(path, str(path))
    try:
        with path.open("rb") as pipe:
            return _spooled(pipe, str(path), path.name)
    except OSError as error:
        raise CaptureError(f"{path}: cannot be read: {os_reason(error)}") from error


def _spooled(stream: IO[bytes], name: str, base: str) -> LocalFile:
    folder = _temporary()
    try:
        file = LocalFile(folder.path / base, name, folder=folder)
        with file.path.open("xb") as out:
            _copied(stream, out, name, limit=None)
    except OSError as error:
        folder.remove()
        raise CaptureError(f"{name}: cannot be stored in {folder.path.parent}: {os_reason(error)}") from error
    except BaseException:
        folder.remove()
        raise
    return file


def unpacked(file: LocalFile, head: bytes, member: Member) -> LocalFile | None:
    """What is in a packed file that begins with `head`; None where it is not packed.

    `member` chooses among several files in a zip. Raises CaptureError where nothing can be got out.
    """
    packing = next((packing for packing in _PACKINGS if packing.begins(head)), None)
    if packing is None:
        return None
    if len(file.steps) >= _DEPTH:
        raise CaptureError(f"{file.name}: packed more than {_DEPTH} times: unpack it first")
    folder = file.folder or _temporary()
    try:
        with opened(file.path) as packed:
            out = packing.unpack(packed, replace(file, folder=folder), member)
    except CaptureError as error:
        replace(file, folder=folder).remove()
        raise file.blamed(error) from error
    except BaseException:
        replace(file, folder=folder).remove()
        raise
    return replace(out, steps=(*file.steps, packing.name))


def _temporary() -> TemporaryFolder:
    try:
        return TemporaryFolder("rtuscope-")
    except OSError as error:
        raise CaptureError(f"{tempfile.gettempdir()}: cannot be written: {os_reason(error)}") from error


def _copied(source: IO[bytes], out: IO[bytes], name: str, *, limit: int | None) -> str | None:
    """All of a stream into a file; what is wrong where packed data ends too early. CaptureError for too much."""
    size = 0
    read = getattr(source, "read1", source.read)  # else what came before a cut, of the same piece, would be lost
    while True:
        try:
            piece = read(_PIECE)
        except Exception as error:  # zlib.error, LZMAError, ZstdError: they have no base of their own
            if limit is None:
                raise
            return f"damaged or cut ({_first_line(error)})"
        if not piece:
            return None
        size += len(piece)
        if limit is not None and size > limit:
            raise CaptureError(
                f"{name}: unpacks to over {limit >> 20:,} MiB, {_GROWTH} times its size: unpack it first"
            )
        if size % (_PIECE << 6) < len(piece) and shutil.disk_usage(tempfile.gettempdir()).free < _ROOM:
            raise CaptureError(f"{name}: too large for {tempfile.gettempdir()}: set TMPDIR to a larger disk")
        out.write(piece)


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:80]


@dataclass(frozen=True, slots=True)
class _Packing:
    """One way of packing: its name, how such a file begins, and how it is opened."""

    name: str
    begins: Callable[[bytes], bool]
    open: Callable[[BinaryIO], Any]
    suffixes: tuple[str, ...] = field(default=())

    def unpack(self, packed: BinaryIO, file: LocalFile, member: Member) -> LocalFile:  # noqa: ARG002 - one capture
        assert file.folder is not None
        inner = Path(file.name).name
        for suffix in self.suffixes:
            inner = inner[: -len(suffix)] if inner.lower().endswith(suffix) else inner
        target = file.folder.path / f"{len(file.steps)}" / inner
        with self.open(packed) as stream:
            return _put(stream, target, file, self.name)


def _put(stream: IO[bytes], target: Path, file: LocalFile, packing: str) -> LocalFile:
    size = file.path.stat().st_size
    try:
        target.parent.mkdir(exist_ok=True)
        with target.open("xb") as out:
            cut = _copied(stream, out, file.name, limit=max(_SMALL, _GROWTH * size))
    except OSError as error:
        raise CaptureError(f"{file.name}: cannot be unpacked to {target.parent}: {os_reason(error)}") from error
    if cut is None:
        return replace(file, path=target)
    if not target.stat().st_size:
        raise CaptureError(f"{file.name}: packed with {packing}, {cut}: nothing can be read")
    return replace(file, path=target, cut=f"the {packing} file is {cut}: everything before it was read")


class _Zip(_Packing):
    """A zip, of which one file is taken."""

    def unpack(self, packed: BinaryIO, file: LocalFile, member: Member) -> LocalFile:
        assert file.folder is not None
        try:
            with zipfile.ZipFile(packed) as archive:
                info = _only(archive, file.name, member)
                target = file.folder.path / f"{len(file.steps)}" / (Path(info.filename).name or "capture")
                with archive.open(info) as stream:
                    return _put(stream, target, file, self.name)
        except RuntimeError as error:  # what zipfile raises where a password is needed
            raise CaptureError(f"{file.name}: a zip archive with a password: unpack it first") from error
        except (zipfile.BadZipFile, NotImplementedError, EOFError, ValueError, OSError) as error:
            raise CaptureError(f"{file.name}: a zip archive that cannot be opened: {_first_line(error)}") from error


def _only(archive: zipfile.ZipFile, name: str, member: Member) -> zipfile.ZipInfo:
    named = [info for info in archive.infolist() if info.filename]
    files = [info for info in named if not info.is_dir() and not info.filename.startswith(_NO_CAPTURE)]
    if len(files) > 1:
        likely = []
        for info in files[:1000]:
            with archive.open(info) as stream:
                if member(info.filename, stream.read(HEAD_BYTES)):
                    likely.append(info)
        files = likely or files
    if len(files) != 1:
        listed = ", ".join(info.filename for info in files[:4]) + (" ..." if len(files) > 4 else "")
        what = f"of {len(files)} files ({listed}): unpack the one to read" if files else "without a file"
        raise CaptureError(f"{name}: a zip archive {what}")
    return files[0]


def _gzip(packed: BinaryIO) -> Any:
    import gzip

    return gzip.GzipFile(fileobj=packed)


def _bzip2(packed: BinaryIO) -> Any:
    import bz2

    return bz2.BZ2File(packed)


def _xz(packed: BinaryIO) -> Any:
    import lzma

    return lzma.LZMAFile(packed)


class _ZstdFrames:
    """The frames of a zstd file end to end; the library's own reader does not tell of one that was cut."""

    def __init__(self, packed: BinaryIO) -> None:
        import zstandard  # comes with mcap

        self._packed = packed
        self._decompressor = zstandard.ZstdDecompressor(max_window_size=1 << 27)
        self._frame: Any = None
        self._left = b""  # what was read and is of the next frame

    def __enter__(self) -> _ZstdFrames:
        return self

    def __exit__(self, *_: object) -> None:
        """The file is closed by whoever opened it."""

    def read(self, _: int) -> bytes:
        """The next bytes, as many as there are at hand; none at the end."""
        while data := self._left or self._packed.read(_ZSTD_PIECE):
            if self._frame is None or self._frame.eof:
                self._frame = self._decompressor.decompressobj()
            out: bytes = self._frame.decompress(data)
            self._left = self._frame.unused_data if self._frame.eof else b""
            if out:
                return out
        if self._frame is not None and not self._frame.eof:
            raise EOFError("Compressed file ended before the end of its last frame")
        return b""


class _Pieces:
    """Pieces as a stream that is read, a context manager."""

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._pieces = pieces

    def __enter__(self) -> _Pieces:
        return self

    def __exit__(self, *_: object) -> None:
        """The file is closed by whoever opened it."""

    def read(self, _: int) -> bytes:
        """The next piece, however long; nothing at the end."""
        return next(self._pieces, b"")


def _is_page(head: bytes) -> bool:
    if not head[:_BEGIN].lstrip(b"\xef\xbb\xbf \r\n\t").lower().startswith((b"<!doctype html", b"<html")):
        return False
    from .text.page import shows_bytes  # loads a parser: not for each text that is opened

    return shows_bytes(head)


def _page(packed: BinaryIO) -> Any:
    from .text.page import page_text

    return _Pieces(page_text(packed))


def _pdml(packed: BinaryIO) -> Any:
    from .network.written import pdml_packets

    return _Pieces(pdml_packets(packed))


def _wireshark_json(packed: BinaryIO) -> Any:
    from .network.written import json_packets

    return _Pieces(json_packets(packed))


def _usbmon(packed: BinaryIO) -> Any:
    from .network.usbtext import usbmon_packets

    return _Pieces(usbmon_packets(packed))


def _dissected(packed: BinaryIO) -> Any:
    from .network.written import dissected_packets

    return _Pieces(dissected_packets(packed))


def _is_dissected(head: bytes) -> bool:
    """Details of packets, with their bytes."""
    return head[:6] == b"Frame " and b" on wire (" in head[:64] and b"\n0000  " in head[:_BEGIN]


def _is_usbmon(head: bytes) -> bool:
    """`ffff8d0f4a1c3cc0 2761014512 S Bo:1:007:2 …`"""
    words = head[:_LINE].partition(b":")[0].split()
    return len(words) == 4 and words[2] in (b"S", b"C", b"E") and words[3] in _USB_ENDPOINTS


_PACKINGS: Final = (
    _Packing("gzip", lambda head: head[:3] == b"\x1f\x8b\x08" and head[3:4] < b"\x20", _gzip, (".gz", ".gzip")),
    _Packing("bzip2", lambda head: head[:3] == b"BZh" and head[4:10] == b"1AY&SY", _bzip2, (".bz2",)),
    _Packing("xz", lambda head: head[:6] == b"\xfd7zXZ\x00", _xz, (".xz",)),
    _Packing("zstd", lambda head: head[:4] == b"\x28\xb5\x2f\xfd", _ZstdFrames, (".zst", ".zstd")),
    _Packing("HTML", _is_page, _page, (".html", ".htm")),
    _Packing("PDML", lambda head: head.lstrip()[:1] == b"<" and b"<pdml" in head[:_BEGIN], _pdml, (".pdml", ".xml")),
    _Packing("JSON", lambda head: b"".join(head[:256].split())[:10] == b'[{"_index"', _wireshark_json, (".json",)),
    _Packing("text of packets", _is_dissected, _dissected),
    _Packing("usbmon text", _is_usbmon, _usbmon),
    _Zip("zip", lambda head: head[:4] == b"PK\x03\x04", zipfile.ZipFile),
)
