"""`rtuscope registers --like`: which register showed this number."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from .exits import DONE, FAILED, UsageError
from .gathering import gathered

if TYPE_CHECKING:
    from analyzer.options import Options
    from analyzer.registers.like import Match
    from captures import Capture

_ROWS: Final = 1 << 14  # readings of a block
_SHOWN: Final = 12
_LONGEST: Final = 16 << 20  # bytes of a table


def find_like(arguments: argparse.Namespace, capture: Capture, limits: Options) -> int:
    """Print the registers that showed it, best first."""
    from analyzer.registers.inference import infer
    from analyzer.registers.like import matches_of_series, matches_of_value
    from analyzer.registers.panel import PanelError, read_panel

    wanted = str(arguments.like)
    table = None
    try:
        float(wanted.replace(",", "."))
    except ValueError:
        table = _table_text(wanted)
    readings = gathered(capture, arguments.capture, limits, most=_ROWS).readings
    values = infer(readings, units=arguments.unit)
    try:
        if table is None:
            matches = matches_of_value(readings, wanted, values, arguments.unit)
        else:
            matches = matches_of_series(readings, read_panel(table, wanted), values, arguments.unit)
    except PanelError as error:
        raise UsageError(f"--like: {error}") from error
    if arguments.json:
        import json

        for match in matches[: 10 * _SHOWN]:
            print(json.dumps(match.to_json(), separators=(",", ":")))
    else:
        sys.stdout.write(_text(matches, wanted))
    return DONE if matches else FAILED


def _table_text(name: str) -> str:
    from dissectors.maps.files import decoded

    if not name.strip():
        raise UsageError("--like: expected a number, or a table of times and values")
    path = Path(name)
    try:
        with path.open("rb") as file:
            data = file.read(_LONGEST + 1)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise UsageError(f"--like {name}: neither a number nor a table of times and values: {reason}") from error
    text = decoded(data) if len(data) <= _LONGEST else None
    if text is None:
        raise UsageError(f"--like {name}: a table of times and values as CSV is expected")
    return text


def _text(matches: list[Match], wanted: str) -> str:
    from analyzer.registers.panel import HALF_HOUR_S
    from analyzer.words import duration

    if not matches:
        return f"no register showed {wanted}\n"
    lines = []
    ahead = matches[0].clock_s
    if ahead is not None:
        how = "ahead of" if ahead > 0 else "behind"
        zone = " (a time zone, or summer time)" if ahead % HALF_HOUR_S == 0 else ""
        lines.append(
            f"the clocks differ by {duration(round(abs(ahead) * 1e9))}: the table's is {how} the capture's{zone}"
        )
    for match in matches[:_SHOWN]:
        where = f"unit {match.unit} {match.area} {match.address}"
        order = f" {match.order}" if match.order else ""
        scale = f" x{match.scale:g}" if match.scale != 1 else ""
        offset = f" {match.offset:+g}" if match.offset else ""
        lag = f", {match.lag_s:+.1f} s" if match.lag_s is not None else ""
        lines.append(f"{where}: {match.type}{order}{scale}{offset} showed {match.value:g}{lag} ({match.score:.2f})")
    if len(matches) > _SHOWN:
        lines.append(f"and {len(matches) - _SHOWN} more (--json lists them)")
    return "\n".join(lines) + "\n"
