"""Compiling hot loops with numba, kept on disk for as long as their sources stay the same."""

from __future__ import annotations

import hashlib
import os
import re
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

_IMPORT = re.compile(r"^\s*(?:from|import)\s+((?:systems|reliability|planners)[\w.]*)", re.M)
# numba reads the folder from a variable of the process when a function is decorated.
_one_at_a_time = threading.Lock()


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function with numba, without the GIL, and keep the machine code on disk.

    Numba alone looks only at the file of the function itself, and would go on running old code
    after a change in a file that this one imports. Here machine code is kept under a digest of the
    module and of all modules of this library that it imports, directly or not.

    The code is kept in the folder that the environment variable ``NUMBA_CACHE_DIR`` names, else
    beside the library, else in the user's cache folder (``XDG_CACHE_HOME`` or ``~/.cache``),
    whichever can be written first. Where none can, every process compiles anew, and a warning says
    so once.

    Parameters
    ----------
    function : callable
        A function of a module of this library.
    **options
        Further options of ``numba.njit``, such as ``inline`` and ``fastmath``.

    Returns
    -------
    dispatcher : numba dispatcher, or a decorator if only options are given

    Warns
    -----
    RuntimeWarning
        Once per process, where no folder for machine code can be written.
    """
    if function is None:
        return lambda given: compiled(given, **options)
    folder = _code_folder(function.__module__)
    if folder is None:
        return njit(nogil=True, **options)(function)
    with _one_at_a_time:
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            return njit(nogil=True, cache=True, **options)(function)
        finally:
            config.CACHE_DIR = before


@cache
def _code_folder(module: str) -> Path | None:
    """Return the folder for a module's machine code, emptied of what older sources gave."""
    base = _writable_base()
    if base is None:
        return None
    folder = base / f"{module}-{source_digest(module)}"
    if not folder.exists():
        for outdated in base.glob(f"{module}-*"):
            shutil.rmtree(outdated, ignore_errors=True)
        folder.mkdir(exist_ok=True)
    return folder


def source_digest(module: str) -> str:
    """Return a digest of a module's source and of all that it imports from this library.

    Parameters
    ----------
    module : str
        Its dotted name.

    Returns
    -------
    digest : str
        16 hexadecimal digits.
    """
    seen: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen[name] = _source(name)
        waiting += _IMPORT.findall(seen[name].decode())
    total = hashlib.blake2b(digest_size=8)
    for name in sorted(seen):
        total.update(name.encode() + b"\0" + seen[name] + b"\0")
    return total.hexdigest()


@cache
def _source(module: str) -> bytes:
    try:
        spec = find_spec(module)
    except ModuleNotFoundError:  # a name inside a module, as in "import systems.angles.wrap"
        return b""
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return b""
    return Path(spec.origin).read_bytes()


@cache
def _writable_base() -> Path | None:
    for candidate in _bases():
        try:
            candidate.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=candidate):
                return candidate
        except OSError:
            continue
    warnings.warn(
        "Compiled code can't be kept, as no folder for it can be written, so each process compiles "
        "anew, which takes a minute or so. Set NUMBA_CACHE_DIR to a folder that can be written.",
        RuntimeWarning,
        stacklevel=2,
    )
    return None


def _bases() -> list[Path]:
    library = Path(__file__).resolve().parent
    name = "transition-reliability"
    if config.CACHE_DIR:
        return [Path(config.CACHE_DIR) / name]
    bases = [library / "__pycache__" / "numba"]
    # Several copies of the library must not take turns in throwing out one another's code.
    place = hashlib.blake2b(bytes(library), digest_size=6).hexdigest()
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if os.path.isabs(home):
        bases.append(Path(home) / name / place)
    return bases
