"""The folder of the page: its own files, an archive of the Python that reads, Pyodide's core beside them.

Where Node runs, the archive holds what Pyodide's own compiler makes of that Python, which a browser need not do again.
"""

from __future__ import annotations

import io
import subprocess
import zipfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Final

import construct

import analyzer
import captures
import dissectors
from captures.disposal import TemporaryFolder

from ...errors import RtuscopeError

_OWN: Final = ("index.html", "page.css", "page.mjs", "worker.mjs", "rtuscope.mjs")
_HERE: Final = Path(__file__).parent
_ARCHIVE: Final = "rtuscope.zip"
_PYODIDE: Final = (
    "pyodide.mjs",
    "pyodide.asm.mjs",
    "pyodide.asm.wasm",
    "python_stdlib.zip",
    "pyodide-lock.json",
    "package.json",
)
_READ: Final = (".py", ".toml", ".json", ".lark")  # what the code reads; samples, shipped maps and pages stay behind
_LEFT: Final = frozenset(
    ("tui", "fleet", "simulation", "causes", "samples", "live", "cli", "twin", "agents", "shipped", "plainarrays")
)
_STAND_IN: Final = Path(str(analyzer.__file__)).parent / "plainarrays"
_OLDEST: Final = (1980, 1, 1, 0, 0, 0)  # the same files make the same archive


class PageError(RtuscopeError):
    """A page that cannot be built, in one line."""


def build(out: str | Path, pyodide: str | Path | None = None) -> int:
    """Make the folder; gives its bytes without Pyodide's. PageError where that cannot be; nothing is written over."""
    folder = Path(out)
    try:
        core, packed = ({}, archive()) if pyodide is None else (_core(Path(pyodide)), compiled(Path(pyodide)))
        own = {name: (_HERE / name).read_bytes() for name in _OWN} | {_ARCHIVE: packed}
        folder.mkdir(parents=True)
        for name, data in (own | core).items():
            (folder / name).parent.mkdir(exist_ok=True)
            with (folder / name).open("xb") as file:
                file.write(data)
    except OSError as error:
        raise PageError(f"{error.filename or folder}: {(error.strerror or str(error)).lower()}") from error
    return sum(map(len, own.values()))


def _core(folder: Path) -> dict[str, bytes]:
    """The files of npm's package that a page needs, by their names in it."""
    try:
        return {f"pyodide/{name}": (folder / name).read_bytes() for name in _PYODIDE}
    except OSError as error:
        how = "npm install pyodide gives the folder node_modules/pyodide"
        raise PageError(f"{folder}: holds no {Path(error.filename).name}: {how}") from error


def archive() -> bytes:
    """The Python that reads pastes, with what it needs, as a zip file."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        for name, path in sorted(_sources()):
            packed.writestr(zipfile.ZipInfo(name, _OLDEST), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return made.getvalue()


def compiled(pyodide: Path) -> bytes:
    """The archive with its Python compiled; as it is where there is no Node, or none that runs this Pyodide."""
    packed = archive()
    with TemporaryFolder("rtuscope-page-") as folder:
        sources, made = folder / "sources.zip", folder / "compiled.zip"
        with sources.open("xb") as file:
            file.write(packed)
        script = _HERE / "compile.mjs"
        try:
            subprocess.run(["node", script, pyodide.resolve(), sources, made], capture_output=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            return packed
        return made.read_bytes()


def _sources() -> Iterator[tuple[str, Path]]:
    yield from ((f"numpy/{path.name}", path) for path in _STAND_IN.glob("*.py"))
    for package in (analyzer, captures, construct, dissectors):
        home = Path(str(package.__file__)).parents[1]
        named = ((path.relative_to(home), path) for path in _files(home / package.__name__))
        yield from ((name.as_posix(), path) for name, path in named if _LEFT.isdisjoint(name.parts))


def _files(folder: Path) -> Iterator[Path]:
    return chain.from_iterable(folder.rglob(f"*{suffix}") for suffix in _READ)
