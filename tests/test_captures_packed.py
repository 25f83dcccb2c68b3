"""Packed captures that end too early: what came before is read, and that it was cut is said."""

from __future__ import annotations

import bz2
import gzip
import lzma
import random
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard

import captures

PACK: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "bz2": lambda data: bz2.compress(data, 1),
    "xz": lzma.compress,
    "zst": zstandard.compress,
}


def _log(lines: int) -> bytes:
    """A log of hex bytes that no packer makes much smaller."""
    chance = random.Random(lines)
    return b"".join(
        b"%d.%03d %s\n" % (n // 10, n % 10 * 100, chance.randbytes(24).hex().encode()) for n in range(lines)
    )


def _octets(path: Path) -> tuple[bytes, list[str]]:
    capture = captures.open(path)
    data = b"".join(block.data.tobytes() for block in capture.blocks(1 << 19))
    return data, [str(damage) for damage in capture.damage]


@pytest.mark.parametrize(
    ("suffix", "lines"), [("gz", 300), ("gz", 20_000), ("xz", 300), ("bz2", 20_000), ("zst", 20_000)]
)
def test_what_comes_before_a_cut_is_read(suffix: str, lines: int, tmp_path: Path) -> None:
    whole = tmp_path / "bus.log"
    whole.write_bytes(_log(lines))
    data, _ = _octets(whole)
    packed = PACK[suffix](whole.read_bytes())
    path = tmp_path / f"bus.log.{suffix}"
    path.write_bytes(packed[: len(packed) * 3 // 4])
    left, damage = _octets(path)
    assert data.startswith(left[: len(left) - 24])  # of its last line there may be half
    assert len(left) > 0.5 * len(data)
    assert "cut" in damage[-1] and "what came before was read" in damage[-1]


@pytest.mark.parametrize("suffix", PACK)
def test_packed_parts_end_to_end_are_one_file(suffix: str, tmp_path: Path) -> None:
    log = _log(3000)
    (tmp_path / "bus.log").write_bytes(log)
    path = tmp_path / f"bus.log.{suffix}"
    path.write_bytes(PACK[suffix](log[:70_000]) + PACK[suffix](log[70_000:]))
    assert _octets(path) == _octets(tmp_path / "bus.log")


@pytest.mark.parametrize("suffix", PACK)
def test_a_cut_before_anything_whole_is_said(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bus.log.{suffix}"
    path.write_bytes(PACK[suffix](_log(300))[:40])
    with pytest.raises(captures.CaptureError, match="cut"):
        captures.open(path)
