"""What the features of a system are called."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from systems.features.default import default_feature_names

if TYPE_CHECKING:
    from systems.system import System

_ATTRIBUTE = "feature_names_out"


class DefaultFeatureNames:
    """The attribute ``feature_names_out`` of a class that does not set it, nor its instances.

    It holds the names of the default features, or None if the class has features of its own.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._owner: Any = owner

    def __get__(self, system: System | None, kind: type | None = None) -> tuple[str, ...] | None:
        if system is None or type(system).features is not self._owner.features:
            return None
        dim = system.configuration_dim
        return default_feature_names(system.reduced_dim, dim, system.angular)


def feature_names(system: System, n_features: int) -> tuple[str, ...] | None:
    """Return the names of a system's features, None if it does not say what they are called.

    Names that a class inherits are not those of features of its own.

    Parameters
    ----------
    system : System
    n_features : int
        How many features it has.

    Raises
    ------
    ValueError
        If ``feature_names_out`` is not a sequence of so many strings, all of them different.
    """
    names = getattr(system, _ATTRIBUTE, None)
    if names is None or _are_of_a_base_class(system):
        return None
    listed = list(names) if isinstance(names, list | tuple | np.ndarray) else []
    if len(listed) != n_features or not all(isinstance(name, str) for name in listed):
        raise ValueError(
            f"{type(system).__name__}.{_ATTRIBUTE} must be a sequence of {n_features} strings, one "
            f"for each column of features, or None; got {_shown(names)}."
        )
    if len(set(listed)) < len(listed):
        twice = next(name for name in listed if listed.count(name) > 1)
        raise ValueError(
            f"{type(system).__name__}.{_ATTRIBUTE} must be different names, got {twice!r} "
            f"{listed.count(twice)} times."
        )
    return tuple(map(str, listed))


def _are_of_a_base_class(system: System) -> bool:
    """Whether the system's class has features of its own, and names for those of a base class."""
    if _ATTRIBUTE in vars(system):
        return False
    first = next(k for k in type(system).__mro__ if vars(k).keys() & {_ATTRIBUTE, "features"})
    return _ATTRIBUTE not in vars(first)


def _shown(names: Any) -> str:
    return f"{len(names)}: {names!r:.200}" if hasattr(names, "__len__") else repr(names)
