"""`rtuscope wireshark`: taps as capture interfaces of Wireshark.

Wireshark lists and runs programs of its extcap folder. `install` puts a script there that runs `rtuscope wireshark
extcap`, which answers Wireshark (`extcap.py`).
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

from .exits import DONE, UsageError
from .extcap import answer

EXAMPLE = """\
rtuscope wireshark install
rtuscope wireshark folder
rtuscope wireshark remove"""

_NAME: Final = "rtuscope.bat" if os.name == "nt" else "rtuscope"
_PROGRAMS: Final = ("wireshark", "tshark")  # who tells where its folders are


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    actions = parser.add_subparsers(metavar="ACTION", title="actions", dest="action", required=True)
    install = actions.add_parser("install", help="have Wireshark list this machine's taps among its interfaces")
    remove = actions.add_parser("remove", help="undo that")
    for action in (install, remove):
        action.add_argument("--folder", metavar="DIR", help="Wireshark's extcap folder, where it is not found")
    actions.add_parser("folder", help="print the folder that install uses")
    extcap = actions.add_parser("extcap", help="what Wireshark runs", prefix_chars="\0", add_help=False)
    extcap.add_argument("words", nargs="*", metavar="WORD", help="as Wireshark gives them")


def run(arguments: argparse.Namespace) -> int:
    """Do the action."""
    if arguments.action == "extcap":
        return answer(arguments.words)
    if arguments.action == "folder":
        print(_folder(None))
        return DONE
    script = _folder(arguments.folder) / _NAME
    if arguments.action == "remove":
        script.unlink(missing_ok=True)
        print(f"{script}: removed")
        return DONE
    if script.exists() and "wireshark extcap" not in script.read_text(errors="replace"):
        raise UsageError(f"{script}: is there already and is not ours: take it away first")
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text(_script(), encoding="utf-8")
    script.chmod(0o755)
    print(f"{script}: Wireshark lists the taps under Capture, Options, after a restart or Capture, Refresh Interfaces")
    return DONE


def _script() -> str:
    words = [sys.executable, "-m", "analyzer.cli", "wireshark", "extcap"]
    if os.name == "nt":
        return f"@echo off\r\n{subprocess.list2cmdline(words)} %*\r\n"
    return f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n'


def _folder(named: str | None) -> Path:
    """Where Wireshark looks for this user's; until 4.2 that is a part of the configuration's folder."""
    if named is not None:
        return Path(named)
    folders = _reported_folders()
    if "Personal Extcap path" in folders:
        return Path(folders["Personal Extcap path"])
    if "Personal configuration" in folders:
        return Path(folders["Personal configuration"]) / "extcap"
    raise UsageError("Wireshark is not found: name its extcap folder by --folder (Help, About Wireshark, Folders)")


def _reported_folders() -> dict[str, str]:
    """What Wireshark says of its folders."""
    paths = [os.environ.get("PATH", ""), r"C:\Program Files\Wireshark", "/Applications/Wireshark.app/Contents/MacOS"]
    for name in _PROGRAMS:
        if (program := shutil.which(name, path=os.pathsep.join(paths))) is not None:
            answer = subprocess.run([program, "-G", "folders"], capture_output=True, text=True, check=False, timeout=30)
            lines = [line.partition(":") for line in answer.stdout.splitlines()]
            if folders := {name.strip(): folder.strip() for name, _, folder in lines}:
                return folders
    return {}
