"""Where settings files are. Every command asks, so that nothing heavy is imported here."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

PROJECT = "rtuscope.toml"
USER = "config.toml"
OVERRIDE = "RTUSCOPE_CONFIG"  # another file in place of the user's; empty: no settings at all


def found_files() -> Iterator[str]:
    """The settings files that there are, the weaker first. Cheap where there is none."""
    own = os.environ.get(OVERRIDE)
    if own == "":
        return
    path = user_file() if own is None else own
    if own is not None or os.path.isfile(path):  # noqa: PTH113 - pathlib takes 4 ms to import
        yield path
    folder = os.getcwd()  # noqa: PTH109
    while True:
        path = os.path.join(folder, PROJECT)  # noqa: PTH118
        if os.path.isfile(path):  # noqa: PTH113
            yield path
            return
        above = os.path.dirname(folder)  # noqa: PTH120
        if above == folder:
            return
        folder = above


def user_file() -> str:
    """The user's file, there or not."""
    return os.path.join(user_folder(), USER)  # noqa: PTH118


def user_folder() -> str:
    """Where this user's own files are, there or not."""
    if sys.platform.startswith("linux"):  # as platformdirs has it, without the 5 ms of its import
        base = os.environ.get("XDG_CONFIG_HOME", "").strip() or os.path.expanduser("~/.config")  # noqa: PTH111
        return os.path.join(base, "rtuscope")  # noqa: PTH118
    import platformdirs

    return str(platformdirs.user_config_path("rtuscope", appauthor=False))
