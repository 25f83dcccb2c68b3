"""All views, in the order of their tabs: a new one is a line here."""

from __future__ import annotations

from typing import Final

from . import (
    against,
    findings,
    frames,
    home,
    pastepane,
    polllist,
    registerspane,
    report,
    timelinepane,
    transactions,
    unitlist,
)
from .view import View

VIEWS: Final[tuple[View, ...]] = (
    home.VIEW,
    transactions.VIEW,
    frames.VIEW,
    findings.VIEW,
    polllist.VIEW,
    registerspane.VIEW,
    timelinepane.VIEW,
    report.VIEW,
    pastepane.VIEW,
    unitlist.VIEW,
    against.VIEW,
)
BY_NAME: Final = {view.name: view for view in VIEWS}
