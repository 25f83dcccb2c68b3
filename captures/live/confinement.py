"""The rights that a process gives up which reads what strangers send: the reader of taps, before it opens a port.

On Linux (x86-64, ARM64) the kernel then refuses it, by a seccomp filter, to run programs, to make processes, to create,
shorten, rename or remove files, to open anything for reading and writing, to send a break or a character on a terminal,
to change who it is, to reach into other processes, and, where no port is one of the network, to make a connection. On
other POSIX systems it can write no file (RLIMIT_FSIZE). Windows has none of this for a process that runs already.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from typing import Final, NamedTuple


class Machine(NamedTuple):
    """Numbers of the kernel's calls on one kind of machine."""

    audit: int  # as seccomp names the machine
    denied: tuple[int, ...]
    network: tuple[int, ...]  # socket, connect, bind, listen, accept, accept4
    opens: tuple[tuple[int, int], ...]  # a call that opens, and the place of its flags among its arguments
    clone: int
    ioctl: int


_EVERYWHERE: Final = (425, 426, 427, 424, 434, 438, 452)  # io_uring, pidfd, fchmodat2
# Refused as unknown: a filter does not see what they are asked, and libc knows others.
_CLONE3, _OPENAT2 = 435, 437
MACHINES: Final = {
    "x86_64": Machine(
        0xC000003E,
        (
            57, 58, 59, 322, 62, 101, 200, 310, 311,  # fork, vfork, execve, execveat, kill, ptrace, tkill, process_vm_*
            76, 77, 82, 83, 84, 85, 86, 87, 88, 90, 91, 92, 93, 94, 133,  # truncate ... unlink ... chmod, chown, mknod
            258, 259, 260, 263, 264, 265, 266, 268, 316, 319,  # the same beside a folder, memfd_create
            105, 106, 113, 114, 116, 117, 119, 155, 161, 165, 166, 272, 308,  # set*id, pivot_root, chroot, mount, setns
            169, 175, 176, 246, 248, 249, 250, 298, 313, 321, 323, *_EVERYWHERE,  # reboot, modules, keys, perf, bpf
        ),
        (41, 42, 49, 50, 43, 288),
        ((2, 1), (257, 2)),
        56,
        16,
    ),
    "aarch64": Machine(
        0xC00000B7,
        (
            221, 281, 129, 117, 130, 270, 271,
            45, 46, 33, 34, 35, 36, 37, 38, 276, 52, 53, 54, 55, 279,
            146, 144, 145, 143, 159, 147, 149, 41, 51, 40, 39, 97, 268,
            142, 105, 106, 104, 217, 218, 219, 241, 273, 280, 282, *_EVERYWHERE,
        ),
        (198, 203, 200, 201, 202, 242),
        ((56, 2),),
        220,
        29,
    ),
}  # fmt: skip
_SENDING: Final = (0x5409, 0x540A, 0x5412, 0x5425, 0x5427)  # TCSBRK, TCXONC, TIOCSTI, TCSBRKP, TIOCSBRK
_CHANGING: Final = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_THREAD: Final = 0x10000  # CLONE_THREAD

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06  # of BPF
_ALLOW: Final = 0x7FFF0000
_NUMBER, _MACHINE, _ARGUMENTS = 0, 4, 16  # where things stand in what a filter looks at
_NO_NEW_PRIVILEGES, _SET_SECCOMP, _FILTER = 38, 22, 2  # of prctl


def confine(*, network: bool) -> bool:
    """Give up what reading ports does not need; whether the kernel filters calls now. `network`: a port is of it."""
    _limit()
    machine = MACHINES.get(platform.machine()) if sys.platform == "linux" and sys.maxsize >> 32 else None
    if machine is None:
        return False
    program = filter_of(machine, network=network)
    steps = b"".join(struct.pack("=HBBI", *step) for step in program)
    held = ctypes.create_string_buffer(steps, len(steps))
    handed = ctypes.create_string_buffer(struct.pack("@HP", len(program), ctypes.addressof(held)))
    try:
        prctl = ctypes.CDLL(None, use_errno=True).prctl
        return not prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0) and not prctl(_SET_SECCOMP, _FILTER, handed, 0, 0)
    except (OSError, AttributeError):
        return False


def _limit() -> None:
    """What any POSIX system can: no file grows, no memory image is left."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        for name in ("RLIMIT_FSIZE", "RLIMIT_CORE"):
            resource.setrlimit(getattr(resource, name), (0, 0))


def filter_of(machine: Machine, *, network: bool) -> list[tuple[int, int, int, int]]:
    """The filter as steps of BPF: code, how many steps are left out where it holds and where not, number."""
    program = [(_LOAD, 0, 0, _MACHINE), (_EQUAL, 1, 0, machine.audit), *_refuse(errno.EPERM), (_LOAD, 0, 0, _NUMBER)]
    program += [(_AT_LEAST, 0, 1, 0x40000000), *_refuse(errno.EPERM)]  # the other numbers of x86-64
    for number in (*machine.denied, *(() if network else machine.network)):
        program += [(_EQUAL, 0, 1, number), *_refuse(errno.EPERM)]
    for number in (_CLONE3, _OPENAT2):
        program += [(_EQUAL, 0, 1, number), *_refuse(errno.ENOSYS)]
    program += _where(machine.clone, 0, [(_ANY_BIT, 1, 0, _THREAD), *_refuse(errno.EPERM)])
    program += _where(
        machine.ioctl, 1, [step for code in _SENDING for step in ((_EQUAL, 0, 1, code), *_refuse(errno.EPERM))]
    )
    for number, place in machine.opens:
        program += _where(number, place, [(_ANY_BIT, 0, 1, _CHANGING), *_refuse(errno.EPERM)])
    return [*program, (_RETURN, 0, 0, _ALLOW)]


def _refuse(number: int) -> list[tuple[int, int, int, int]]:
    return [(_RETURN, 0, 0, 0x00050000 | number)]


def _where(number: int, place: int, look: Iterable[tuple[int, int, int, int]]) -> list[tuple[int, int, int, int]]:
    """A look at one argument of one call; what it does not refuse is allowed."""
    steps = [(_LOAD, 0, 0, _ARGUMENTS + 8 * place), *look, (_RETURN, 0, 0, _ALLOW)]
    return [(_EQUAL, 0, len(steps), number), *steps]
