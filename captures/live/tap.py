"""One port, open for listening. A tap never transmits.

On POSIX a device's descriptor is exchanged for one that is open for reading only, so that the kernel itself refuses a
write; elsewhere nothing in this project writes to it. RTS and DTR are set low before the port is opened, since an
adapter may key its driver by them. The port is locked, so that no other program takes half of the bytes.

Errors of single bytes (parity, framing) are marked by the driver where it can (PARMRK). What an adapter or driver can't
do is a notice, not a failure.
"""

from __future__ import annotations

import errno
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import serial

from captures.errors import CaptureError, os_reason

from .latency import make_prompt
from .parmrk import Unmarked
from .settings import FALLBACK_BAUD, PortSettings

READ_BYTES: Final = 4096
_WAIT_S: Final = 0.2  # of a blocking read, after which it looks whether it should end


class PortError(CaptureError):
    """A port that can't be opened or listened to, in one line; it may come back."""


class PortGoneError(Exception):
    """The port is not there any more: unplugged, or its other end closed."""


class Tap:
    """An open port. `descriptor` can be waited on; None where only `read` can wait."""

    def __init__(self, settings: PortSettings, *, blocking: bool = False) -> None:
        """Open it; PortError says in one line why it can't be. `blocking`: only by pyserial's own read."""
        self.settings = settings
        self.notices: list[str] = []
        self.descriptor: int | None = None
        self._marks: Unmarked | None = None
        self._serial = self._open(settings)
        self.kind = _kind(settings)
        if os.name == "posix" and not blocking:
            self._take_descriptor()
        if settings.is_device:
            self.notices += make_prompt(self._serial, settings.url)

    def read(self) -> tuple[bytes, list[int]]:
        """What has come, and which of it (offsets) with an error; nothing after a wait of 0.2 s without a descriptor.

        PortGoneError where nothing can come any more.
        """
        if self.descriptor is None:
            return self._burst(), []
        try:
            data = os.read(self.descriptor, READ_BYTES)
        except BlockingIOError:
            return b"", []
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error
        if not data:
            raise PortGoneError("closed at its other end, or unplugged")
        return (data, []) if self._marks is None else self._marks.feed(data)

    def change(self, settings: PortSettings) -> None:
        """Other line settings on the open port; what was received with the old ones and not read is lost."""
        self.settings = settings
        try:
            self._serial.baudrate = settings.baud or FALLBACK_BAUD
            self._serial.parity = settings.parity
            self._serial.bytesize = settings.data_bits
            with suppress(OSError, ValueError, serial.SerialException, AttributeError):
                self._serial.reset_input_buffer()
        except (OSError, ValueError, serial.SerialException) as error:
            raise PortGoneError(_words(error)) from error
        except Exception as error:  # termios.error is none of these
            self.notices.append(f"{settings.url}: {settings} is refused: {error}")
        self._mark_errors()

    def close(self) -> None:
        """Let go of the port."""
        with suppress(Exception):  # an unplugged one complains in many ways
            self._serial.close()

    def _open(self, settings: PortSettings) -> Any:
        try:
            return _opened(settings, settings.parity)
        except PortError:
            raise
        except Exception as error:  # termios.error of a pseudo-terminal that knows no parity
            if settings.parity == "N":
                raise PortError(f"{settings.url}: cannot be opened: {_words(error)}") from error
            self.notices.append(f"{settings.url}: parity cannot be set here ({_words(error)}): listening without")
            return _opened(settings, "N")

    def _take_descriptor(self) -> None:
        try:
            self.descriptor = self._serial.fileno()
        except Exception:  # rfc2217 and loop have none
            return
        if self.settings.is_device:
            self._forbid_writing(self.descriptor)
            self._mark_errors()
        else:
            os.set_blocking(self.descriptor, False)

    def _forbid_writing(self, descriptor: int) -> None:
        import fcntl
        import termios

        path = self._serial.portstr
        reading = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        os.dup2(reading, descriptor, inheritable=False)
        os.close(reading)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # pyserial's went with its descriptor
        except OSError as error:
            raise PortError(_refused(self.settings.url, error)) from error
        with suppress(OSError):
            fcntl.ioctl(descriptor, termios.TIOCEXCL)

    def _mark_errors(self) -> None:
        """Let the driver mark bytes with errors; any change of settings by pyserial takes that away again."""
        if self.descriptor is None or not self.settings.is_device:
            return
        import termios

        self._marks = None
        try:
            modes = termios.tcgetattr(self.descriptor)
            modes[0] |= termios.INPCK | termios.PARMRK
            modes[0] &= ~(termios.IGNPAR | termios.IGNBRK | termios.BRKINT | termios.ISTRIP)
            termios.tcsetattr(self.descriptor, termios.TCSANOW, modes)
            if termios.tcgetattr(self.descriptor)[0] & termios.PARMRK:
                self._marks = Unmarked()
        except termios.error as error:
            self.notices.append(f"{self.settings.url}: parity and framing errors cannot be seen here ({error})")

    def _burst(self) -> bytes:
        try:
            data: bytes = self._serial.read(1)
            while data and len(data) < READ_BYTES and (waiting := self._serial.in_waiting):
                data += self._serial.read(min(waiting, READ_BYTES - len(data)))
        except (serial.SerialException, OSError, TypeError) as error:  # TypeError: pyserial's, closed while it waits
            raise PortGoneError(_words(error)) from error
        return data


