"""The functions of the specification, a file a function or close family, and the way to all declared ones.

A new public function is a new file here with `Function` values in it; `dissectors.registry` finds it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..declaration import DeclarationError, Function
from ..registry import (
    function,
    function_class,
    function_code,
    function_name,
    functions,
    load_entry_points,
    load_file,
    register,
    revision,
)

if TYPE_CHECKING:
    from .exceptions import exception_meaning, exception_name

__all__ = [
    "DeclarationError",
    "Function",
    "exception_meaning",
    "exception_name",
    "function",
    "function_class",
    "function_code",
    "function_name",
    "functions",
    "load_entry_points",
    "load_file",
    "register",
    "revision",
]


def __getattr__(name: str) -> object:
    if name in ("exception_meaning", "exception_name"):
        from dissectors.functions import exceptions

        return getattr(exceptions, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
