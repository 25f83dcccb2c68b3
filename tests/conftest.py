"""What holds for all tests: no property fails because a machine is slow, and no settings of a user's are read."""

from __future__ import annotations

import os
import tempfile

import pytest
from hypothesis import settings

from analyzer import languages

os.environ["XDG_CONFIG_HOME"] = os.environ["APPDATA"] = tempfile.mkdtemp()  # nobody's own settings, read or written

settings.register_profile("rtuscope", deadline=None)
settings.load_profile("rtuscope")
os.environ["RTUSCOPE_CONFIG"] = ""


@pytest.fixture(autouse=True)
def _told_in_english() -> None:
    """Each test begins in English, whatever language one before it chose."""
    languages.use("en")
