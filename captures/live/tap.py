"""One port, open for listening. A tap never transmits, and leaves the line as it is.

And whether this user may listen to a device, who has it open already, and what to do about either.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import serial

from ..disposal import device_stream
from ..errors import CaptureError, os_reason
from .settings import FALLBACK_BAUD, PortSettings

# Groups that distributions made for serial ports. To be in another, as root or disk, gives rights over the machine.
_GROUPS: Final = frozenset({"dialout", "uucp", "plugdev", "serial"})
_RULE: Final = "assign it to group dialout with a udev rule (docs/live.md, `A device that may not be opened`)"


def real_device(device: str) -> str:
    """The device that a name leads to. On Windows the name itself: to ask where it leads would open the port."""
    return device.upper() if os.name == "nt" else os.path.realpath(device)


def may_listen(device: str) -> bool:
    """Whether this user may open it for reading; where that is not told by a file's mode, it is taken to be so."""
    return os.name == "nt" or os.access(device, os.R_OK)


def access_advice(device: str) -> str:
    """What someone does who may not open a device."""
    if not sys.platform.startswith("linux"):
        return "ask this computer's administrator"
    group = _serial_group(device)
    if group is None:
        return f"no group for serial ports can read it; {_RULE}"
    return f"`sudo usermod -aG {group} $USER`, then log in again"


def _serial_group(device: str) -> str | None:
    """The group to be in, if there is one that is for serial ports and may read the device."""
    try:
        group, mode = Path(device).group(), Path(device).stat().st_mode
    except (OSError, KeyError, NotImplementedError):
        return None
    return group if group in _GROUPS and mode & stat.S_IRGRP else None


def programs_using(device: str) -> list[str]:
    """Other programs that have this device open, as far as /proc shows them to this user: `name (process)`."""
    return programs_by_device().get(real_device(device), [])


def programs_by_device() -> dict[str, list[str]]:
    """Other programs that have terminal devices open, by device."""
    users: dict[str, list[str]] = {}
    for process, device in _open_devices():
        with suppress(OSError):
            who = f"{(process / 'comm').read_text().strip()} ({process.name})"
            programs = users.setdefault(device, [])
            if who not in programs:
                programs.append(who)
    return users


def _open_devices() -> Iterator[tuple[Path, str]]:
    if not sys.platform.startswith("linux"):
        return
    own = str(os.getpid())
    with suppress(OSError):
        for process in Path("/proc").glob("[0-9]*"):
            if process.name == own:
                continue
            with suppress(OSError):
                for descriptor in (process / "fd").iterdir():
                    with suppress(OSError):
                        target = os.readlink(descriptor)  # noqa: PTH115 - a string is wanted
                        if target.startswith(("/dev/tty", "/dev/pts/")):
                            yield process, target


READ_BYTES: Final = 4096
WAIT_S: Final = 0.2  # of a blocking read, after which it looks whether it should end
_POSIX: Final = os.name == "posix"
_IN_USE: Final = "close it first, or listen through a separate adapter"
GONE: Final = "closed by the other end, or unplugged"
_TIMED_OUT: Final = re.compile(r"\b1460\b")  # ERROR_TIMEOUT of Windows in pyserial's words: some drivers, and Wine


class PortError(CaptureError):
    """A port that can't be opened or listened to, in one line; it may come back."""


class PortGoneError(Exception):
    """The port is not there any more: unplugged, or its other end closed."""


class Tap:
    """An open port. `descriptor` can be waited on; None where only `read` can wait."""

    def __init__(self, settings: PortSettings, kind: str) -> None:
        """`settings` as they are in force; `kind` of tap in one word: usb, uart, pty, or the scheme of the URL."""
        self.settings = settings
        self.kind = kind
        self.notices: list[str] = []
        self.descriptor: int | None = None

    def read(self) -> tuple[bytes, list[int]]:
        """What has come, and which of it (offsets) with an error; nothing after a wait of 0.2 s without a descriptor.

        PortGoneError where nothing can come any more.
        """
        raise NotImplementedError

    def change(self, settings: PortSettings) -> None:
        """Other line settings on the open port; what was received with the old ones and not read is lost."""
        self.settings = settings

    def close(self) -> None:
        """Let go of the port."""
        raise NotImplementedError


