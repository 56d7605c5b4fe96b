"""What is installed only on demand: extras of the distribution, and who needs them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

# The extras of setup.cfg, and the modules that each brings.
MODULES = {
    "torch": {"torch", "skorch"},
    "pybullet": {"pybullet"},
    "viewer": {"viser"},
    "examples": {"matplotlib"},
}


@contextmanager
def needing(extra: str, user: str) -> Iterator[None]:
    """Say which extra to install, if an import inside the block finds a module of it missing.

    Parameters
    ----------
    extra : str
        A key of ``MODULES``.
    user : str
        What needs it, as the user knows it.

    Raises
    ------
    ModuleNotFoundError
        If a module of the extra is not installed. Other errors pass as they are.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name not in MODULES[extra]:
            raise
        raise ModuleNotFoundError(
            f"{user} needs {error.name}, which is not installed. "
            f"Install it with: pip install 'transition-reliability[{extra}]'",
            name=error.name,
        ) from error
