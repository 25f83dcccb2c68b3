"""`rtuscope info`: what a capture is, without analysing it: format, line settings, span, ports, size."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dissectors.values import harmless

from ..languages import counted, tr
from ..linewords import line_words
from .commands import DONE
from .inputs import add_capture_arguments, open_capture, tell_damage
from .terminal import interruptible, put_json

if TYPE_CHECKING:
    from captures import Capture

EXAMPLE = """\
rtuscope simulate bus.jsonl
rtuscope info bus.jsonl
rtuscope info --json bus.jsonl"""


@dataclass(slots=True)
class CaptureSize:
    """What one pass over a capture's blocks counts; times in ns, None in a capture without any."""

    octets: int = 0
    reads: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    by_port: dict[int, int] | None = None


def size_of(capture: Capture, stop: Any) -> CaptureSize:
    """Bytes, reads, ports and span, by one pass without deframing."""
    size = CaptureSize(by_port={})
    assert size.by_port is not None
    for block in capture.blocks():
        size.octets += len(block.data)
        size.reads += len(block)
        for port, octets in block.octets_by_port().items():
            size.by_port[port] = size.by_port.get(port, 0) + octets
        if capture.timed and len(block):
            first, last = int(block.t_ns.min()), int(block.t_ns.max())
            size.first_ns = first if size.first_ns is None else min(size.first_ns, first)
            size.last_ns = last if size.last_ns is None else max(size.last_ns, last)
        if stop():
            break
    return size


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument("--json", action="store_true", help="one object")


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    capture = open_capture(arguments)
    with interruptible() as stop:
        size = size_of(capture, stop)
    if arguments.json:
        put_json(_json(arguments.capture, capture, size), indent=2)
    else:
        for label, words in _lines(arguments.capture, capture, size):
            print(f"{label:<{_LABEL}}{harmless(words)}")
    tell_damage(arguments.capture, capture)
    return DONE


_LABEL = 10


def _json(name: str, capture: Capture, size: CaptureSize) -> dict[str, Any]:
    line = capture.line
    return {
        "source": name,
        "format": capture.format,
        "baud": line.baud,
        "char_bits": line.char_bits,
        "parity": line.parity,
        "stop_bits": line.stop_bits,
        "tap": line.tap,
        "notes": dict(line.notes),
        "timed": capture.timed,
        "t_start_ns": size.first_ns,
        "t_end_ns": size.last_ns,
        "bytes": size.octets,
        "reads": size.reads,
        "ports": [{"port": port, "bytes": octets} for port, octets in sorted((size.by_port or {}).items())],
        "damage_count": capture.damage_count,
    }


def _lines(name: str, capture: Capture, size: CaptureSize) -> Iterator[tuple[str, str]]:
    from ..words import data_size, duration, is_clock, moment

    yield tr("capture"), f"{name}, {capture.format}"
    yield tr("line"), line_words(capture.line)
    if size.first_ns is None or size.last_ns is None:
        yield tr("span"), tr("no times in this capture")
    else:
        begun = tr(", from {moment}", moment=moment(size.first_ns)) if is_clock(size.first_ns) else ""
        yield tr("span"), duration(size.last_ns - size.first_ns) + begun
    reads = counted(size.reads, "read", "reads")
    octets = counted(size.octets, "byte", "bytes")
    yield tr("size"), f"{octets}, {reads}" + ("" if capture.path is None else f", {data_size(_file_size(capture))}")
    if len(size.by_port or {}) > 1:
        ports = ((port, counted(octets, "byte", "bytes")) for port, octets in sorted((size.by_port or {}).items()))
        yield tr("ports"), "; ".join(tr("port {port}: {bytes}", port=port, bytes=octets) for port, octets in ports)
    for key, value in capture.line.notes.items():
        yield "", f"{key}: {value}"


def _file_size(capture: Capture) -> int:
    assert capture.path is not None
    try:
        return capture.path.stat().st_size
    except OSError:
        return 0
