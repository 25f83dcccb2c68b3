"""What holds for all tests: no property fails because a machine is slow, and no settings of a user's are read."""

from __future__ import annotations

import os
import signal
import tempfile

import pytest
from hypothesis import settings

from analyzer import languages

os.environ["XDG_CONFIG_HOME"] = os.environ["APPDATA"] = tempfile.mkdtemp()  # nobody's own settings, read or written

settings.register_profile("rtuscope", deadline=None)
settings.load_profile("rtuscope")
os.environ["RTUSCOPE_CONFIG"] = ""

# What a shell's `&` and `nohup` make a process ignore it would pass on to the commands that tests begin and end.
for _name, _usual in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    _number = getattr(signal, _name, None)
    if _number is not None and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _usual)


@pytest.fixture(autouse=True)
def _told_in_english() -> None:
    """Each test begins in English, whatever language one before it chose."""
    languages.use("en")