class DeviceTap(Tap):
    """A serial device of this machine."""

    def __init__(self, settings: PortSettings, *, blocking: bool = False) -> None:
        """Open it; PortError says in one line why it can't be. `blocking`: only by pyserial's own read."""
        super().__init__(settings, port_kind(settings))
        if self.kind != "pty" and (users := programs_using(settings.url)):
            raise PortError(f"{settings.url}: in use by {', '.join(users)}: {_IN_USE}")
        self._port = _opened(settings)
        self._marks: Unmarked | None = None
        self._high: list[str] | None = []  # lines that were told to be high
        try:
            self.notices += make_prompt(self._port, settings.url)
            if _POSIX:
                self._port.lower_lines()  # as after each setting
                self.descriptor = None if blocking else self._port.fileno()
            self._check_driver()
        except OSError as error:
            self.close()
            raise PortError(refusal(settings.url, error)) from error

    def read(self) -> tuple[bytes, list[int]]:
        """See `Tap`."""
        data = self._burst() if self.descriptor is None else self._waiting(self.descriptor)
        return (data, []) if self._marks is None else self._marks.feed(data)

    def change(self, settings: PortSettings) -> None:
        """See `Tap`."""
        super().change(settings)
        try:
            self._port.baudrate = settings.baud or FALLBACK_BAUD
            self._port.parity = settings.parity
            self._port.bytesize = settings.data_bits
            with suppress(OSError, ValueError, serial.SerialException, AttributeError):
                self._port.reset_input_buffer()
        except (OSError, ValueError, serial.SerialException) as error:
            raise PortGoneError(_cause_of_error(error)) from error
        except Exception as error:  # termios.error is none of these
            self.notices.append(f"{settings.url}: {settings} is refused: {error}")
        self._check_driver()

    def close(self) -> None:
        """See `Tap`."""
        self.descriptor = None
        with suppress(Exception):  # an unplugged one complains in many ways
            self._port.close()

    def _check_driver(self) -> None:
        """What the driver made of the settings, and whether RTS and DTR are low."""
        if not _POSIX:
            return
        self._marks = Unmarked() if self._port.marks_errors else None
        complaints, high = self._port.complaints, self._port.high_lines()
        if self.kind != "pty" and high != self._high:
            complaints += high_line_words(high)
            self._high = high
        self.notices += [f"{self.settings.url}: {complaint}" for complaint in complaints]
        self._port.complaints = []

    @staticmethod
    def _waiting(descriptor: int) -> bytes:
        try:
            data = os.read(descriptor, READ_BYTES)  # as much as a terminal keeps: it is empty then
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error
        if not data:
            raise PortGoneError(GONE)
        return data

    def _burst(self) -> bytes:
        data: bytes = b""
        try:
            data = self._port.read(1)
            while data and len(data) < READ_BYTES and (waiting := self._port.in_waiting):
                data += self._port.read(min(waiting, READ_BYTES - len(data)))
        except (serial.SerialException, OSError, TypeError) as error:  # TypeError: pyserial's, closed while it waits
            if not _POSIX and _TIMED_OUT.search(str(error)):
                return data
            raise PortGoneError(_cause_of_error(error)) from error
        return data


def high_line_words(high: list[str] | None) -> list[str]:
    """What to say of the lines that are high though a tap wants them low; None: that cannot be read."""
    use = "use one with automatic direction control, or leave its transmitter unconnected"
    if high is None:
        return [
            f"cannot check that RTS and DTR are low; an adapter that transmits on one of them blocks the bus: {use}"
        ]
    if not high:
        return []
    stay, them = ("stays", "it") if len(high) == 1 else ("stay", "them")
    return [f"{' and '.join(high)} {stay} high; an adapter that transmits on {them} BLOCKS THE BUS: {use}"]


def _opened(settings: PortSettings) -> Any:
    """pyserial's port, open, its lines low."""
    try:
        port = _port_class()(
            baudrate=settings.baud or FALLBACK_BAUD,
            bytesize=settings.data_bits,
            parity=settings.parity,
            timeout=WAIT_S,
        )
        port.port = settings.url
        port.rts = port.dtr = False
        port.open()
    except (serial.SerialException, OSError) as error:
        raise PortError(refusal(settings.url, error)) from error
    except Exception as error:  # termios.error, ValueError
        raise PortError(f"{settings.url}: cannot be opened: {_cause_of_error(error)}") from error
    return port


def _port_class() -> Any:
    if not _POSIX:
        return serial.Serial
    from .readonly import ReadOnlyPort

    return ReadOnlyPort


