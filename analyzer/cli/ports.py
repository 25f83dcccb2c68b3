"""`rtuscope ports`: the serial ports that are there."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from dissectors.values import harmless

from ..languages import retold
from .commands import DONE
from .terminal import put_json

if TYPE_CHECKING:
    from captures.live.ports import PortInfo

EXAMPLE = "rtuscope ports"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--json", action="store_true", help="a list of objects")


def run(arguments: argparse.Namespace) -> int:
    """Print them."""
    from captures.live.ports import ports

    listed = ports()
    if arguments.json:
        put_json([port.to_json() for port in listed], indent=2)
        return DONE
    for port in listed:
        for line in port_lines(port):
            print(harmless(line))
    if not listed:
        print(
            retold(
                "no serial ports found; other sources: socket://HOST:PORT of a gateway, rfc2217://HOST:PORT, tap://HOST"
            )
        )
    return DONE


def port_lines(port: PortInfo) -> list[str]:
    """A port in words: its name and what it is, then what else is known."""
    details = [port.description, port.usb and f"USB {port.usb}", port.serial and f"serial {port.serial}", port.driver]
    words = "  ".join(text for text in details if text)
    beneath = []
    if port.link:
        beneath.append(f"stable name {port.link}")
    if port.latency_ms is not None:
        beneath.append(f"delays bytes by up to {port.latency_ms} ms (1 is best)")
    if port.used_by:
        beneath.append(f"in use by {', '.join(port.used_by)}")
    if port.advice:
        beneath.append(f"you have no permission to open it: {port.advice}")
    return [f"{port.device:<16}{words}".rstrip(), *(f"{'':16}{retold(line)}" for line in beneath)]
