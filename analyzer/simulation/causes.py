"""Captures of a site at which one cause is at work, and the truth about it.

    site = case_of("dead-unit").capture("precise", seed=1)
    site.chunks     # what a tap delivered
    site.expected   # the cause, and its units

Each site is drawn anew: its speed, its units, what is polled and how often. `field` holds the cases.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import cache
from os import PathLike
from pathlib import Path
from random import Random
from typing import Any

import captures

from ..meant import meant
from .bus import truth_path
from .field.bench import FieldCapture
from .field.cases.registry import FieldCase, field_cases


@cache
def cases_by_cause() -> Mapping[str, FieldCase]:
    """A case for each cause that the cases have: the one of its name, else the first that shows it."""
    shown: dict[str, FieldCase] = {}
    for name, case in field_cases().items():
        cause = case.play(Random(f"{name} 0"), case.taps[0])[1].cause
        if cause and (cause == name or cause not in shown):
            shown[cause] = case
    return dict(sorted(shown.items()))


def other_cases() -> list[str]:
    """Names of the cases that are no cause's own: varieties, healthy sites, two causes at once."""
    return [name for name in field_cases() if name not in cases_by_cause()]


def case_of(name: str) -> FieldCase:
    """The case of a cause, or the one of this name; ValueError, with what may be meant, where there is none."""
    cases: dict[str, FieldCase] = {**field_cases(), **cases_by_cause()}
    if name in cases:
        return cases[name]
    near = meant(name, cases)
    if near is None:
        raise ValueError(f"no cause {name!r} can be simulated: `rtuscope help causes` lists them")
    raise ValueError(f"no cause {name!r} can be simulated: did you mean {near}?")


def write_cause(name: str, path: str | PathLike[str], *, tap: str = "precise", seed: int = 0) -> None:
    """Writes the capture of a site with this cause to `path` and the truth to the same name with `.truth.jsonl`: the
    cause with its units, then what became of each request.

    Raises ValueError for an unknown cause, or for a tap that cannot show it; CaptureError where a file can't be
    written.
    """
    case = case_of(name)
    if tap not in case.taps:
        raise ValueError(f"a tap {tap} cannot show {name}: use one of {', '.join(case.taps)}")
    made = case.capture(tap, seed)
    captures.write(Path(path), made.chunks, line=made.line)
    with captures.replacing(truth_path(path)) as file:
        file.writelines(json.dumps(line).encode() + b"\n" for line in _truth(made))


def _truth(made: FieldCapture) -> Iterator[dict[str, Any]]:
    expected = made.expected
    yield {"cause": expected.cause, "units": list(expected.units), "also": list(expected.also)}
    if expected.beside is not None:
        yield {"cause": expected.beside.cause, "units": list(expected.beside.units), "also": []}
    for request in made.requests:
        if made.begin_ns < request.end < made.end_ns:
            yield {"unit": request.unit, "t_end_ns": made.epoch_ns + round(request.end), "result": request.result}
