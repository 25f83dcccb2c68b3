"""What holds for all tests: no property fails because a machine is slow, no settings of a user's are read, and no test
leaves anything to the next one."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from declaring import declared
from hypothesis import settings

from analyzer import languages

_SETTINGS = Path(tempfile.mkdtemp())
os.environ["XDG_CONFIG_HOME"] = os.environ["APPDATA"] = str(_SETTINGS)  # nobody's own settings, read or written

settings.register_profile("rtuscope", deadline=None, max_examples=40)
settings.load_profile("rtuscope")
os.environ["RTUSCOPE_CONFIG"] = ""
os.environ["LC_ALL"] = "C.UTF-8"  # nobody's own language

# What a shell's `&` and `nohup` make a process ignore it would pass on to the commands that tests begin and end.
for _name, _usual in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    _number = getattr(signal, _name, None)
    if _number is not None and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _usual)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """More than there are cores: many a test waits for a port, a terminal, another process."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cores + (cores + 1) // 2


def pytest_collection_finish() -> None:
    """What was imported and collected is no garbage: nobody looks through all of it again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 10, 10)


@pytest.fixture(autouse=True)
def _told_in_english() -> None:
    """Each test begins in English, whatever language one before it chose."""
    languages.use_language("en")


@pytest.fixture(autouse=True)
def _wished_by_nobody() -> Iterator[None]:
    """Keys and filters that a test keeps are not there for the next one."""
    yield
    shutil.rmtree(_SETTINGS, ignore_errors=True)
    _SETTINGS.mkdir(exist_ok=True)


@pytest.fixture(autouse=True)
def _declared_by_nobody() -> Iterator[None]:
    """Functions that a test declares, by a command's `--functions` say, are not known to the next one."""
    with declared():
        yield
