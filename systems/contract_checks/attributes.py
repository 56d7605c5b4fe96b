"""Checks of a system's attributes."""

from __future__ import annotations

import numpy as np

from systems.contract_checks.calls import fail
from systems.errors import SystemContractError
from systems.system import System
from systems.validation import is_integer, is_number


def check_attributes(system: System) -> None:
    """Check the attributes that :class:`systems.System` documents."""
    if not isinstance(system, System):
        raise SystemContractError(f"system must be a System (subclass it), got {system!r}.")
    _check_dimensions(system)
    step = getattr(system, "step_size", None)
    if not is_number(step) or not 0 < step < np.inf:
        fail(system, "step_size", f"must be a positive number, got {step!r}.")
    _check_bounds(system)
    _check_angular(system)
    _check_independent_parts(system)


def _check_dimensions(system: System) -> None:
    for name in ("reduced_dim", "configuration_dim"):
        value = getattr(system, name, None)
        if not is_integer(value) or value < 1:
            fail(system, name, f"must be a positive integer, got {value!r}.")
    if system.configuration_dim > system.reduced_dim:
        fail(
            system,
            "configuration_dim",
            f"must be at most reduced_dim = {system.reduced_dim}, because the configuration is the "
            f"first part of the reduced state; got {system.configuration_dim}.",
        )


def _check_bounds(system: System) -> None:
    bounds, shape = getattr(system, "bounds", None), (2, system.configuration_dim)
    if not isinstance(bounds, np.ndarray) or bounds.shape != shape or bounds.dtype.kind not in "fi":
        got = f"the shape {bounds.shape}" if isinstance(bounds, np.ndarray) else repr(bounds)
        fail(
            system,
            "bounds",
            f"must be a numpy array of shape {shape}, the lower limits in the first row and the "
            f"upper ones in the second, got {got}.",
        )
    low, high = bounds
    if not (np.isfinite(low) & np.isfinite(high) & (low < high)).all():
        fail(system, "bounds", f"must be finite, lower < upper, got {low} and {high}.")


def _check_angular(system: System) -> None:
    angular, dim = system.angular, system.configuration_dim
    indices = isinstance(angular, tuple) and all(map(is_integer, angular))
    if not indices or len(set(angular)) < len(angular) or not set(angular) <= set(range(dim)):
        fail(
            system,
            "angular",
            f"must be a tuple of different indices from 0 to {dim - 1}, got {angular!r}.",
        )
    limits = system.bounds[:, list(angular)]
    if (np.abs(limits) > np.pi).any():
        fail(system, "bounds", f"must lie in [-π, π] for angles, got {limits.tolist()}.")


def _check_independent_parts(system: System) -> None:
    parts, dim = system.independent_parts, system.configuration_dim
    slices = isinstance(parts, tuple) and all(isinstance(part, slice) for part in parts)
    if not slices or not all(_lies_within(part, dim) for part in parts):
        fail(
            system,
            "independent_parts",
            f"must be a tuple of slices of the {dim} entries of a configuration, such as "
            f"(slice(0, 3), slice(3, 6)), or () if there are none, got {parts!r}.",
        )


def _lies_within(part: slice, dim: int) -> bool:
    ends = [end for end in (part.start, part.stop) if end is not None]
    fits = all(is_integer(end) and -dim <= end <= dim for end in ends)
    return fits and part.step in (None, 1) and len(range(dim)[part]) > 0
