"""Switches decisions of a room off, one at a time and drawn at random, and counts those that change nothing anywhere.

    python benchmarks/ablate.py ROOM [--sample N] [--seed N] [--only KIND ...] [--every N] [--seeds N] [--fold fit|told]

ROOM is a folder or file of the project, such as `captures/text`. A decision is the test of an `if` or of a conditional
expression (off: never so), an operand of `and` or `or` (off: not there), a filter of a comprehension (off: all pass).
Samples and what is compared are those of `ecosystem.py`; choose few, for each decision runs through all of them. Where
more than a third of the decisions change nothing, the room is due: it decides about cases that no data has.
"""

from __future__ import annotations

import argparse
import ast
import importlib.abc
import importlib.machinery
import importlib.util
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True)
class Decision:
    """A node of a file's syntax tree that decides: where it stands and which kind it is."""

    file: str
    line: int
    column: int
    kind: str

    @property
    def place(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


class _Switch(ast.NodeTransformer):
    """The tree without the decision at a place; `done` says whether it was met."""

    def __init__(self, line: int, column: int) -> None:
        self._place = (line, column)
        self.done = False

    def _is(self, node: ast.expr) -> bool:
        found = (node.lineno, node.col_offset) == self._place and not self.done
        self.done |= found
        return found

    def _never(self, node: Any) -> Any:
        if self._is(node.test):
            node.test = ast.copy_location(ast.Constant(False), node.test)
        return self.generic_visit(node)

    visit_If = visit_IfExp = _never  # noqa: N815 - the names that ast calls

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        for operand in node.values[1:]:
            if self._is(operand):
                node.values.remove(operand)
        self.generic_visit(node)
        return node if len(node.values) > 1 else node.values[0]

    def visit_comprehension(self, node: ast.comprehension) -> ast.AST:
        node.ifs = [test for test in node.ifs if not self._is(test)]
        return self.generic_visit(node)


def decisions_of(path: Path) -> Iterator[Decision]:
    """The decisions of a file."""
    name = str(path.relative_to(ROOT))
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        tests: Sequence[ast.expr] = ()
        if isinstance(node, ast.If | ast.IfExp):
            tests = [node.test]
        elif isinstance(node, ast.BoolOp):
            tests = node.values[1:]
        elif isinstance(node, ast.comprehension):
            tests = node.ifs
        for test in tests:
            yield Decision(name, test.lineno, test.col_offset, type(node).__name__)


def switched_off(source: str, line: int, column: int) -> ast.Module:
    """The syntax tree of a source without the decision at a place; ValueError where none is there."""
    switch = _Switch(line, column)
    tree = ast.parse(source)
    switch.visit(tree)
    if not switch.done:
        raise ValueError(f"no decision at {line}:{column}")
    return ast.fix_missing_locations(tree)


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads one module without a decision."""

    def __init__(self, name: str, path: str, line: int, column: int) -> None:
        super().__init__(name, path)
        self._place = (line, column)

    def get_code(self, fullname: str) -> Any:
        source = self.get_source(fullname)
        assert source is not None
        return compile(switched_off(source, *self._place), self.path, "exec")


class _Finder(importlib.abc.MetaPathFinder):
    """Finds that one module before Python does."""

    def __init__(self, file: Path, line: int, column: int) -> None:
        self._file, self._place = file, (line, column)
        parts = file.with_suffix("").parts
        self._name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        del path, target
        if fullname != self._name:
            return None
        where = str(Path.cwd() / self._file)
        loader = _Loader(fullname, where, *self._place)
        return importlib.util.spec_from_file_location(fullname, where, loader=loader)


def switch_off(place: str) -> None:
    """Import the module of `FILE:LINE:COLUMN`, when it is imported, without that decision."""
    file, line, column = place.rsplit(":", 2)
    sys.meta_path.insert(0, _Finder(Path(file), int(line), int(column)))


def main(arguments: list[str]) -> int:
    import ecosystem

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("room", metavar="ROOM", help="folder or file, from the root of the project")
    parser.add_argument("--sample", type=int, default=60, metavar="N", help="decisions to draw (60)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    ecosystem.add_sample_arguments(parser)
    options = parser.parse_args(arguments)
    room = ROOT / options.room
    files = sorted(room.rglob("*.py")) if room.is_dir() else [room]
    every = [decision for file in files for decision in decisions_of(file)]
    drawn = Random(options.seed).sample(every, min(options.sample, len(every)))
    idle = []
    with tempfile.TemporaryDirectory() as folder:
        samples = ecosystem.chosen_samples(Path(folder), options)
        whole = ecosystem.told_by(ecosystem.facts(ROOT, samples, options.only))
        for number, decision in enumerate(drawn, 1):
            without = ("--without", decision.place)
            told = ecosystem.told_by(ecosystem.facts(ROOT, samples, options.only, without), may_fail=True)
            changed = sum(1 for _ in ecosystem.differences(whole, told))
            idle += [] if changed else [decision]
            print(f"{number:3} {decision.place} {decision.kind}: {changed} facts differ", flush=True)
    print(f"{len(idle)} of {len(drawn)} decisions drawn of {len(every)} change nothing in {len(samples)} samples")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
