"""The one module that takes anything away from a disk, empties it, or puts one file in the place of another.

Nothing goes because of where it lies or what it is called. A file is taken away where this process made it and it is
still that file (`remove_made`), where an account names it and no link stands on the way to it (`remove_listed`), or
where its content proves that this program wrote it (`remove_proven`); a file is written over only where its user said
so (`put_in_place`). `tests/test_disposal.py` holds that no other module of the product can do any of this.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import tempfile
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, Final

from .errors import OPEN_ELSEWHERE, os_reason

_WAITS_S: Final = (0.05, 0.1, 0.2, 0.4)  # between attempts to rename
_BELOW: Final = os.unlink in os.supports_dir_fd and os.open in os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
_FOLDER: Final = getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
Made = tuple[int, int]  # device and number of a file that this process made


def made(path: Path) -> Made:
    """What tells a file that this process has just made from all others, to be asked at once. OSError passes."""
    status = path.lstat()  # and not by its descriptor: file systems of a network have another number for that
    return status.st_dev, status.st_ino


def remove_made(path: Path, mine: Made) -> bool:
    """Take away the file that this process made; False where something else has its name by now. OSError passes."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode) or made(path) != mine:
            return False
        path.unlink()
    except FileNotFoundError:
        return False
    return True


def remove_listed(root: Path, names: Iterable[str]) -> dict[str, str]:
    """Take away the files of an account, by their names relative to `root`, with slashes; why, of those that stay.

    A name that is gone already is no trouble. Only regular files go, and none behind a link, set at whatever moment.
    """
    kept: dict[str, str] = {}
    for name in names:
        try:
            _remove_below(root, name)
        except FileNotFoundError:
            continue
        except OSError as error:
            kept[name] = os_reason(error)
    return kept


def _remove_below(root: Path, name: str) -> None:
    *folders, last = parts = name.split("/")
    if any(part in ("", ".", "..") or "\\" in part for part in parts):
        raise OSError(errno.EINVAL, "not a path inside the folder")
    if _BELOW:
        with _opened_folder(root, folders) as folder:
            _refuse_unless_regular(os.stat(last, dir_fd=folder, follow_symlinks=False))
            os.unlink(last, dir_fd=folder)
        return
    path = root
    for part in folders:  # Windows
        path /= part
        if path.is_symlink() or getattr(path, "is_junction", bool)():
            raise OSError(errno.ELOOP, "reached through a link")
    _refuse_unless_regular((path / last).lstat())
    (path / last).unlink()


def _refuse_unless_regular(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "a link or a folder, not a file")


def remove_objects(system: Any, root: str, names: Iterable[str]) -> dict[str, str]:
    """The same in an object store, below the path `root` of an fsspec filesystem, where there are no links."""
    kept: dict[str, str] = {}
    for name in names:
        try:
            system.rm_file(f"{root}/{name}")
        except FileNotFoundError:
            continue
        except Exception as error:  # of whatever library the store has
            kept[name] = os_reason(error) if isinstance(error, OSError) else " ".join(str(error).split())
    return kept


@contextmanager
def _opened_folder(root: Path, folders: Iterable[str]) -> Iterator[int]:
    """A descriptor of a folder below `root`, reached without a link."""
    descriptor = os.open(root, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
    try:
        for folder in folders:
            try:
                inner = os.open(folder, os.O_RDONLY | _FOLDER, dir_fd=descriptor)
            except OSError as error:
                if error.errno in (errno.ELOOP, errno.ENOTDIR):
                    raise OSError(errno.ELOOP, "reached through a link") from error
                raise
            os.close(descriptor)
            descriptor = inner
        yield descriptor
    finally:
        os.close(descriptor)


def remove_proven(path: Path, proof: Callable[[bytes], bool]) -> bool:
    """Take away a file whose whole content proves that this program wrote it; False for any other. OSError passes."""
    if path.is_symlink() or not path.is_file() or not proof(path.read_bytes()):
        return False
    path.unlink()
    return True


def remove_empty_folder(path: Path) -> None:
    """Take away a folder that holds nothing; OSError where it holds something."""
    path.rmdir()


def put_in_place(source: Path, target: Path) -> None:
    """Give a file its name, whatever has that: its user said that it may be written over. OSError passes."""
    patiently(lambda: source.replace(target))


def move_to_free_name(source: Path, names: Iterable[Path]) -> Path:
    """Renames a file to the first of these names that no file has, whatever others do meanwhile. OSError passes."""
    for name in names:
        with suppress(FileExistsError):
            _rename_without_overwriting(source, name)
            return name
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(source))


def _rename_without_overwriting(source: Path, target: Path) -> None:
    if os.name == "nt":
        patiently(lambda: source.rename(target))
        return
    try:
        os.link(source, target)
    except (FileExistsError, FileNotFoundError):
        raise
    except OSError:  # no hard links on this file system: the name is taken by an empty file first
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
        taken = made(target)
        try:
            source.replace(target)
        except OSError:
            remove_made(target, taken)
            raise
    else:
        source.unlink()


def move_folder(source: Path, target: Path) -> None:
    """Give a folder another name, which nothing has. OSError passes."""
    if target.is_symlink() or target.exists():
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    patiently(lambda: source.rename(target))


def patiently(rename: Callable[[], object]) -> None:
    """Rename a file; on Windows one that is open elsewhere is waited for: virus scanners open what is new. OSError."""
    for wait_s in _WAITS_S:
        try:
            rename()
            return
        except PermissionError as error:
            if getattr(error, "winerror", None) not in OPEN_ELSEWHERE:
                raise
        time.sleep(wait_s)
    rename()


def is_open_elsewhere(path: Path) -> bool:
    """Whether some program has the file open, on Windows, where such a file cannot be renamed."""
    try:
        path.rename(path)
    except OSError as error:
        return getattr(error, "winerror", None) in OPEN_ELSEWHERE
    return False


def cut_back(descriptor: int, size: int) -> None:
    """Cut a file that this process writes back to what is known to be safe of it. OSError passes."""
    os.ftruncate(descriptor, size)
    os.lseek(descriptor, size, os.SEEK_SET)


def part_of(target: Path) -> tuple[int, Path]:
    """A new file beside `target`, hidden, to be written before it takes that name: its descriptor and its path."""
    handle, name = tempfile.mkstemp(prefix=f".{target.name[:64]}.", suffix=".part", dir=target.parent)
    return handle, Path(name)


def device_stream(path: Path, buffering: int = -1) -> BinaryIO:
    """A pipe or a device open for writing (`buffering` as of `open`): never made, never emptied. OSError passes."""
    descriptor = os.open(path, os.O_WRONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0))
    return os.fdopen(descriptor, "wb", buffering)


class TemporaryFolder:
    """A folder of this process alone, which goes with all that is in it by `remove`, or with this object.

    A context manager that gives its path. Links in it go, and not what they lead to.
    """

    def __init__(self, prefix: str, beside: Path | None = None) -> None:
        """In the system's place for such folders, or in the folder `beside`. OSError passes."""
        self.path = Path(tempfile.mkdtemp(prefix=prefix, dir=beside))
        self._finalizer = weakref.finalize(self, _remove_tree, self.path, made(self.path))

    def remove(self) -> None:
        """Take it away now; again it does nothing."""
        self._finalizer()

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *_: object) -> None:
        self.remove()


def _remove_tree(path: Path, mine: Made) -> None:
    with suppress(OSError):
        if stat.S_ISDIR(path.lstat().st_mode) and made(path) == mine:
            shutil.rmtree(path, ignore_errors=True)
