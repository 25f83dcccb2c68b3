"""A file that only ever ends where a whole write ended.

What is written is held until `commit`, which puts it on the disk, synced, or fails and takes back what it had begun:
so a full disk leaves the file as it was, and what is held can be committed later.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


class CommittedFile:
    """A new file at `path`, which must not exist. OSError passes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
        self._descriptor = os.open(path, flags, 0o666)
        with suppress(ImportError, OSError):  # so that others see that it is in work
            import fcntl

            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._held = bytearray()
        self.size = 0  # bytes that are safe

    def write(self, data: bytes) -> int:
        """Hold it."""
        self._held += data
        return len(data)

    def tell(self) -> int:
        """Bytes written, held ones included."""
        return self.size + len(self._held)

    def flush(self) -> None:
        """For writers that ask; `commit` is what counts."""

    def commit(self) -> None:
        """Put all that is held on the disk; OSError where it could not be, which then can be tried again."""
        if not self._held:
            return
        done = 0
        view = memoryview(self._held)
        try:
            while done < len(view):
                done += os.write(self._descriptor, view[done:])
            os.fsync(self._descriptor)
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self.size)
                os.lseek(self._descriptor, self.size, os.SEEK_SET)
            raise
        finally:
            view.release()
        self.size += done
        self._held.clear()

    def close(self) -> None:
        """Let go of the file; what is still held is given up."""
        os.close(self._descriptor)


def is_written(path: Path) -> bool:
    """Whether a `CommittedFile` of some process is writing this file now; False where the system can't tell."""
    try:
        import fcntl
    except ImportError:
        return False
    with suppress(OSError), path.open("rb") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def sync_folder(folder: Path) -> None:
    """Make new names in a folder last through a power cut, where the system has a way."""
    with suppress(OSError):  # Windows opens no folders
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
