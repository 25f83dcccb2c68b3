"""What holds for all tests: no property fails because a machine is slow, and no settings of a user's are read."""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("rtuscope", deadline=None)
settings.load_profile("rtuscope")
os.environ["RTUSCOPE_CONFIG"] = ""
