"""A digest of the code that a class or a function can reach, and of the constants it reads."""

from __future__ import annotations

import dis
import functools
import hashlib
import sys
import types
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from reliability.pickled_content import content_digest

_LIBRARY = frozenset({"planners", "reliability", "systems"})
_INSTALLED = frozenset({"site-packages", "dist-packages"})
# What the body of a class notes down of its text.
_NOTES = frozenset({"__doc__", "__firstlineno__"})
_PLAIN = (bool, int, float, complex, str, bytes, np.generic, np.ndarray, tuple, frozenset, Enum)


def code_digest(thing: Any) -> str:
    """Return 16 hexadecimal digits that change when a class or function comes to do other things.

    Followed are base classes, methods, and the functions, classes and constants that these name,
    in the user's modules and in this library; not the standard library and installed packages.
    Comments, docstrings, the module's name and code that is never named don't count. Lists and
    dicts count if they are named in capitals, as constants are. What is compiled from the same
    source by another version of Python counts as other code.

    Parameters
    ----------
    thing : class or function
    """
    walk = _Walk()
    walk.visit("", thing)
    total = hashlib.blake2b(digest_size=8)
    for token in sorted(walk.tokens):
        total.update(token.encode() + b"\0")
    return total.hexdigest()


class _Walk:
    """One pass over all that is reachable."""

    def __init__(self) -> None:
        self.tokens: set[str] = set()
        self._seen: dict[int, Any] = {}

    def visit(self, name: str, thing: Any) -> None:
        thing = _unwrapped(thing)
        if isinstance(thing, _PLAIN) or thing is None:
            self._constant(name, thing)
            return
        if isinstance(thing, Path):
            self._file(thing)
            return
        if id(thing) in self._seen:
            return
        self._seen[id(thing)] = thing
        if isinstance(thing, types.FunctionType):
            self._function(thing)
        elif isinstance(thing, type):
            self._class(thing)
        elif isinstance(thing, property):
            self._each(name, [thing.fget, thing.fset])
        elif isinstance(thing, functools.partial):
            self._each(name, [thing.func, *thing.args, *thing.keywords.items()])
        elif isinstance(thing, list | set) and name.isupper():
            self._each(name, list(thing))
        elif isinstance(thing, dict) and name.isupper():
            self._each(name, [part for pair in thing.items() for part in pair])
        elif _is_own(type(thing).__module__):
            if name.isupper():
                self._constant(name, thing)
            self.visit("", type(thing))

    def _each(self, name: str, things: list[Any]) -> None:
        self.tokens.add(f"{name} holds {len(things)}")
        for i, thing in enumerate(things):
            self.visit(f"{name}[{i}]".upper() if name.isupper() else f"{name}[{i}]", thing)

    def _constant(self, name: str, value: Any) -> None:
        if isinstance(value, tuple | frozenset):
            self._each(name, list(value))
            return
        try:
            self.tokens.add(f"{name} = {content_digest(value)}")
        except TypeError:  # not a constant after all
            return

    def _file(self, path: Path) -> None:
        """Count the content of a file that a constant names, such as a simulator's model."""
        if path.is_file():
            self.tokens.add(f"file {path.name} {content_digest(path.read_bytes())}")

    def _class(self, kind: type) -> None:
        if not _is_own(kind.__module__):
            return
        self.tokens.add(
            f"class {kind.__qualname__} {[base.__qualname__ for base in kind.__bases__]}"
        )
        if issubclass(kind, Enum):
            self._each(kind.__qualname__, [(member.name, repr(member.value)) for member in kind])
            return
        for base in kind.__bases__:
            self.visit("", base)
        for name, value in vars(kind).items():
            is_code = isinstance(_unwrapped(value), types.FunctionType)
            if is_code or not name.startswith(("__", "_abc_")):
                self.visit(f"{kind.__qualname__}.{name}", value)

    def _function(self, function: types.FunctionType) -> None:
        if not _is_own(function.__module__):
            return
        codes = list(_codes(function.__code__))
        for code in codes:
            self.tokens.add(f"def {function.__qualname__} {_fingerprint(code)}")
        defaults = (function.__defaults__, tuple((function.__kwdefaults__ or {}).items()))
        self.visit(f"{function.__qualname__} defaults", defaults)
        # The body of a class inside a function names its module's __name__ and, if it has a
        # docstring, __doc__.
        names = {name for code in codes for name in code.co_names if not name.startswith("__")}
        for name in sorted(names & function.__globals__.keys()):
            value = function.__globals__[name]
            if isinstance(value, types.ModuleType):
                self._module(value, names)
            else:
                self.visit(name, value)
        for cell in function.__closure__ or ():
            self.visit(f"{function.__qualname__} closure", _content_of(cell))

    def _module(self, module: types.ModuleType, names: set[str]) -> None:
        if _is_own(module.__name__):
            for name in sorted(names & vars(module).keys()):
                self.visit(name, vars(module)[name])


def _unwrapped(thing: Any) -> Any:
    while True:
        inner = getattr(thing, "py_func", None)  # numba's
        if inner is None and isinstance(thing, staticmethod | classmethod | types.MethodType):
            inner = thing.__func__
        if inner is None and isinstance(thing, functools.cached_property):
            inner = thing.func
        if inner is None and not isinstance(thing, type):
            inner = getattr(thing, "__wrapped__", None)
        if inner is None:
            return thing
        thing = inner


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


@functools.cache
def _fingerprint(code: types.CodeType) -> str:
    """Digest instructions, each with the constant or name that it uses.

    No instruction uses a function's docstring, but it takes a place among the constants, so that
    their places say nothing.
    """
    parts = (_instructions(code), code.co_varnames, code.co_exceptiontable)
    return hashlib.blake2b(repr(parts).encode(), digest_size=8).hexdigest()


def _instructions(code: types.CodeType) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for instruction in dis.get_instructions(code):
        if instruction.opcode == dis.EXTENDED_ARG:
            continue
        # Where a jump leads is counted from the beginning, its argument from where it stands.
        is_jump = instruction.opcode in dis.hasjrel
        argument = instruction.arg if is_jump else _in_order(instruction.argval)
        if instruction.opname == "STORE_NAME" and argument in _NOTES:
            found.pop()
        else:
            found.append((instruction.opname, argument))
    return found


def _in_order(constant: Any) -> Any:
    """Return a constant of compiled code with its sets sorted, whose order is random."""
    if isinstance(constant, types.CodeType):  # which has a fingerprint of its own
        return constant.co_name
    if isinstance(constant, frozenset):
        return sorted(map(repr, constant))
    return (
        [_in_order(part) for part in constant] if isinstance(constant, tuple | list) else constant
    )


def _content_of(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


@functools.cache
def _is_own(module: str | None) -> bool:
    """Whether a module is the user's or this library's."""
    if module is None:
        return False
    top = module.split(".")[0]
    if top in _LIBRARY or top == "__main__":
        return True
    if top in sys.stdlib_module_names:
        return False
    file = getattr(sys.modules.get(top), "__file__", None)
    return file is None or _INSTALLED.isdisjoint(Path(file).parts)
