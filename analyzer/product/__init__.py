"""The public API under the product's name: `import rtuscope` gives what `import analyzer` gives.

The build installs this folder as the package `rtuscope` (see `.ci/build_hook.py`).
"""

from typing import Any

import analyzer
from analyzer import __all__ as __all__


def __getattr__(name: str) -> Any:
    return getattr(analyzer, name)


def __dir__() -> list[str]:
    return sorted(__all__)
