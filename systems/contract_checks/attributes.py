"""Checks of a system's attributes and of its pickling."""

from __future__ import annotations

import pickle

import numpy as np

from systems.contract_checks.calls import fail
from systems.errors import SystemContractError
from systems.system import System
from systems.validation import is_integer, is_number


def check_attributes(system: System) -> None:
    """Check the attributes that :class:`systems.System` documents."""
    if not isinstance(system, System):
        raise SystemContractError(f"A system must be a subclass of System, got {system!r}.")
    _check_dimensions(system)
    step = getattr(system, "step_size", None)
    if not is_number(step) or not 0 < step < np.inf:
        fail(system, "step_size", f"must be a positive number, got {step!r}.")
    _check_bounds(system)
    _check_angular(system)


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
            f"must be an array of shape {shape}, the lower limits in the first row and the upper "
            f"ones in the second, got {got}.",
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


def check_pickles(system: System) -> None:
    """Check that a system can be sent to another process."""
    try:
        pickle.loads(pickle.dumps(system))
    except Exception as error:
        raise SystemContractError(
            f"{type(system).__name__} does not pickle ({error}); leave simulators and other "
            "handles out of __getstate__ and start them when they are first needed."
        ) from error
