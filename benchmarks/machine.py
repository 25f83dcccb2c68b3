"""Where and when: what figures are worth nothing without."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

import peers


def about() -> dict[str, str]:
    """Date, processor, system, and versions of what runs."""
    return {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": ", ".join(_versions()),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def _versions() -> list[str]:
    from analyzer.version import __version__

    found = [f"rtuscope {__version__}"]
    found += [peers.version(package) for package in ("numpy", "orjson", "pyarrow") if peers.missing(package) is None]
    return found + [peer.version() for peer in peers.all_of_them() if peer.absent() is None]
