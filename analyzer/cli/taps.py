"""What `sniff` and `record` take alike: ports, line settings, and the recording."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from analyzer.version import __version__

from .app import UsageError
from .quantities import octets, seconds, time_or_size
from .terminal import places

if TYPE_CHECKING:
    from analyzer.live.tapsource import TapSource
    from captures.recording.recorder import Recorder


def add_tap_arguments(parser: argparse.ArgumentParser) -> None:
    """PORT and how to listen to it."""
    parser.add_argument(
        "port", metavar="PORT", help="a serial port, or socket://HOST:PORT, rfc2217://HOST:PORT; never written to"
    )
    taps = parser.add_argument_group("the tap")
    taps.add_argument("--baud", default="auto", metavar="N", help="bit/s; auto finds it by listening (default)")
    taps.add_argument(
        "--parity", choices=("auto", "N", "E", "O"), default="auto", help="auto finds it with --baud auto, else N"
    )
    taps.add_argument("--stop-bits", type=float, choices=(1, 1.5, 2), default=1, help="of the line's characters (1)")
    taps.add_argument("--data-bits", type=int, choices=(7, 8), default=8, help="7 on some lines in ASCII mode (8)")
    taps.add_argument(
        "--port2", metavar="PORT", help="a second tap: PORT hears what the client sends, this one what servers answer"
    )
    taps.add_argument("--wait", action="store_true", help="wait for a port that is not there yet")
    taps.add_argument("--blocking-read", action="store_true", help=argparse.SUPPRESS)


def add_recording_arguments(parser: argparse.ArgumentParser, *, needed: bool) -> None:
    """Where the recording goes, and how much of it is kept."""
    recording = parser.add_argument_group("the recording")
    recording.add_argument("-o", "--output", metavar="FILE", required=needed, help="record to this .mcap file")
    recording.add_argument("--overwrite", action="store_true", help="even if FILE is there already")
    recording.add_argument("--rotate-every", type=seconds, metavar="TIME", help="begin a new file so often: 1h, 1d")
    recording.add_argument("--rotate-size", type=octets, metavar="SIZE", help="begin a new file at this size: 64MB")
    recording.add_argument(
        "--keep",
        type=time_or_size,
        action="append",
        default=[],
        metavar="TIME|SIZE",
        help="a ring: give up files older than this (7d), or the oldest when all are larger (2GB)",
    )


def tap_of(arguments: argparse.Namespace, *, watched: bool = True) -> TapSource:
    """The tap that was asked for, listening. `watched`: somebody looks, who should not wait."""
    from analyzer.live.tapsource import TapSource
    from captures.live.listening import HOLD_NS, IDLE_NS, RECORD_HOLD_NS
    from captures.live.settings import PortSettings

    baud = _baud(arguments.baud)
    parity = "N" if arguments.parity == "auto" else arguments.parity
    urls = [arguments.port, *([arguments.port2] if arguments.port2 else [])]
    if len(set(urls)) < len(urls):
        raise UsageError("--port2 is the same port as PORT")
    ports = [PortSettings(url, baud, parity, arguments.stop_bits, arguments.data_bits) for url in urls]
    return TapSource(
        ports,
        hold_ns=HOLD_NS if watched else RECORD_HOLD_NS,
        idle_ns=arguments.idle_ms or IDLE_NS,
        wait=arguments.wait,
        free_parity=arguments.parity == "auto",
        blocking=arguments.blocking_read,
    )


def recorder_of(arguments: argparse.Namespace) -> Recorder | None:
    """The recorder that was asked for; None where nothing is recorded."""
    if arguments.output is None:
        return None
    from captures.line import LineSettings
    from captures.recording.recorder import Recorder
    from captures.recording.ring import Limits

    times = [time for time, _ in arguments.keep if time is not None]
    sizes = [size for _, size in arguments.keep if size is not None]
    limits = Limits(
        every_s=arguments.rotate_every,
        size=arguments.rotate_size,
        keep_s=min(times, default=None),
        keep_bytes=min(sizes, default=None),
    )
    ports = [arguments.port, *([arguments.port2] if arguments.port2 else [])]
    about = {
        "tool": f"rtuscope {__version__}",
        "ports": ", ".join(ports),
        "time_base": "ns since 1970 by the monotonic clock, set by the wall clock when listening began; "
        "a read's time is when it returned, at or after its last stop bit",
    }
    return Recorder(
        Path(arguments.output), LineSettings(), limits=limits, about=about, overwrite=arguments.overwrite, tell=tell
    )


def tell(text: str) -> None:
    """A line on standard error, past a status line that may stand there."""
    clear = "\r\x1b[K" if places(sys.stderr) else ""
    print(f"{clear}rtuscope: {text}", file=sys.stderr, flush=True)


def _baud(text: str) -> int | None:
    if text == "auto":
        return None
    if not text.isdecimal() or not 50 <= int(text) <= 12_000_000:
        raise UsageError(f"--baud {text} is not a rate in bit/s, nor auto")
    return int(text)
