"""How a port is opened, in plain values that travel between processes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..line import LineSettings

FALLBACK_BAUD = 9600  # where none matters: a pseudo-terminal, a socket


@dataclass(frozen=True, slots=True)
class PortSettings:
    """One port and its line settings.

    `url` is a device (`/dev/ttyUSB0`, `COM3`), a gateway's raw TCP (`socket://HOST:PORT`) or a port server
    (`rfc2217://HOST:PORT`). `baud` None: not known, or no matter of this port. Receiving needs one stop bit, whatever
    the line has, so `stop_bits` only says how long a character is. `remote_changes` names the settings that a port
    server is told to set when it is opened; the others are left as they are there.
    """

    url: str
    baud: int | None = None
    parity: str = "N"
    stop_bits: float = 1
    data_bits: int = 8
    remote_changes: tuple[str, ...] = ()

    @property
    def is_device(self) -> bool:
        """Whether this is a serial device of this machine, with settings of its own."""
        return "://" not in self.url

    @property
    def is_bare_pty(self) -> bool:
        """Whether this is a pseudo-terminal by its number, which the system gives to another one once it is closed."""
        return self.url.startswith(("/dev/pts/", "/dev/ttys"))

    @property
    def is_port_server(self) -> bool:
        """Whether this is a serial port elsewhere, whose settings can be asked for and set."""
        return self.url.lower().startswith("rfc2217://")

    @property
    def char_bits(self) -> int:
        """Bits of a character on the line, start and stop bits included."""
        return 1 + self.data_bits + (self.parity != "N") + round(self.stop_bits)

    @property
    def silence_ns(self) -> int:
        """Ten characters: longer than the pause between two reads of an 8-byte FIFO amid a frame. 0 without a rate."""
        return 0 if self.baud is None else int(10 * self.char_bits * 1e9 / self.baud)

    def __str__(self) -> str:
        """As people write it: `9600 8N1`."""
        return f"{self.baud or '?'} {self.data_bits}{self.parity}{self.stop_bits:g}"

    def line(self, tap: str | None = None) -> LineSettings:
        """What a capture made with these says of its line."""
        if self.baud is None:
            return LineSettings(tap=tap)
        return LineSettings(
            baud=self.baud, char_bits=self.char_bits, parity=self.parity, stop_bits=self.stop_bits, tap=tap
        )

    def to_json(self) -> dict[str, Any]:
        """What `from_json` takes."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> PortSettings:
        """What `to_json` gave."""
        return cls(**{**values, "remote_changes": tuple(values.get("remote_changes", ()))})
