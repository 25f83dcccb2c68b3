"""`rtuscope wireshark`: taps as capture interfaces of Wireshark (extcap(4)).

Wireshark lists and runs programs of its extcap folder. `install` puts a script there that runs `rtuscope wireshark
extcap`, which answers what Wireshark asks and begins the capture. One interface a serial port of this machine, and one,
`rtuscope`, whose port is typed in the dialog: gateways, port servers, devices that come later.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from captures.disposal import device_stream, remove_proven
from captures.errors import CaptureError
from captures.files import replacing
from captures.network.packets import UPPER_PDU

from ..version import __version__
from . import sniff
from .app import Parser
from .commands import DONE, UsageError

_ANY: Final = "rtuscope"
_OF_PORT: Final = "rtuscope:"  # before the port
_HANDED_ON: Final = ("baud", "parity", "port2", "map", "filter")  # what the dialog hands on to `sniff`


def answer(words: Sequence[str]) -> int:
    """Do what Wireshark asks."""
    request, _ = _parser().parse_known_args(words)  # later versions ask with more words
    if request.extcap_interfaces:
        _put("extcap", version=__version__, display="Modbus RTU taps")
        for name, display in _interfaces():
            _put("interface", value=name, display=display)
    elif request.extcap_interface is None:
        raise UsageError("Wireshark itself runs this command; to set it up: rtuscope wireshark install")
    elif request.extcap_dlts:
        _put("dlt", number=str(UPPER_PDU), name="WIRESHARK_UPPER_PDU", display="Modbus RTU frames")
    elif request.extcap_config:
        _settings(request.extcap_interface)
    elif request.capture:
        return _capture(request)
    return DONE


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="rtuscope wireshark extcap", add_help=False, allow_abbrev=False)
    for flag in ("--extcap-interfaces", "--extcap-dlts", "--extcap-config", "--capture"):
        parser.add_argument(flag, action="store_true")
    for flag in ("--extcap-interface", "--fifo", "--port", *(f"--{name}" for name in _HANDED_ON)):
        parser.add_argument(flag)
    parser.add_argument("--noise", nargs="?", const="true", default="false")
    parser.add_argument("--record")
    return parser


def _interfaces() -> list[tuple[str, str]]:
    from captures.live.ports import ports

    taps = []
    with suppress(CaptureError):  # that by name is there all the same
        taps = [(f"{_OF_PORT}{port.device}", port) for port in ports()]
    listed = [(name, " ".join(filter(None, ("Modbus RTU:", port.device, port.description)))) for name, port in taps]
    return [*listed, (_ANY, "Modbus RTU: a port, gateway or port server by name")]


def _settings(interface: str) -> None:
    """What the dialog asks for."""
    numbers = iter(range(20))
    if interface == _ANY:
        tip = "A serial port, socket://HOST:PORT or rfc2217://HOST:PORT; never sent to"
        _argument(next(numbers), "--port", "Port", "string", required="true", tooltip=tip)
    tip = "bit/s, such as 9600, 19200, 115200; auto finds it by listening"
    _argument(next(numbers), "--baud", "Baud rate", "string", default="auto", tooltip=tip)
    number = next(numbers)
    _argument(number, "--parity", "Parity", "selector", default="auto", tooltip="auto finds it with the rate")
    for value, display in (("auto", "auto"), ("N", "none"), ("E", "even"), ("O", "odd")):
        _put("value", arg=str(number), value=value, display=display)
    _argument(next(numbers), "--port2", "Second tap", "string", tooltip="hears what servers answer, where wires differ")
    _argument(next(numbers), "--filter", "Only frames that pass", "string", tooltip="rtuscope help filters")
    _argument(next(numbers), "--noise", "Bytes outside frames", "boolflag", default="false", tooltip="as packets, too")
    tip = "Also record to this .mcap file, which keeps every byte and its time"
    _argument(next(numbers), "--record", "Recording", "fileselect", tooltip=tip, mustexist="false")


def _argument(number: int, call: str, display: str, kind: str, **more: str) -> None:
    _put("arg", number=str(number), call=call, display=display, type=kind, **more)


def _put(sentence: str, **values: str) -> None:
    print(sentence, "".join(f"{{{name}={_without_braces(value)}}}" for name, value in values.items()))


def _without_braces(text: str) -> str:
    """Without what would end a value."""
    return text.translate({ord("{"): "(", ord("}"): ")"})


def _capture(request: argparse.Namespace) -> int:
    """Listen, into the pipe that Wireshark named, until it closes that or ends us."""
    port = request.port if request.extcap_interface == _ANY else request.extcap_interface.removeprefix(_OF_PORT)
    if not port or not request.fifo:
        raise UsageError("no port set: use the gear icon beside the interface, or -o "
                         f"extcap.{_ANY}.port:PORT")  # fmt: skip
    words = [port, "--format", "pcapng", "--wait"]
    for name in _HANDED_ON:
        words += [f"--{name}={value}"] if (value := getattr(request, name)) else []
    words += ["--noise"] if request.noise == "true" else []
    words += ["-o", request.record] if request.record else []
    parser = Parser(prog="rtuscope wireshark extcap", allow_abbrev=False)
    sniff.configure(parser)
    arguments = parser.parse_args(words)
    fifo = Path(request.fifo)
    if os.name == "posix" and not stat.S_ISFIFO(fifo.stat().st_mode):
        raise UsageError(f"{fifo}: is not a pipe")
    with device_stream(fifo, buffering=0) as out:
        return sniff.listen(arguments, out)


EXAMPLE = """\
rtuscope wireshark install
rtuscope wireshark folder
rtuscope wireshark remove"""

_NAME: Final = "rtuscope.bat" if os.name == "nt" else "rtuscope"
_OURS: Final = re.compile(
    rb"(?:#!/bin/sh\nexec |@echo off\r*\n)[^\r\n]+ -m analyzer\.cli wireshark extcap (?:\"\$@\"|%\*)\r*\n"
)
_PROGRAMS: Final = ("wireshark", "tshark")  # who tells where its folders are


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    actions = parser.add_subparsers(metavar="ACTION", title="actions", dest="action", required=True)
    install = actions.add_parser("install", help="add this machine's ports to Wireshark's interfaces")
    remove = actions.add_parser("remove", help="remove what install added")
    for action in (install, remove):
        action.add_argument("--folder", metavar="DIR", help="Wireshark's extcap folder, if not found automatically")
    actions.add_parser("folder", help="print the folder used by install")
    extcap = actions.add_parser("extcap", help="the command that Wireshark runs", prefix_chars="\0", add_help=False)
    extcap.add_argument("words", nargs="*", metavar="WORD", help="as given by Wireshark")


def run(arguments: argparse.Namespace) -> int:
    """Do the action."""
    if arguments.action == "extcap":
        return answer(arguments.words)
    if arguments.action == "folder":
        print(_folder(None))
        return DONE
    script = _folder(arguments.folder) / _NAME
    if arguments.action == "remove":
        if not remove_proven(script, _is_ours) and (script.exists() or script.is_symlink()):
            raise UsageError(f"{script}: was not made by rtuscope: left unchanged")
        print(f"{script}: removed")
        return DONE
    if script.is_symlink() or (script.exists() and not (script.is_file() and _is_ours(script.read_bytes()))):
        raise UsageError(f"{script}: already exists and was not made by rtuscope: remove it first")
    script.parent.mkdir(parents=True, exist_ok=True)
    with replacing(script) as out:
        out.write(_script().encode())
    script.chmod(0o755)
    print(f"{script}: Wireshark lists the taps under Capture, Options, after a restart or Capture, Refresh Interfaces")
    return DONE


def _is_ours(content: bytes) -> bool:
    """Whether a script is one that `install` made, of whatever Python: nothing but the call."""
    return _OURS.fullmatch(content) is not None


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
    raise UsageError("Wireshark was not found: give its extcap folder with --folder (Help, About Wireshark, Folders)")


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
