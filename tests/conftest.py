"""What holds for all tests: no property fails because a machine is slow."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("rtuscope", deadline=None)
settings.load_profile("rtuscope")
