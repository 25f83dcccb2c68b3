"""Small captures of real Modbus stacks talking, shipped with the product.

`benchmarks/record_samples.py` made them; the header of each says which programs talked, and how.
"""

from __future__ import annotations

from pathlib import Path

_HERE = Path(__file__).parent
_SUFFIXES = (".jsonl", ".mcap")


def names() -> list[str]:
    """The samples' file names, sorted."""
    return sorted(file.name for file in _HERE.iterdir() if file.suffix in _SUFFIXES and ".expect" not in file.name)


def path(name: str) -> Path:
    """The path of the sample with this file name; KeyError where there is none."""
    if name not in names():
        raise KeyError(f"no sample named {name!r}: there are {', '.join(names())}")
    return _HERE / name
