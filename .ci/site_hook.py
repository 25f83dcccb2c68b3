"""What the site does with links that lead out of `docs/`: README becomes its first page, others become their names."""

from __future__ import annotations

import re
from typing import Any


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page, whose links all lead somewhere on the site."""
    markdown = markdown.replace("](../README.md)", "](index.md)")
    return re.sub(r"\[([^\]]+)\]\(\.\./[A-Z]+\.md\)", r"\1", markdown)
