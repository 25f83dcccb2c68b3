"""The house itself: no class name twice, no circle of imports, lazy imports within functions included.

And what looking at one frame may import: nothing heavy, and nothing of the packages above.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import dissectors

ROOT = Path(__file__).parents[1]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in ("analyzer", "captures", "dissectors")
    for path in (ROOT / package).rglob("*.py")
}


@cache
def trees() -> dict[str, ast.Module]:
    """Each module's: not made where this file is only collected, as every worker does."""
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in FILES.items()}


def imported(name: str) -> set[str]:
    """The modules of this project that a module imports, for type checking alone left out."""
    package = name if FILES[name].name == "__init__.py" else name.rpartition(".")[0]
    left_out = {
        id(inner)
        for node in ast.walk(trees()[name])
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        for inner in ast.walk(node)
    }
    modules = set()
    for node in ast.walk(trees()[name]):
        if isinstance(node, ast.ImportFrom) and id(node) not in left_out:
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            modules |= {f"{base}.{each.name}" if f"{base}.{each.name}" in FILES else base for each in node.names}
    return {module for module in modules if module in FILES and module != name}


def test_no_class_has_the_name_of_another() -> None:
    homes = defaultdict(list)
    for name, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                homes[node.name.strip("_")].append(name)
    assert len(homes) > 500
    assert {name: modules for name, modules in homes.items() if len(modules) > 1} == {}


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = {name: imported(name) for name in FILES}
    assert sum(map(len, graph.values())) > 1000
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(f"a circle of imports: {' -> '.join(error.args[1])}") from None


def test_annotating_needs_construct_and_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from dissectors import Role, annotate, rtu, summary\n"
        "assert annotate(rtu(bytes.fromhex('1103006B00037687')), Role.REQUEST)\n"
        "assert summary(rtu(bytes.fromhex('1103006B00037687')), Role.REQUEST)\n"
        "print(*sorted({name.split('.')[0] for name in sys.modules}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert {"construct", "dissectors"} <= loaded
    assert not loaded & {"numpy", "orjson", "textual", "mcap", "rich", "analyzer", "captures", "serial"}


def test_importing_the_package_imports_nothing() -> None:
    code = "import sys, dissectors; print(*[n for n in sys.modules if n.startswith(('dissectors.', 'construct'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not done.stdout.split()


def test_every_public_name_is_there() -> None:
    assert all(getattr(dissectors, name) is not None for name in dissectors.__all__)
    assert sorted(dissectors.__all__) == sorted(dissectors._MODULES)
