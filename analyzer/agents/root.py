"""The one folder that an agent may read, and nothing outside it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Final

from dissectors.maps.files import shipped_names

from . import AgentError

_MOST: Final = 20_000  # names that are looked at
_MANIFEST: Final = "manifest"


class AgentRoot:
    """A folder; names in it are relative to it, with slashes. A link is followed where it stays inside."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """AgentError where there is no such folder."""
        try:
            self.path = Path(folder).resolve(strict=True)
        except (OSError, RuntimeError, ValueError) as error:
            raise AgentError(f"{os.fspath(folder)}: no such folder") from error
        if not self.path.is_dir():
            raise AgentError(f"{os.fspath(folder)}: is not a folder")

    def file(self, name: str) -> Path:
        """Where a file of this name really lies. AgentError where it is not inside, or no plain file."""
        path = self._inside(name)
        if not path.is_file():
            raise AgentError("no such file under the root: the tool `captures` lists what is there")
        return path

    def lake(self, name: str) -> Path:
        """The same of a lake."""
        path = self._inside(name)
        if not (path / _MANIFEST).is_dir():
            raise AgentError("no such lake under the root: the tool `captures` lists what is there")
        return path

    def map_name(self, name: str) -> str:
        """A register map, `MAP` or `MAP@UNIT`: a shipped one by its name, else the path of a file inside."""
        chart, at, unit = name.partition("@")
        return name if chart in shipped_names() else f"{self.file(chart)}{at}{unit}"

    def holds(self, path: Path) -> bool:
        """Whether a path leads nowhere else."""
        try:
            return path.resolve(strict=True).is_relative_to(self.path)
        except (OSError, RuntimeError):
            return False

    def names(self) -> Iterator[tuple[str, bool]]:
        """What is there, in order, and whether it is a lake; hidden files, and links that lead out, left out."""
        seen = 0
        for folder, folders, files in os.walk(self.path):
            here = Path(folder)
            lakes = [each for each in folders if (here / each / _MANIFEST).is_dir()]
            folders[:] = sorted(each for each in folders if not each.startswith(".") and each not in lakes)
            for name in sorted([*files, *lakes]):
                seen += 1
                if seen > _MOST:
                    return
                path = here / name
                if not name.startswith(".") and self.holds(path) and (path.is_file() or name in lakes):
                    yield path.relative_to(self.path).as_posix(), name in lakes

    def _inside(self, name: str) -> Path:
        """The real path of a name. AgentError."""
        ways = PurePosixPath(name), PureWindowsPath(name)
        if not name or "\0" in name or any(way.is_absolute() or way.anchor or ".." in way.parts for way in ways):
            raise AgentError("a name is relative to the root: no absolute path, no drive, no `..`")
        path = self.path / name
        try:
            real = path.resolve(strict=True)
        except (OSError, RuntimeError, ValueError) as error:
            raise AgentError("nothing of that name under the root: the tool `captures` lists what is there") from error
        if not real.is_relative_to(self.path):
            raise AgentError("that name leads out of the root")
        return real
