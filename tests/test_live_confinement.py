"""The process that reads ports gives up what it does not need, and reads all the same."""

from __future__ import annotations

import errno
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import pytest
from livebus import Running, eventually, pty

from captures.live.confinement import MACHINES, filter_of

confined = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() not in MACHINES, reason="seccomp of Linux, on x86-64 and ARM64"
)

_TRIES = """
import ctypes, fcntl, json, os, socket, sys, threading
from captures.live.confinement import confine
folder = sys.argv[1]
tty, own = os.openpty()
filtered = confine(network=sys.argv[2] == "network")

def tried(work):
    try:
        work()
    except OSError as error:
        return error.errno
    except RuntimeError:
        return "runtime"
    return 0

def thread():
    begun = threading.Thread(target=list)
    begun.start()
    begun.join()

outcomes = {
    "read": tried(lambda: open(folder + "/there", "rb").read()),
    "thread": tried(thread),
    "settings": tried(lambda: fcntl.ioctl(own, 0x5401, bytes(60))),
    "run": tried(lambda: os.execv("/bin/true", ["true"])),
    "fork": tried(lambda: os.fork() or os._exit(0)),
    "spawn": tried(lambda: os.posix_spawn("/bin/true", ["true"], {})),
    "create": tried(lambda: open(folder + "/new", "w")),
    "shorten": tried(lambda: open(folder + "/there", "w")),
    "both ways": tried(lambda: open(folder + "/there", "r+b")),
    "remove": tried(lambda: os.unlink(folder + "/there")),
    "rename": tried(lambda: os.rename(folder + "/there", folder + "/new")),
    "grow": tried(lambda: os.write(os.open(folder + "/there", os.O_WRONLY), b"x")),
    "break": tried(lambda: fcntl.ioctl(own, 0x5409, 0)),
    "type": tried(lambda: fcntl.ioctl(own, 0x5412, b"x")),
    "kill": tried(lambda: os.kill(os.getppid(), 0)),
    "connect": tried(lambda: socket.socket(socket.AF_INET)),
}
os.write(1, json.dumps([filtered, outcomes]).encode())
os._exit(0)
"""


@confined
@pytest.mark.parametrize("network", ["device", "network"])
def test_what_a_reader_does_not_need_the_kernel_refuses(tmp_path: Path, network: str) -> None:
    (tmp_path / "there").write_bytes(b"12345")
    done = subprocess.run(
        [sys.executable, "-c", _TRIES, str(tmp_path), network], capture_output=True, timeout=60, check=True
    )
    filtered, outcomes = json.loads(done.stdout)
    if not filtered:
        pytest.skip("this kernel, or the container that this runs in, has no seccomp filters")
    assert {name for name, code in outcomes.items() if code == 0} == {
        "read", "thread", "settings", *(["connect"] if network == "network" else []),
    }, outcomes  # fmt: skip
    assert outcomes["grow"] == errno.EFBIG
    assert {code for name, code in outcomes.items() if code and name not in ("grow", "spawn")} == {errno.EPERM}
    assert (tmp_path / "there").read_bytes() == b"12345"
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


@pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES)
@pytest.mark.parametrize("network", [False, True])
def test_a_filter_decides_every_call_and_jumps_nowhere_else(machine, network: bool) -> None:
    program = filter_of(machine, network=network)
    assert len(program) <= 4096
    for at, (code, true, false, _) in enumerate(program):
        if code & 7 == 5:
            assert at + 1 + max(true, false) < len(program) and max(true, false) < 256
    assert len(set(machine.denied)) == len(machine.denied)

    def decided(number: int, *arguments: int) -> int:
        seen = {0: number, 4: machine.audit, **{16 + 8 * i: value for i, value in enumerate(arguments)}}
        at = value = 0
        while True:
            code, true, false, k = program[at]
            at += 1
            if code == 0x20:
                value = seen.get(k, 0)
            elif code == 0x06:
                return k & 0xFFFF if k >> 16 == 5 else 0
            else:
                holds = {0x15: value == k, 0x35: value >= k, 0x45: bool(value & k)}[code]
                at += true if holds else false

    assert all(decided(number) == errno.EPERM for number in machine.denied)
    assert {decided(number) for number in machine.network} == {0 if network else errno.EPERM}
    assert decided(machine.clone, 0x3D0F00) == 0 and decided(machine.clone, 0x1200011) == errno.EPERM
    assert decided(machine.ioctl, 3, 0x5402) == 0 and decided(machine.ioctl, 3, 0x5409) == errno.EPERM
    for number, place in machine.opens:
        assert decided(number, *[0] * place, os.O_RDONLY) == decided(number, *[0] * place, os.O_WRONLY) == 0
        assert decided(number, *[0] * place, os.O_WRONLY | os.O_CREAT) == errno.EPERM
    assert decided(1 << 30) == errno.EPERM


@confined
def test_a_reader_at_work_is_confined_and_has_one_descriptor_of_the_device() -> None:
    master, name = pty()
    sniff = Running("sniff", name, "--baud", "19200", "--json", reads=True)
    reader = int(Path(f"/proc/{sniff.process.pid}/task/{sniff.process.pid}/children").read_text().split()[0])
    status = Path(f"/proc/{reader}/status").read_text()
    opened = [str(link.readlink()) for link in Path(f"/proc/{reader}/fd").iterdir()]
    for _ in range(3):
        os.write(master, bytes.fromhex("1103006b00037687"))
        time.sleep(0.02)
        os.write(master, bytes.fromhex("110306ae415652434049ad"))
        time.sleep(0.05)
    assert eventually(lambda: sniff.out.count(b'"direction":') >= 6)
    sniff.ended()
    assert "NoNewPrivs:\t1" in status
    assert "Seccomp:\t2" in status
    assert [each for each in opened if not each.startswith(("pipe:", "anon_inode:"))] == [os.path.realpath(name)]
