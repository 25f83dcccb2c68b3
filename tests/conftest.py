"""What holds for all tests: no property fails because a machine is slow."""

from __future__ import annotations

import os
import tempfile

from hypothesis import settings

os.environ["XDG_CONFIG_HOME"] = os.environ["APPDATA"] = tempfile.mkdtemp()  # nobody's own settings, read or written

settings.register_profile("rtuscope", deadline=None)
settings.load_profile("rtuscope")
