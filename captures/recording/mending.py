"""What a recorder before this one had no time to close, made whole.

A cut file goes only where all that it holds is in the whole one. What cannot be read is set aside.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import Final

from ..disposal import made, move_to_free_name, remove_made
from ..errors import CaptureError, os_reason
from ..formats.mcap.reading import first_metadata
from .mcapfile import PART, is_written, repair
from .ring import Ring

FULL: Final = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_MENDING: Final = ".mending"


def mend_cut(ring: Ring, tell: Callable[[str], None], make_room: Callable[[], bool]) -> None:
    """Make them whole; `make_room` says whether there is room now that was not there before."""
    for part in ring.cut():
        while not is_written(part):
            try:
                _mend(ring, part, tell)
            except (CaptureError, OSError) as error:
                if _is_full(error) and make_room():
                    continue
                _not_mended(ring, part, error, tell)
            break


def _mend(ring: Ring, part: Path, tell: Callable[[str], None]) -> None:
    finished = part.with_name(part.name.removesuffix(PART))
    mine = made(part)
    if finished.exists() and finished.samefile(part):  # it was named, and then the power went
        remove_made(part, mine)
        return
    mending = next(name for name in _numbered(part, _MENDING) if not name.exists())
    repaired = repair(part, mending)
    ours = made(mending)
    recorded = bool(first_metadata(part))  # each file of a recorder says at its beginning whose it is
    lossless = recorded and repaired.damage_count <= 1  # but for its cut end
    if repaired.chunks or repaired.notes:
        begun_s = part.stat().st_mtime
        own = () if finished == ring.path else (finished,)  # that name is for what comes now
        try:
            finished = move_to_free_name(mending, chain(own, ring.free_names(begun_s)))
        except OSError:
            remove_made(mending, ours)
            raise
        with suppress(OSError):  # it stays in the list that memory holds, and is written with the next
            ring.listed(finished)
        damaged = f", {repaired.damage_count - 1} damaged places noted" if repaired.damage_count > 1 else ""
        tell(f"recording: {finished} was cut off and is now repaired: {repaired.bytes:,} bytes of the line{damaged}")
    else:
        remove_made(mending, ours)
    if lossless:
        remove_made(part, mine)
    else:
        aside = move_to_free_name(part, _numbered(part))
        tell(f"recording: {part} could be read only in part: set aside as {aside}")


def _not_mended(ring: Ring, part: Path, error: CaptureError | OSError, tell: Callable[[str], None]) -> None:
    reason = os_reason(error) if isinstance(error, OSError) else str(error).removeprefix(f"{part}: ")
    if part.name.removesuffix(PART) != ring.path.name and _is_full(error):  # not in the way, and whole some other day
        tell(f"recording: {part} was cut off and could not be repaired: {reason}")
        return
    try:
        aside = move_to_free_name(part, _numbered(part))
    except OSError:
        tell(f"recording: {part} was cut off and could not be repaired: {reason}")
    else:
        tell(f"recording: {part} was cut off and could not be repaired: {reason}: set aside as {aside}")


def _numbered(part: Path, suffix: str = "") -> chain[Path]:
    first = [part.with_name(part.name + suffix)] if suffix else []
    return chain(first, (part.with_name(f"{part.name}{suffix}.{number}") for number in count(1)))


def _is_full(error: BaseException) -> bool:
    """Whether it is for want of room, by itself or by what it came of."""
    cause = error if isinstance(error, OSError) else error.__cause__
    return isinstance(cause, OSError) and cause.errno in FULL
