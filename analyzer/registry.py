"""Collections whose entries are declared in the modules of a package, so that nothing lists them.

    RULES: Final = Registry[Rule]("analyzer.diagnosis.rules", "rule")
    RULES.enter("crc-error", rule)          # in a module of that package
    RULES.entries()["crc-error"]            # imports the modules first, in the order of their names

`captures.formats` and `dissectors.registry` stand on floors that know nothing of each other nor of this one; both take
entries of other distributions besides, which none of these collections does.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Generic, TypeVar

T = TypeVar("T")


class Registry(Generic[T]):
    """Entries by name, from the modules of `package`; `kind` is what one is called in an error."""

    def __init__(self, package: str, kind: str) -> None:
        self._package = package
        self._kind = kind
        self._entries: dict[str, T] = {}
        self._complete = False

    def enter(self, name: str, entry: T) -> None:
        """Adds an entry. ValueError where another one has the name."""
        if self._entries.setdefault(name, entry) is not entry:
            raise ValueError(f"two entries are called {name}: each {self._kind} needs a name of its own")

    def entries(self) -> Mapping[str, T]:
        """All entries, in the order in which the sorted modules declare them."""
        if not self._complete:
            for module in module_names(self._package):
                import_module(f"{self._package}.{module}")
            self._complete = True
        return MappingProxyType(self._entries)

    def by_name(self) -> dict[str, T]:
        """The same, in the order of the names."""
        return dict(sorted(self.entries().items()))


def module_names(package: str) -> tuple[str, ...]:
    """The names of a package's modules, sorted; none of them is imported."""
    return tuple(sorted(info.name for info in pkgutil.iter_modules(import_module(package).__path__)))
