"""The scripts of `benchmarks/`, as modules."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

_FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
if str(_FOLDER) not in sys.path:  # as it stands there for a script that is run
    sys.path.append(str(_FOLDER))


def package(name: str) -> ModuleType:
    """A package, or a module in one, by its dotted name."""
    return importlib.import_module(name)


def script(name: str) -> ModuleType:
    """A script by its name without the suffix."""
    spec = importlib.util.spec_from_file_location(name, _FOLDER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