def _opened(settings: PortSettings, parity: str) -> Any:
    try:
        port = serial.serial_for_url(
            settings.url,
            do_not_open=True,
            baudrate=settings.baud or FALLBACK_BAUD,
            bytesize=settings.data_bits,
            parity=parity,
            timeout=_WAIT_S,
        )
        if settings.is_device:
            port.exclusive = True
        port.rts = port.dtr = False
        port.open()
    except (serial.SerialException, OSError) as error:
        raise PortError(_refused(settings.url, error)) from error
    except ValueError as error:
        raise PortError(f"{settings.url}: {_words(error)}") from error
    return port


def _refused(url: str, error: Exception) -> str:
    """Why a port could not be opened, and what to do."""
    code, text = getattr(error, "errno", None), str(error)
    if code == errno.ENOENT or "FileNotFoundError" in text:
        return f"{url}: no such port; `rtuscope ports` lists those that are there"
    if code in (errno.EAGAIN, errno.EBUSY) or (os.name == "nt" and "PermissionError" in text):
        return f"{url}: in use by another program: end that one first, or listen through a tap of its own"
    if code == errno.EACCES:
        return f"{url}: no permission: `sudo usermod -aG {_group(url)} $USER`, then log in again"
    if code == errno.ENOTTY or "Inappropriate ioctl" in text:
        return f"{url}: not a serial port"
    return f"{url}: cannot be opened: {_words(error)}"


def _group(url: str) -> str:
    """The group that may open a device; by most distributions `dialout`."""
    try:
        return Path(url).group()
    except (OSError, KeyError, NotImplementedError):
        return "dialout"


def _words(error: Exception) -> str:
    """What went wrong, without the port's name and the number that libraries put before it."""
    text = re.sub(r"^(?i:could not open port) .*?: |\[Errno \d+\] ", "", str(error))
    return " ".join(text.split()) or type(error).__name__


def _kind(settings: PortSettings) -> str:
    """The kind of tap, in one word: usb, uart, pty, or the scheme of the URL."""
    if not settings.is_device:
        return settings.url.partition("://")[0]
    real = os.path.realpath(settings.url)
    if real.startswith(("/dev/pts/", "/dev/ttys")):
        return "pty"
    driver = os.path.realpath(f"/sys/class/tty/{os.path.basename(real)}/device")  # noqa: PTH119
    return "usb" if "/usb" in driver or "usb" in real.lower() else "uart"
