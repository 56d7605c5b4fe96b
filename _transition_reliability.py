"""Whether the packages that Python finds are this distribution's, which each of them asks first.

Their names are so plain that other distributions, and folders of users, have them as well.
"""

from __future__ import annotations

import importlib.util
from importlib.machinery import ModuleSpec
from pathlib import Path

PACKAGES = ("systems", "reliability", "planners")
# Each package's __init__.py imports this module, by which it is known.
_MARK = "_transition_reliability"


def check_packages(home: Path) -> None:
    """Raise ``ImportError`` if a package is another's, or shares its folder with another's.

    Parameters
    ----------
    home : Path
        The folder that holds the packages of this distribution.
    """
    for name in PACKAGES:
        spec = importlib.util.find_spec(name)
        found = _place(spec)
        if spec is None or found != (home / name).resolve():
            raise ImportError(
                f"transition-reliability needs its own package {name!r} in {home / name}, and "
                f"Python finds {found or 'none'}. Rename or move that one, uninstall the "
                "distribution that it belongs to, or use an environment for each."
            )
        if not _is_marked(spec, name):
            raise ImportError(
                f"{home / name / '__init__.py'} is not that of transition-reliability: another "
                f"distribution has overwritten or removed it. {_REMEDY}"
            )
        for other in home.glob(f"{name}-*.dist-info"):
            if _brings(other, name):
                raise ImportError(
                    f"{other.stem} puts files into {home / name}, which is a package of "
                    f"transition-reliability as well. {_REMEDY}"
                )


_REMEDY = (
    "Both can't be in one environment: uninstall both, and then install transition-reliability "
    "again, or make an environment for each."
)


def _place(spec: ModuleSpec | None) -> Path | None:
    """Return the folder of a package, or the file of a module."""
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or [])
    place = folders[0] if folders else spec.origin
    return None if place is None else Path(place).resolve()


def _is_marked(spec: ModuleSpec, name: str) -> bool:
    get_source = getattr(spec.loader, "get_source", None)
    source = get_source(name) if get_source else ""
    # Where programs are packed into one file, there is no source to look at.
    return source is None or _MARK in source


def _brings(distribution: Path, name: str) -> bool:
    record = distribution / "RECORD"
    return record.exists() and f"\n{name}/" in "\n" + record.read_text(encoding="utf-8")


check_packages(Path(__file__).parent)
