"""Numbers as languages with a decimal comma write them: thousands apart by a space.

A no-break space does not print as itself on every terminal (`dissectors.values.harmless`); what wraps lines keeps a
number whole (`reports.paragraphs`).
"""

from __future__ import annotations

import re
from typing import Final

APART: Final = " "
_ENGLISH: Final = re.compile(r"\d{1,3}(,\d{3})+")


class GroupedInt(int):
    """An integer that a template's `{count:,}` writes so."""

    def __format__(self, spec: str) -> str:
        return super().__format__(spec).replace(",", APART)


def regrouped(text: str) -> str:
    """Text that is one number, its thousands apart by commas, written so; any other as it is."""
    return text.replace(",", APART) if _ENGLISH.fullmatch(text) else text
