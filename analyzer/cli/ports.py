"""`rtuscope ports`: the serial ports that are there."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from .app import DONE

if TYPE_CHECKING:
    from captures.live.ports import PortInfo

EXAMPLE = "rtuscope ports"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--json", action="store_true", help="a list of objects")


def run(arguments: argparse.Namespace) -> int:
    """Print them."""
    from captures.live.ports import ports

    found = ports()
    if arguments.json:
        print(json.dumps([port.to_json() for port in found], indent=2))
        return DONE
    for port in found:
        print("\n".join(_lines(port)))
    if not found:
        print("no serial port here; others: socket://HOST:PORT of a gateway, rfc2217://HOST:PORT")
    return DONE


def _lines(port: PortInfo) -> list[str]:
    """A port in words: its name and what it is, then what else is known."""
    from dissectors.text import harmless

    what = [port.description, port.usb and f"USB {port.usb}", port.serial and f"serial {port.serial}", port.driver]
    known = "  ".join(harmless(text) for text in what if text)
    lines = [f"{port.device:<16}{known}".rstrip()]
    if port.link:
        lines.append(f"{'':16}lasting name {harmless(port.link)}")
    if port.latency_ms is not None:
        lines.append(f"{'':16}holds bytes back for up to {port.latency_ms} ms (1 is best)")
    if port.used_by:
        lines.append(f"{'':16}in use by {', '.join(harmless(user) for user in port.used_by)}")
    if not port.allowed:
        lines.append(f"{'':16}you may not open it: sudo usermod -aG dialout $USER, then log in again")
    return lines
