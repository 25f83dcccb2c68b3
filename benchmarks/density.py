"""Counts how densely each room decides, and holds every room to at most what it has had.

    python benchmarks/density.py [--check | --lower]

A room is a folder of a package. Decisions, per 1,000 lines, are `if`, conditional expressions, each operand of `and`
and `or` beyond the first, each filter of a comprehension; complexity is the cyclomatic one of its worst function;
patterns are calls of `re`. Tables have 40 to 80 decisions; a room with four times as many was written case by case.
`density.toml` holds each room's limits: `--check` ends with 1 where one is passed or missing, `--lower` writes what
rooms have now where it is less.
"""

from __future__ import annotations

import argparse
import ast
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LIMITS = Path(__file__).with_suffix(".toml")
_PACKAGES = ("analyzer", "captures", "dissectors")
_PATTERNS = {"compile", "match", "search", "fullmatch", "findall", "finditer", "sub", "split"}
_FORKS = (ast.For, ast.While, ast.ExceptHandler, ast.comprehension, ast.match_case)
_Definition = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Room:
    """Figures of a room: lines, decisions in 1,000 of them (rounded up), the worst complexity, calls of `re`."""

    lines: int
    decisions: int
    complexity: int
    patterns: int
    worst: str

    @property
    def limits(self) -> tuple[int, int, int]:
        """What is held: lines may grow."""
        return self.decisions, self.complexity, self.patterns


def _decisions(nodes: Iterable[ast.AST]) -> int:
    count = 0
    for node in nodes:
        count += isinstance(node, ast.If | ast.IfExp)
        count += len(node.values) - 1 if isinstance(node, ast.BoolOp) else 0
        count += len(node.ifs) if isinstance(node, ast.comprehension) else 0
    return count


def _within(function: _Definition) -> Iterator[ast.AST]:
    """The nodes of a function, without those of functions and classes in it."""
    waiting: list[ast.AST] = list(ast.iter_child_nodes(function))
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, _Definition | ast.ClassDef):
            waiting.extend(ast.iter_child_nodes(node))


def _complexity(function: _Definition) -> int:
    nodes = list(_within(function))
    return 1 + _decisions(nodes) + sum(isinstance(node, _FORKS) for node in nodes)


def _is_pattern(node: ast.AST) -> bool:
    match node:
        case ast.Call(func=ast.Attribute(value=ast.Name(id="re"), attr=name)):
            return name in _PATTERNS
    return False


def room_of(files: Mapping[str, str]) -> Room:
    """The figures of sources, by their names."""
    nodes = [(name, node) for name, text in files.items() for node in ast.walk(ast.parse(text))]
    functions = [(_complexity(n), f"{name}:{n.name}") for name, n in nodes if isinstance(n, _Definition)]
    worst, where = max(functions, default=(0, ""))
    lines = sum(text.count("\n") for text in files.values())
    decisions = -(-1000 * _decisions(node for _, node in nodes) // max(1, lines))
    return Room(lines, decisions, worst, sum(_is_pattern(node) for _, node in nodes), where)


def rooms() -> dict[str, Room]:
    """All rooms of the product by name."""
    files: dict[str, dict[str, str]] = {}
    for package in _PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).parts
            room = "/".join(parts[:2]) if len(parts) > 2 else parts[0]
            files.setdefault(room, {})["/".join(parts)] = path.read_text(encoding="utf-8")
    return {name: room_of(sources) for name, sources in sorted(files.items())}


def passed(found: Mapping[str, Room], limits: Mapping[str, list[int]]) -> Iterator[str]:
    """A line for each room beyond its limits, or without any."""
    for name, room in found.items():
        if name not in limits:
            yield f"{name}: has no limits in {LIMITS.name}; run `python benchmarks/density.py --lower`"
            continue
        for figure, most, word in zip(room.limits, limits[name], ("decisions", "complexity", "patterns"), strict=True):
            if figure > most:
                yield f"{name}: {figure} {word}, at most {most} ({room.worst})"


def lowered(found: Mapping[str, Room], limits: Mapping[str, list[int]]) -> str:
    """The file of limits, each at the lower of what it was and what is found."""
    head = "# Rooms: decisions in 1,000 lines, complexity of the worst function, calls of `re`. Only lower them.\n"
    rows = []
    for name, room in found.items():
        least = [min(pair) for pair in zip(room.limits, limits.get(name, room.limits), strict=True)]
        rows.append(f'"{name}" = {least}\n')
    return head + "".join(rows)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", action="store_true", help="status 1 where a room passes its limits")
    what.add_argument("--lower", action="store_true", help="write the limits that rooms keep now")
    options = parser.parse_args(arguments)
    found = rooms()
    limits = tomllib.loads(LIMITS.read_text(encoding="utf-8")) if LIMITS.exists() else {}
    if options.lower:
        LIMITS.write_text(lowered(found, limits), encoding="utf-8")
        return 0
    over = list(passed(found, limits)) if options.check else []
    if not options.check:
        print(f"{'room':28}{'lines':>8}{'decisions':>11}{'complexity':>12}{'patterns':>10}  worst function")
        for name, room in sorted(found.items(), key=lambda one: -one[1].decisions):
            print(f"{name:28}{room.lines:8}{room.decisions:11}{room.complexity:12}{room.patterns:10}  {room.worst}")
    print(*over, sep="\n", end="\n" if over else "")
    return int(bool(over))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
