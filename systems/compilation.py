"""Compilation of hot loops with numba, whose machine code is kept until a source file changes."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import threading
import warnings
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core.registry import CPUDispatcher

LIBRARY = ("systems", "reliability", "planners")
# numba reads the cache folder from a global variable when a function is decorated.
_one_decoration_at_a_time = threading.Lock()


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function of this library with numba, without the GIL, and cache the machine code.

    numba's own cache checks only the file that a function is in. After a change in another file
    that this file imports constants or functions from, it would still run the old code. Here the
    cache folder is named by a digest of the module's source and of the source of every module of
    this library that it imports, directly or indirectly, so that a change in any of them compiles
    the module anew. Only imports by full module name are followed, as in
    ``from systems.angles import wrap_angle``.

    The cache is placed in the first of these folders that can be written: the one that the
    environment variable ``NUMBA_CACHE_DIR`` names; ``systems/__pycache__``; the user's cache
    folder (``XDG_CACHE_HOME``, by default ``~/.cache``). If none can be written, or if the
    library's sources are not files (in a zip archive, or only .pyc files), nothing is cached and
    every process compiles what it uses.

    Parameters
    ----------
    function : callable
        A function at the top level of a module of this library.
    **options
        Further options of ``numba.njit``, such as ``inline`` and ``fastmath``.

    Returns
    -------
    dispatcher : numba dispatcher, or a decorator if only options are given

    Warns
    -----
    RuntimeWarning
        Once per process, if nothing can be cached.
    """
    if function is None:
        return lambda given: compiled(given, **options)
    dispatcher = _dispatcher(function, options)
    if str(function.__annotations__.get("return")).startswith("tuple"):
        dispatcher.__class__ = _TupleDispatcher
    return dispatcher


def _dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    folder = _cache_folder(function.__module__)
    if folder is None:
        return njit(nogil=True, **options)(function)
    with _one_decoration_at_a_time:
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            return njit(nogil=True, cache=True, **options)(function)
        finally:
            config.CACHE_DIR = before


class _TupleDispatcher(CPUDispatcher):
    """A compiled function that returns a tuple, and which Ctrl-C interrupts as any other.

    numba runs a little Python to make a numpy array of each array that is returned, and Python
    handles signals there. numba then goes on to the tuple's next entry in spite of the
    KeyboardInterrupt, and Python turns that into SystemError, whose cause it becomes.
    """

    def __call__(self, *args: Any) -> Any:
        try:
            return _call(self, *args)
        except SystemError as error:
            cause: BaseException | None = error
            while isinstance(cause, SystemError):
                cause = cause.__cause__
            if cause is None:
                raise
            raise cause from None


_call = CPUDispatcher.__call__


def source_digest(module: str) -> str | None:
    """Return a digest of a module's source and of all that it imports from this library.

    Parameters
    ----------
    module : str
        Its full name, such as "systems.car.dynamics".

    Returns
    -------
    digest : str or None
        16 hexadecimal digits; None if one of the sources is not a file.
    """
    sources: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in sources:
            continue
        source, imported = _source_and_imports(name)
        if source is None:
            return None
        sources[name] = source
        waiting += imported
    total = hashlib.blake2b(digest_size=8)
    for name in sorted(sources):
        total.update(b"%s\0%d\0" % (name.encode(), len(sources[name])) + sources[name])
    return total.hexdigest()


@cache
def _source_and_imports(module: str) -> tuple[bytes | None, list[str]]:
    """Return a module's source and the modules of this library that its top level imports."""
    spec: Any = find_spec(module)
    if not spec.origin.endswith(".py") or not os.path.exists(spec.origin):
        return None, []
    # The names that the top level uses, among them those of imported modules, in full.
    names = spec.loader.get_code(module).co_names
    imported = [name for name in names if name.split(".")[0] in LIBRARY]
    for package in filter(_is_package, imported.copy()):  # as in "from systems import angles"
        inside = [f"{package}.{name}" for name in names if "." not in name]
        imported += filter(find_spec, inside)
    return Path(spec.origin).read_bytes(), imported


def _is_package(module: str) -> bool:
    spec = find_spec(module)
    return spec is not None and spec.submodule_search_locations is not None


@cache
def _cache_folder(module: str) -> Path | None:
    """Return the folder for a module's machine code, and delete those of its older versions."""
    base, digest = _cache_base(), source_digest(module)
    if base is None or digest is None:
        _warn_once()
        return None
    folder = base / f"{module}-{digest}"
    if not folder.exists():
        folder.mkdir(parents=True, exist_ok=True)
        for other in base.glob(f"{module}-*"):
            if other != folder:
                shutil.rmtree(other, ignore_errors=True)
    return folder


@cache
def _cache_base() -> Path | None:
    for candidate in _candidates():
        try:
            candidate.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=candidate):
                return candidate
        except OSError:
            continue
    return None


def _candidates() -> list[Path]:
    library = Path(__file__).resolve().parent
    # Two copies of this library share a user's folders; neither may delete the other's code.
    own = Path("transition-reliability", hashlib.blake2b(bytes(library), digest_size=6).hexdigest())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    shared = [config.CACHE_DIR] if config.CACHE_DIR else []
    candidates = [Path(folder) / own for folder in shared]
    candidates.append(library / "__pycache__" / "numba")
    if os.path.isabs(home):
        candidates.append(Path(home) / own)
    return candidates


@cache
def _warn_once() -> None:
    warnings.warn(
        "Machine code can't be cached, so each process compiles what it uses, which takes a minute "
        "or so. Set NUMBA_CACHE_DIR to a folder that can be written, and install the library as "
        "source files.",
        RuntimeWarning,
        stacklevel=2,
    )
