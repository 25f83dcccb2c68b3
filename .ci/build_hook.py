"""What the build adds: the package `rtuscope`, and the pages of `docs/` that `rtuscope help` shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class BuildHook(BuildHookInterface[Any]):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        root = Path(self.root)
        files = [file for file in (root / "analyzer" / "product").iterdir() if file.is_file()]
        product = {str(file): f"rtuscope/{file.name}" for file in files}
        docs = root / "docs"
        pages = {str(page): f"analyzer/pages/{page.relative_to(docs).as_posix()}" for page in docs.rglob("*.md")}
        editable = version == "editable"
        build_data["force_include_editable" if editable else "force_include"] = product if editable else product | pages
