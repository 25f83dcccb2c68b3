"""Functions that tests declare."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from dissectors import registry


@contextmanager
def declared() -> Iterator[None]:
    """What is registered inside is gone afterwards."""
    before, revision = dict(registry.functions()), registry.revision()
    try:
        yield
    finally:
        if registry.revision() != revision:
            registry._declared.clear()
            registry._declared.update(before)
            registry._state["revision"] += 1
