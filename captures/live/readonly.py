"""A serial device on POSIX, opened once, for reading only, with RTS and DTR low.

An adapter may key its driver by RTS or DTR, and hold the bus for as long as one of them is high. Linux raises both each
time that a device is opened. So a device is opened once; the lines are lowered on that very descriptor, before anything
else is set, and again after every change of settings, since a driver may raise them then. As the descriptor is open for
reading only, the kernel refuses a write.

A device that nobody has used yet echoes: what it receives the kernel sends back, as to a typist, though nobody writes.
That is ended first of all, a few microseconds after the open.

Needs termios: import it where there is one.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import termios
from contextlib import suppress
from typing import Any, Final

import serial

_LINES: Final = {"RTS": termios.TIOCM_RTS, "DTR": termios.TIOCM_DTR}
_BOTH: Final = struct.pack("i", termios.TIOCM_RTS | termios.TIOCM_DTR)
_NO_LINES: Final = {errno.EINVAL, errno.ENOTTY}  # the device has none, as a pseudo-terminal


class ReadOnlyPort(serial.Serial):  # type: ignore[misc] # pyserial is not typed
    """pyserial's port, whose ways to set a line up are kept and whose way to open it is not.

    `complaints` are what could not be done, a few words each; `marks_errors` tells whether the driver marks bytes with
    an error (PARMRK).
    """

    fd: Any
    _parity: str

    def __init__(self, **settings: Any) -> None:
        self.complaints: list[str] = []
        self.marks_errors = False
        super().__init__(**settings)

    def open(self) -> None:
        """Open the device. OSError where it can't be, BlockingIOError where another program has locked it."""
        self.fd = os.open(self.portstr, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            fcntl.flock(self.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)  # first: another program's lines are its own business
            self._end_echo()
            self.lower_lines()
            fcntl.ioctl(self.fd, termios.TIOCEXCL)
            try:
                self._reconfigure_port(force_update=True)
            except termios.error as error:
                if self._parity == "N":
                    raise
                self.complaints.append(f"parity cannot be set here ({error.args[-1]}): listening without it")
                self._parity = "N"
                self._reconfigure_port(force_update=True)
            termios.tcflush(self.fd, termios.TCIFLUSH)
            self.pipe_abort_read_r, self.pipe_abort_read_w = os.pipe()
            self.pipe_abort_write_r, self.pipe_abort_write_w = os.pipe()
        except BaseException:
            os.close(self.fd)
            self.fd = None
            raise
        self.is_open = True

    def _end_echo(self) -> None:
        """Let the kernel send nothing back, nor what waits to be sent.

        Only this is changed, so that a driver need not ask its adapter first.
        """
        with suppress(termios.error):  # no serial port: what comes next tells
            modes = termios.tcgetattr(self.fd)
            modes[3] &= ~(termios.ECHO | termios.ECHONL | termios.ICANON | termios.ISIG | termios.IEXTEN)
            termios.tcsetattr(self.fd, termios.TCSANOW, modes)
            termios.tcflush(self.fd, termios.TCOFLUSH)

    def lower_lines(self) -> None:
        """RTS and DTR low, with one call."""
        try:
            fcntl.ioctl(self.fd, termios.TIOCMBIC, _BOTH)
        except OSError as error:
            if error.errno not in _NO_LINES:
                raise

    def high_lines(self) -> list[str] | None:
        """Which of RTS and DTR are high, as the driver tells; None where it does not."""
        try:
            (lines,) = struct.unpack("i", fcntl.ioctl(self.fd, termios.TIOCMGET, b"\0" * 4))
        except OSError:
            return None
        return [name for name, bit in _LINES.items() if lines & bit]

    def _reconfigure_port(self, force_update: bool = False) -> None:
        """pyserial's, called by each change of a setting; with modes of our own, and the lines low after each step."""
        try:
            super()._reconfigure_port(force_update)
            self.lower_lines()
            self._set_modes()
        finally:
            self.lower_lines()

    def _set_modes(self) -> None:
        """What pyserial sets otherwise: the driver marks errors; a read of no bytes means that the port is gone."""
        try:
            modes = termios.tcgetattr(self.fd)
            modes[0] |= termios.INPCK | termios.PARMRK
            modes[0] &= ~(termios.IGNPAR | termios.IGNBRK | termios.BRKINT | termios.ISTRIP)
            modes[6][termios.VMIN] = 1  # where nothing waits, a read is refused rather than empty
            termios.tcsetattr(self.fd, termios.TCSANOW, modes)
            self.marks_errors = bool(termios.tcgetattr(self.fd)[0] & termios.PARMRK)
        except termios.error as error:
            self.marks_errors = False
            self.complaints.append(f"parity and framing errors cannot be seen here ({error.args[-1]})")
