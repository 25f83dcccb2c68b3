"""tshark on frames already split, since its RTU dissector does not look for them; it is not told any direction.

python -m peers.tshark CORPUS          accuracy on the first 20,000 frames
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

from measuring import Job, python

from . import Accuracy

_FIELDS = (
    "frame.number", "frame.time_epoch", "mbrtu.unit_id", "modbus.func_code", "modbus.reference_num", "modbus.word_cnt",
    "modbus.bit_cnt", "modbus.regnum16", "modbus.regval_uint16", "modbus.bitnum", "modbus.bitval",
    "modbus.exception_code", "modbus.request_frame", "modbus.response_time",
)  # fmt: skip
_LOOK = 20_000


def absent() -> str | None:
    return None if shutil.which("tshark") else "tshark is not installed"


def version() -> str:
    said = subprocess.run(["tshark", "--version"], capture_output=True, text=True, check=True).stdout
    return "tshark " + said.split()[2]


def _fields(*names: str) -> tuple[str, ...]:
    return ("-T", "fields", *(part for name in names for part in ("-e", name)))


def _job(section: str, *options: str) -> Job:
    return Job(
        section, "tshark " + " ".join(options[:2]), lambda corpus, _: ("tshark", "-r", corpus / "frames.pcap", *options)
    )


JOBS = [
    _job("columns", "-V"),
    _job("columns", *_fields(*_FIELDS)),
    _job("jsonl", "-T", "json"),
    _job("jsonl", "-T", "ek"),
]
ACCURACY = [
    Accuracy(
        "tshark",
        lambda corpus, _: python("peers.tshark", corpus),
        f"given frames already split; of the first {_LOOK:,}, direction by its Query or Response, pairs by its request "
        "frame",
    )
]


def main(corpus: Path) -> int:
    import numpy as np

    truth = np.load(corpus / "truth.npz")
    fields = _fields("modbus.request_frame", "_ws.col.Info")
    command: list[str | Path] = ["tshark", "-r", corpus / "frames.pcap", "-c", str(_LOOK), *fields]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    right = pairs = 0
    for line, response, pair in zip(said, truth["response"].tolist(), truth["pair"].tolist(), strict=False):
        request, _, info = line.partition("\t")
        right += info.split(":")[0].strip() == ("Response" if response else "Query")
        pairs += response and request == str(pair + 1)
    print(json.dumps({"direction": right / len(said), "pairs": pairs / int(truth["response"][: len(said)].sum())}))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
