"""What is installed apart: libraries that only some of the work needs, and how to get one here."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

_NAME: Final = "rtuscope"


def needs(what: str, library: str, extra: str | None = None) -> str:
    """That something needs a library that is not here, and the line that installs it, as this program was installed."""
    return f"{what} needs {library}: {install_line(library, extra)}"


def install_line(library: str, extra: str | None = None) -> str:
    """The command that adds an extra to this installation; the library alone where no extra has it."""
    prefix = Path(sys.prefix)
    source = _clone() or _NAME
    quote = '"' if os.name == "nt" else "'"
    if (prefix / "pipx_metadata.json").exists():  # a mark of its own, wherever it is; there is no pip
        return f"pipx inject {_NAME} {library}"
    if (prefix / "uv-receipt.toml").exists():
        extras, others = _kept(prefix / "uv-receipt.toml")
        withs = " ".join(f"--with {_shell_word(each, quote)}" for each in (*others, library))
        return f"uv tool install {withs} {quote}{source}{extras}{quote}"
    if extra is None:
        return f"{_python()} -m pip install {library}"
    return f"{_python()} -m pip install {quote}{source}[{extra}]{quote}"


def _kept(receipt: Path) -> tuple[str, list[str]]:
    """What uv was told to install before, which it takes away where it is not told again: the extras of this program
    (`[mqtt]`, or nothing), and the libraries beside it."""
    import tomllib

    try:
        told = tomllib.loads(receipt.read_text(encoding="utf-8"))["tool"]["requirements"]
        extras = sorted({extra for each in told if each["name"] == _NAME for extra in each.get("extras", ())})
        others = [_requirement(each) for each in told if each["name"] != _NAME]
    except (OSError, ValueError, LookupError, TypeError):  # another uv's
        return "", []
    return f"[{','.join(extras)}]" if extras else "", others


def _requirement(entry: Mapping[str, str]) -> str:
    """A library of uv's list as its command takes it."""
    place = next((entry[key] for key in ("directory", "editable", "path", "url") if key in entry), None)
    return place or f"{entry['name']}{entry.get('specifier', '')}"


def _shell_word(requirement: str, quote: str) -> str:
    return requirement if requirement.replace("-", "").replace("_", "").isalnum() else f"{quote}{requirement}{quote}"


def _python() -> str:
    """The interpreter of this installation; its short name where that finds it."""
    return "python" if sys.prefix != sys.base_prefix and "VIRTUAL_ENV" in os.environ else sys.executable


def _clone() -> str | None:
    """The folder that this was installed from, where it was: a package of that name is looked for nowhere else."""
    import json
    from importlib.metadata import PackageNotFoundError, distribution
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        text = distribution(_NAME).read_text("direct_url.json")
    except PackageNotFoundError:
        return str(Path(__file__).parents[1])
    url = json.loads(text).get("url", "") if text else ""
    return url2pathname(urlsplit(url).path) if url.startswith("file:") else None
