"""tshark on frames that are split already, since its dissector of Modbus RTU does not look for them; in two ways.

    tshark_fields.py dlt147     link type 147, given to `mbrtu` by the preference of user link types
    tshark_fields.py rtac       link type 250 (RTAC serial), given to `mbrtu` by Decode As

Both with `mbrtu.crc_verification` on, as its page has it. A tap knows no direction, so none is given: RTAC's event says
received for all.
"""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import NotThereError, Row, frame, given, speak

_RECEIVED = 2  # RTAC's event DATA_RX_END, of data that came in
_WAYS = {  # link type, what stands before the bytes of a packet, options
    "dlt147": (147, False, ("-o", 'uat:user_dlts:"User 0 (DLT=147)","mbrtu","0","","0",""')),
    "rtac": (250, True, ("-d", "rtacser.data,mbrtu")),
}
_FIELDS = ("frame.number", "modbus.request_frame", "mbrtu.crc16.status", "_ws.col.Info")
_DECODED = ("mbrtu.unit_id", "modbus.func_code", "modbus.reference_num", "modbus.word_cnt", "modbus.regval_uint16")
_DIRECTIONS = {"Query": "request", "Response": "response"}


def _pcap(path: Path, way: str) -> Path:
    """The reads as packets."""
    link, heads, _ = _WAYS[way]
    made = Path.cwd() / f"{path.name}.{way}.pcap"
    with made.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, link))  # times in nanoseconds
        for t_ns, data in given(path).reads:
            seconds, nanos = divmod(t_ns or 0, 1_000_000_000)
            head = struct.pack(">IIBBH", seconds, nanos // 1000, _RECEIVED, 0, 0) if heads else b""
            file.write(struct.pack("<IIII", seconds, nanos, len(head + data), len(head + data)) + head + data)
    return made


def _command(path: Path, way: str, fields: tuple[str, ...]) -> list[str]:
    told = [part for name in fields for part in ("-e", name)]
    return ["tshark", "-n", "-r", str(path), *_WAYS[way][2], "-o", "mbrtu.crc_verification:TRUE", "-T", "fields", *told]


def main(way: str) -> int:
    def about() -> Row:
        try:
            done = subprocess.run(["tshark", "--version"], capture_output=True, text=True, check=True)
        except FileNotFoundError:
            raise NotThereError("tshark is not installed") from None
        name = {"dlt147": "tshark, DLT 147", "rtac": "tshark, RTAC serial"}[way]
        claims = ["directions", "pairs", "damage", "speed"]
        return {"tool": name, "version": done.stdout.split()[2], "input": "frames", "claims": claims}

    def bus(path: Path) -> Iterator[Row]:
        done = subprocess.run(_command(_pcap(path, way), way, _FIELDS), capture_output=True, text=True, check=True)
        starts, at = [], 0
        for (_, data), line in zip(given(path).reads, done.stdout.splitlines(), strict=True):
            _, request, status, info = line.split("\t")
            starts.append(at)
            direction = _DIRECTIONS.get(info.split(":")[0].strip())
            yield frame(at, len(data), status == "1", direction, starts[int(request) - 1] if request else None)
            at += len(data)

    def speed(path: Path) -> Iterator[Row]:
        yield {"command": _command(_pcap(path, way), way, (*_FIELDS, *_DECODED))}

    return speak(about, {"bus": bus, "speed": speed})


if __name__ == "__main__":
    sys.exit(main(sys.argv.pop(1)))
