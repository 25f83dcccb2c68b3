"""What holds for all tests: no property fails because a machine is slow, and no settings of a user's are read."""

from __future__ import annotations

import os
import tempfile

from hypothesis import settings

os.environ["XDG_CONFIG_HOME"] = os.environ["APPDATA"] = tempfile.mkdtemp()  # nobody's own settings, read or written

settings.register_profile("rtuscope", deadline=None)
settings.load_profile("rtuscope")
os.environ["RTUSCOPE_CONFIG"] = ""
