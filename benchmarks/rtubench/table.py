"""The table: a row a tool, a column a track; the same in short for a README; what changed between two runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from .items import Row
from .scored import TRACKS

_GIVEN = {"reads": "", "wire": " (w)", "frames": " (f)"}
_NONE = "-"
_TIE = 0.0005  # figures nearer than that are the same to three digits
_FEW = 3  # of what went wrong with a tool


def markdown(result: Row) -> str:
    """A run as Markdown."""
    lines = rows(result["tools"])
    machine = result["machine"]
    versions = ", ".join(f"{tool['tool']} {tool['version']}" for tool in result["tools"])
    lines += ["", f"Seed {result['seed']}, size {result['size']}, {result['items']} items; {machine['date']}, "
              f"{machine['processor']}, {machine['system']}, Python {machine['python']}. {versions}."]  # fmt: skip
    lines += [f"Not here: {name}: {why}." for name, why in result["absent"].items()]
    for tool in result["tools"]:
        lines += [f"Broke the protocol: {words}" for words in tool["wrong"][:_FEW]]
        lines += [f"... and {len(tool['wrong']) - _FEW} times more"] * (len(tool["wrong"]) > _FEW)
    return "\n".join(lines)


def rows(tools: Sequence[Row]) -> list[str]:
    """The table's lines."""
    head = ["tool", *TRACKS, "CPU us a frame", "MiB"]
    return [_row(head), _row([":--", *["--:"] * (len(head) - 1)]), *(_row(_cells(tool)) for tool in ordered(tools))]


def merged(results: Sequence[Row]) -> Row:
    """Runs of one seed and size, made in parts, as one."""
    tools: dict[str, Row] = {}
    for result in results:
        if (result["seed"], result["size"]) != (results[0]["seed"], results[0]["size"]):
            raise ValueError("parts of one run have the same seed and size")
        for tool in result["tools"]:
            known = tools.get(tool["tool"], {"tracks": {}, "speed": {}, "wrong": []})
            tools[tool["tool"]] = {**tool, "tracks": {**known["tracks"], **tool["tracks"]},
                                   "speed": tool["speed"] or known["speed"],
                                   "wrong": [*known["wrong"], *tool["wrong"]]}  # fmt: skip
    absent = {name: why for result in results for name, why in result["absent"].items()}
    return {**results[0], "tools": list(tools.values()), "absent": absent}


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _cells(tool: Row) -> list[str]:
    scores = [f"{tool['tracks'][track]['score']:.3f}" if track in tool["tracks"] else _NONE for track in TRACKS]
    speed = tool["speed"]
    costs = [f"{speed['cpu_us']:.2g}", f"{speed['peak_mib']:.0f}"] if speed else [_NONE, _NONE]
    return [f"{tool['tool']}{_GIVEN[tool['input']]}", *scores, *costs]


def ordered(tools: Sequence[Row]) -> list[Row]:
    """By how many tracks a tool claims, then by its scores: an order to read by, no verdict."""
    return sorted(tools, key=lambda tool: (-len(tool["tracks"]), -sum(one["score"] for one in tool["tracks"].values())))


def orders(results: Sequence[Row]) -> str:
    """The tools of each track by their mean over the runs: `>` where all runs agree, `=` where two change places
    or do not differ."""
    return "\n".join(line for track in TRACKS if (line := _order(track, results)))


def _order(track: str, results: Sequence[Row]) -> str:
    runs = [{tool["tool"]: tool["tracks"][track]["score"] for tool in one["tools"] if track in tool["tracks"]}
            for one in results]  # fmt: skip
    names = sorted(set.intersection(*map(set, runs)), key=lambda name: (-sum(run[name] for run in runs), name))
    turned = {(better, worse): times for better, worse in combinations(names, 2)
              if (times := sum(run[worse] - run[better] >= _TIE for run in runs))}  # fmt: skip
    told = ", ".join(f"{better} and {worse} in {times}" for (better, worse), times in turned.items())
    if not names:
        return ""
    line = names[0]
    for place, name in enumerate(names[1:], 1):
        on_a_par = any(better in names[:place] and worse in names[place:] for better, worse in turned)
        on_a_par |= all(abs(run[names[place - 1]] - run[name]) < _TIE for run in runs)
        line += f" {'=' if on_a_par else '>'} {name}"
    return f"{track}: {line}; {len(runs)} runs, {f'change places: {told}' if told else 'the same order in each'}"


def differences(one: Row, other: Row) -> str:
    """How far the figures of two runs are apart, in per cent of the first."""
    lines = []
    for tool in one["tools"]:
        again: Any = next((row for row in other["tools"] if row["tool"] == tool["tool"]), None)
        if again is None:
            continue
        figures = [(track, told["score"], again["tracks"][track]["score"]) for track, told in tool["tracks"].items()]
        worst = max((abs(a - b) / a for _, a, b in figures if a), default=0.0)
        line = f"{tool['tool']}: tracks {worst:.2%}"
        if tool["speed"] and again["speed"]:
            apart = {name: abs(again["speed"][name] / tool["speed"][name] - 1) for name in ("cpu_us", "peak_mib")}
            line += f", CPU {apart['cpu_us']:.1%}, memory {apart['peak_mib']:.1%}"
        lines.append(line)
    return "\n".join(lines)
