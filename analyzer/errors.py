"""One base for every error that a user may catch.

The packages below know nothing of this one, so their errors cannot be declared under its base. Where they leave by the
public calls they are given a class that is both: `except captures.CaptureError` and `except RtuscopeError` both hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

_Item = TypeVar("_Item")
_BELOW = frozenset({"captures", "dissectors"})


class RtuscopeError(Exception):
    """What went wrong, in one line for a person: the base of all errors that the public calls raise."""


_made: dict[type[Exception], type[Exception]] = {}


def _under_base(kind: type[Exception]) -> type[Exception]:
    """A class of the same name that is `kind` and RtuscopeError; one for each kind."""
    about = {"__doc__": kind.__doc__, "__module__": kind.__module__}
    return _made.setdefault(kind, type(kind.__name__, (kind, RtuscopeError), about))


@contextmanager
def under_base() -> Iterator[None]:
    """Errors of the packages below leave as RtuscopeError, too; all others as they are."""
    try:
        yield
    except Exception as error:
        if type(error).__module__.partition(".")[0] in _BELOW and not isinstance(error, RtuscopeError):
            setattr(error, "__class__", _under_base(type(error)))  # noqa: B010 - mypy knows no such assignment
        raise


def stream_under_base(items: Iterable[_Item]) -> Iterator[_Item]:
    """The same of what is read piece by piece."""
    with under_base():
        yield from items
