"""What cannot be done with a lake or with sources, as one line."""

from __future__ import annotations


class FleetError(Exception):
    """Sources, a lake or a question that cannot be used: what, where, what to do."""


class LakeWriteError(FleetError):
    """The lake took no rows: no fault of the capture that they are of."""
