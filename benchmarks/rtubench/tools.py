"""The tools that are measured: adapters as programs, checked as they answer.

A tool of somebody else is `NAME=COMMAND` on the command line; nothing here has to know it.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .items import INPUTS, Item, Row
from .scored import CHECKS, TRACKS

HERE = Path(__file__).resolve().parent
_NOT_THERE, _LIMIT_S = 3, 300
CLAIMS = (*TRACKS, "speed")


class AdapterError(Exception):
    """An adapter broke the protocol; the text says how."""


class NotThereError(Exception):
    """A tool is not installed on this machine."""


@dataclass(frozen=True)
class Tool:
    """A tool: the command of its adapter, and what it says of itself."""

    command: tuple[str, ...]
    name: str
    version: str
    given: str  # the input that it reads, one of INPUTS
    claims: tuple[str, ...]

    def rows(self, item: Item, folder: Path, scratch: Path) -> list[Row]:
        """Its answer to an item, every row checked."""
        path = item.path(folder, self.given)
        rows = asked(self.command, item.task, str(path.resolve()), scratch=scratch)
        reads = item.inputs.get(self.given) or item.inputs.get("reads") or ()
        size = sum(len(one.data) for one in reads)
        for row in rows:
            if wrong := CHECKS[item.task](row, size):
                raise AdapterError(f"{self.name}, {item.name}: {wrong}: {json.dumps(row)[:200]}")
        return rows


def asked(command: Sequence[str], *arguments: str, scratch: Path) -> list[Row]:
    """Runs an adapter in a folder of its own; the objects that it prints."""
    scratch.mkdir(parents=True, exist_ok=True)
    try:
        done = subprocess.run([*command, *arguments], capture_output=True, text=True, cwd=scratch, timeout=_LIMIT_S,
                              env={**os.environ, "PYTHONHASHSEED": "0"}, check=False)  # fmt: skip
    except subprocess.TimeoutExpired:
        raise AdapterError(f"{shlex.join(command)}: no answer within {_LIMIT_S} s to {arguments[0]}") from None
    except OSError as error:
        raise NotThereError(f"{command[0]}: {error.strerror}") from None
    if done.returncode == _NOT_THERE:
        raise NotThereError(done.stderr.strip())
    if done.returncode:
        words = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        raise AdapterError(f"{shlex.join([*command, *arguments])}: {words[-1]}")
    rows = []
    for line in done.stdout.splitlines():
        try:
            rows.append(json.loads(line))
        except ValueError:
            raise AdapterError(f"{shlex.join(command)}: not a line of JSON: {line[:200]}") from None
        if not isinstance(rows[-1], dict):
            raise AdapterError(f"{shlex.join(command)}: not an object: {line[:200]}")
    return rows


def introduced(command: Sequence[str], scratch: Path) -> Tool:
    """Asks an adapter what it is."""
    rows = asked(command, "about", scratch=scratch)
    if len(rows) != 1:
        raise AdapterError(f"{shlex.join(command)}: `about` prints one line, not {len(rows)}")
    (row,) = rows
    claims = row.get("claims")
    if not isinstance(claims, list) or set(claims) - set(CLAIMS):
        raise AdapterError(f"{shlex.join(command)}: claims must be some of {', '.join(CLAIMS)}")
    if row.get("input") not in INPUTS:
        raise AdapterError(f"{shlex.join(command)}: input must be one of {', '.join(INPUTS)}")
    return Tool(tuple(command), str(row.get("tool")), str(row.get("version")), row["input"], tuple(claims))


def own_place(venvs: Path) -> Path:
    """The Python of modbus-connector, which needs a pymodbus of its own."""
    return venvs / "modbus-connector" / "bin" / "python"


def known(venvs: Path) -> dict[str, tuple[str, ...]]:
    """The tools of the table, by the names that `--tools` takes."""
    adapters = HERE / "adapters"
    connector = own_place(venvs)
    return {
        "rtuscope": (sys.executable, str(adapters / "rtuscope_cli.py")),
        "modbus-connector": (str(connector), str(adapters / "connector.py")),
        "tshark-dlt147": (sys.executable, str(adapters / "tshark_fields.py"), "dlt147"),
        "tshark-rtac": (sys.executable, str(adapters / "tshark_fields.py"), "rtac"),
        "sigrok": (sys.executable, str(adapters / "sigrok_cli.py")),
        "pymodbus": (sys.executable, str(adapters / "pymodbus_framer.py")),
        "crc-scan": (sys.executable, str(adapters / "crc_scan.py")),
        "silence": (sys.executable, str(adapters / "silence.py")),
        "stranger": ("perl", str(HERE / "example" / "lengths.pl")),
    }


def set_up(venvs: Path) -> None:
    """Installs modbus-connector beside the bench, in an environment of its own."""
    folder = own_place(venvs).parents[1]
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    subprocess.run([str(own_place(venvs)), "-m", "pip", "install", "-q", "modbus-connector"], check=True)