def refusal(url: str, error: Exception) -> str:
    """Why a port could not be opened, and what to do."""
    code, text = getattr(error, "errno", None), str(error)
    if code == errno.ENOENT or "FileNotFoundError" in text:
        return f"{url}: no such port; `rtuscope ports` lists the ports"
    if code in (errno.EAGAIN, errno.EBUSY) or (os.name == "nt" and "PermissionError" in text):
        return f"{url}: in use by another program: {_IN_USE}"
    if code == errno.EACCES:
        return f"{url}: no permission: {access_advice(url)}"
    if Path(url).is_file():
        return (
            f"{url}: a file, not a serial port: "
            "view a capture with `rtuscope open`, play it back with `rtuscope replay`"
        )
    if code in (errno.ENOTTY, errno.EISDIR) or "Inappropriate ioctl" in text:
        return f"{url}: not a serial port"
    return f"{url}: cannot be opened: {_cause_of_error(error)}"


def _cause_of_error(error: Exception) -> str:
    """What went wrong, without the port's name and the number that libraries put before it."""
    text = re.sub(r"^(?i:could not open port) .*?: |\[Errno \d+\] ", "", str(error))
    return " ".join(text.split()) or type(error).__name__


def port_kind(settings: PortSettings) -> str:
    """The kind of tap: usb, uart or pty."""
    real = real_device(settings.url)
    if real.startswith(("/dev/pts/", "/dev/ttys")):
        return "pty"
    driver = os.path.realpath(f"/sys/class/tty/{os.path.basename(real)}/device")  # noqa: PTH119
    return "usb" if "/usb" in driver or "usb" in real.lower() else "uart"


# What a terminal driver puts into the bytes where PARMRK is set, taken out again.
#
# A byte that came with a parity or framing error is read as FF 00 and the byte, a break as FF 00 00, and a true FF as
# FF FF (termios(3)). A mark may be cut anywhere by the end of a read.


_FF = 0xFF


class Unmarked:
    """The bytes of one port as they were on the wire; keeps what a read has cut."""

    def __init__(self) -> None:
        self._held = b""  # FF, or FF 00, that the next read completes

    def feed(self, data: bytes) -> tuple[bytes, list[int]]:
        """The bytes that a read brought, and which of them (offsets) came with an error."""
        if not self._held and _FF not in data:
            return data, []
        data, self._held = self._held + data, b""
        out = bytearray()
        errors: list[int] = []
        at = 0
        while (mark := data.find(_FF, at)) >= 0:
            out += data[at:mark]
            code = data[mark + 1 : mark + 2]
            if code == b"\0":
                if mark + 2 >= len(data):
                    self._held = data[mark:]
                    return bytes(out), errors
                errors.append(len(out))
                out.append(data[mark + 2])
                at = mark + 3
            elif code:  # FF FF; any other is no mark that a driver makes: kept as it is
                out.append(_FF)
                at = mark + (2 if code == b"\xff" else 1)
            else:
                self._held = data[mark:]
                return bytes(out), errors
        out += data[at:]
        return bytes(out), errors


# Adapters made prompt: a byte told when it comes, not when a buffer is full or a timer runs out.
#
# The kernel's low-latency flag does it for most drivers; FTDI's have a timer besides, 16 ms by default, in sysfs.


PROMPT_MS: Final = 1


def latency_timer(device: str) -> Path | None:
    """The file with the latency timer (ms) of an FTDI adapter; None where there is none."""
    path = Path("/sys/bus/usb-serial/devices") / Path(real_device(device)).name / "latency_timer"
    return path if path.exists() else None


def latency_ms(device: str) -> int | None:
    """The latency timer of an adapter, ms; None where it has none."""
    path = latency_timer(device)
    try:
        return None if path is None else int(path.read_text())
    except (OSError, ValueError):
        return None


def make_prompt(port: Any, device: str) -> list[str]:
    """Ask the driver of an open port to be prompt; what could not be done, with the command that would."""
    with suppress(AttributeError, NotImplementedError, ValueError, OSError):  # not this driver, or not this system
        port.set_low_latency_mode(True)
    path = latency_timer(device)
    if path is None or (latency_ms(device) or 0) <= PROMPT_MS:
        return []
    try:
        with device_stream(path) as setting:  # for writing and no more than that: see `confinement`
            setting.write(b"%d\n" % PROMPT_MS)
    except OSError:
        return [
            f"{device}: the adapter delays bytes by {latency_ms(device)} ms, which hides gaps between frames: "
            f"`echo {PROMPT_MS} | sudo tee {path}`"
        ]
    return []
