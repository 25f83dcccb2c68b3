"""Locks between processes: a file by which one process at a time says that it is at work."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

_FAR: Final = 1 << 40  # Windows locks bytes, which nobody may read then: this one is behind the end of any such file
_TRIES: Final = 5


class LockedElsewhereError(Exception):
    """Another process holds the lock."""


def opened_and_locked(path: Path) -> int:
    """A descriptor of the file, made where there is none, that holds its lock until it is closed.

    A file system without locks locks nothing. A link is not followed. Raises LockedElsewhereError; OSError passes.
    """
    flags = os.O_RDWR | os.O_CREAT
    for name in ("O_BINARY", "O_CLOEXEC", "O_NOFOLLOW"):
        flags |= getattr(os, name, 0)
    for _ in range(_TRIES):
        descriptor = os.open(path, flags, 0o666)
        try:
            lock(descriptor)
            if _still(path, descriptor):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # another process has put another file in its place meanwhile
    return os.open(path, flags, 0o666)  # a file system whose numbers of files mean nothing


def _still(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False


def lock(descriptor: int) -> None:
    """Lock an open file. Raises LockedElsewhereError where another process, or another descriptor, holds its lock."""
    try:
        import fcntl
    except ImportError:
        _lock_for_windows(descriptor)
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise LockedElsewhereError from error
    except OSError:  # a file system without locks
        return


def _lock_for_windows(descriptor: int) -> None:
    import msvcrt

    os.lseek(descriptor, _FAR, os.SEEK_SET)
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError as error:
        raise LockedElsewhereError from error
    finally:
        os.lseek(descriptor, 0, os.SEEK_SET)
