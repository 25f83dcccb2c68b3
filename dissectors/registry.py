"""The one collection of declared functions: the specification's, found in `dissectors.functions`, and the user's.

A module of that package that holds `Function` values declares them; nothing lists the modules. Users add theirs by a
Python file (`load_file`) or an entry point of the group `rtuscope.functions` (`load_entry_points`), and may replace the
specification's. Nothing is read before somebody asks. Both are Python that runs with the user's rights.
"""

from __future__ import annotations

import os
import pkgutil
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final

from .declaration import DeclarationError, Function, class_of
from .limits import EXCEPTION

ENTRY_POINTS: Final = "rtuscope.functions"

_declared: dict[int, Function] = {}
_state = {"loaded": 0, "revision": 0}


def functions() -> Mapping[int, Function]:
    """All declared functions by code."""
    _load()
    return MappingProxyType(_declared)


def function(code: int) -> Function | None:
    """The declaration of a function code (of an exception's too), or None."""
    _load()
    return _declared.get(code & ~EXCEPTION)


def function_name(code: int) -> str:
    """The name in the specification, else the class of the code: `user-defined function 65`; exception bit ignored."""
    code &= ~EXCEPTION
    declared = function(code)
    return declared.name if declared is not None else f"{class_of(code)} function {code}"


def function_code(code: int) -> str:
    """How people are told a function code, units and addresses being decimal: `FC 16 (0x10)`; exception bit ignored."""
    code &= ~EXCEPTION
    return f"FC {code} (0x{code:02X})"


def function_class(code: int) -> str:
    """public, user-defined, reserved, unassigned or invalid ([1] 5), whoever has declared it."""
    code &= ~EXCEPTION
    kind = class_of(code)
    return "public" if kind == "unassigned" and function(code) is not None else kind


def register(function: Function) -> None:
    """Makes a function known to the length rules and the annotation; it replaces an earlier one of the same code."""
    _load()
    _check(function)
    _declared[function.code] = function
    _state["revision"] += 1


def revision() -> int:
    """A number that changes with each function registered, for those who keep something made from the declarations."""
    return _state["revision"]


def load_file(path: str | os.PathLike[str]) -> list[Function]:
    """Runs a Python file and registers the functions that it defines; returns them.

    A DeclarationError says what is wrong with the file and in which line, whatever goes wrong in it.
    """
    from pathlib import Path

    name = os.fspath(path)
    try:
        source = Path(name).read_bytes()
    except OSError as error:
        raise DeclarationError(f"{name}: {error.strerror or error}") from error
    space: dict[str, object] = {"__name__": "rtuscope_functions", "__file__": name}
    try:
        exec(compile(source, name, "exec"), space)
    except SyntaxError as error:
        where = f"{name}:{error.lineno}" if error.lineno else name
        raise DeclarationError(f"{where}: {error.msg}") from error
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        line = _line_of(error, name)
        where = f"{name}:{line}" if line else name
        raise DeclarationError(f"{where}: {_error_line(error)}") from error
    try:
        declarations = list(_functions_in(space.values()))
        for function in declarations:
            register(function)
    except Exception as error:
        raise DeclarationError(f"{name}: {_error_line(error)}") from error
    if not declarations:
        raise DeclarationError(f"{name}: defines no Function")
    return declarations


def load_entry_points(tell: Callable[[str], object] = warnings.warn) -> list[Function]:
    """Registers the functions that installed packages offer in the entry point group; returns them.

    An entry point names a Function, a collection of them or a module that holds some. `tell` gets a line for each one
    that cannot be used: it is left out, and the others are not.
    """
    from importlib.metadata import entry_points

    loaded: list[Function] = []
    for point in entry_points(group=ENTRY_POINTS):
        try:
            loaded += _offered(point.load())
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            tell(f"plug-in {point.name} ({point.value}) is skipped: {_error_line(error)}")
    return loaded


def _offered(thing: object) -> list[Function]:
    """Registers what an entry point names."""
    own = hasattr(thing, "__dict__") and not isinstance(thing, Function)
    offered = list(_functions_in(vars(thing).values() if own else [thing]))
    if not offered:
        raise DeclarationError("holds no Function")
    for function in offered:
        _check(function)
    for function in offered:
        register(function)
    return offered


def _load() -> None:
    if _state["loaded"]:
        return
    _state["loaded"] = 1
    package = import_module("dissectors.functions")
    for module in sorted(info.name for info in pkgutil.iter_modules(package.__path__)):
        for function in _functions_in(vars(import_module(f"dissectors.functions.{module}")).values()):
            _declared[function.code] = function


def _functions_in(values: Iterable[object]) -> Iterator[Function]:
    """The functions among some values, and in the lists and tuples among them, each once."""
    listed: set[int] = set()
    for value in values:
        for item in value if isinstance(value, list | tuple | set | frozenset) else (value,):
            if isinstance(item, Function) and id(item) not in listed:
                listed.add(id(item))
                yield item


def _check(function: Function) -> None:
    """A declaration must give a rule for both sides, and names that can be shown."""
    from .length_rules import Role, compiled, field_names

    names = (*field_names(function.request), *field_names(function.response))
    for text in (function.name, *function.words("request"), *function.words("response"), *names):
        if not isinstance(text, str) or not text.isprintable():
            raise DeclarationError(f"function {function.code}: {text!r} cannot be shown as text")
    for role in Role:
        try:
            compiled(function, role)
        except Exception as error:
            side = role.name.lower()
            raise DeclarationError(
                f"function {function.code} {function.name!r}: {side}: {_error_line(error)}"
            ) from error


def _line_of(error: BaseException, name: str) -> int:
    """The last line of the file that the error went through."""
    line = 0
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == name:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def _error_line(error: BaseException) -> str:
    """An error on one line."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # it cannot even say what it is
        text = ""
    return (
        text
        if isinstance(error, DeclarationError)
        else f"{type(error).__name__}: {text}"
        if text
        else type(error).__name__
    )
