"""Checks of a system's reduced model: r, g, steering, Close and features."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.angles import shortest_way
from systems.contract_checks.calls import (
    call,
    call_twice,
    call_with_zero_rows,
    check_array,
    check_booleans,
    check_rowwise,
    check_zero_rows,
    fail,
)
from systems.errors import SystemContractError
from systems.features.names import feature_names
from systems.system import Array, System

Mask = NDArray[np.bool_]
# What rounding may add to a step, and by how much a command may miss a configuration.
LONGEST_STEP = 1 + 1e-6
LARGEST_MISS = 1e-6


def check_reduce(system: System, state: Any) -> Array:
    """Check ``reduce``, and return the reduced state."""
    reduced = call_twice(system, "reduce", state)
    check_array(system, "reduce", reduced, (system.reduced_dim,))
    _check_angles(system, "reduce", reduced)
    return reduced


def check_steer(system: System, reduced: Array, targets: Array) -> Array:
    """Check the shape of what ``steer`` returns, and return the commands."""
    command = call_twice(system, "steer", reduced, targets)
    if not isinstance(command, np.ndarray) or command.ndim != 2 or len(command) != len(reduced):
        shape = np.shape(command)
        fail(system, "steer", f"must return one command per row, (n, command_dim), got {shape}.")
    check_array(system, "steer", command, command.shape)
    check_rowwise(system, "steer", reduced, targets)
    none = call_with_zero_rows(system, "steer", reduced, targets)
    check_zero_rows(system, "steer", none, (0, command.shape[1]))
    return command


def check_propagate(system: System, reduced: Array, command: Array) -> tuple[Array, Mask]:
    """Check ``propagate``, and return what it returned."""
    result = call_twice(system, "propagate", reduced, command)
    if not isinstance(result, tuple) or len(result) != 2:
        fail(system, "propagate", f"must return (next_reduced, valid), got {result!r}.")
    next_reduced, valid = result
    check_booleans(system, "propagate", valid, len(reduced))
    if not isinstance(next_reduced, np.ndarray) or next_reduced.shape != reduced.shape:
        fail(
            system,
            "propagate",
            f"must return next_reduced of shape {reduced.shape}, got {np.shape(next_reduced)}.",
        )
    check_array(system, "propagate", next_reduced[valid], (valid.sum(), system.reduced_dim))
    _check_angles(system, "propagate", next_reduced[valid])
    check_rowwise(system, "propagate", reduced[valid], command[valid])
    none = call_with_zero_rows(system, "propagate", reduced, command)
    if not isinstance(none, tuple) or len(none) != 2:
        fail(system, "propagate", f"must answer zero rows with zero rows, got {none!r}.")
    check_zero_rows(system, "propagate", none[0], (0, system.reduced_dim))
    check_zero_rows(system, "propagate", none[1], (0,))
    return next_reduced, valid


def _check_angles(system: System, method: str, reduced: Array) -> None:
    angles = reduced[..., list(system.angular)]
    outside = (angles < -np.pi) | (angles >= np.pi)
    if outside.any():
        fail(
            system,
            method,
            f"must return angles in [-π, π), got {angles[outside][0]:.6g}; "
            "systems.wrap_columns brings them there.",
        )


def check_steps(system: System, reduced: Array, next_reduced: Array) -> None:
    """Check that steering moves by one step at most, and exactly to what is within one step."""
    dim = system.configuration_dim
    moved = next_reduced[:, :dim]
    lengths = np.linalg.norm(shortest_way(reduced[:, :dim], moved, system.angular), axis=1)
    if (lengths > system.step_size * LONGEST_STEP).any():
        fail(
            system,
            "steer",
            f"commanded a motion of {lengths.max():.6g}, more than step_size = "
            f"{system.step_size:.6g}.",
        )
    command = call(system, "steer", reduced, moved)
    arrived, valid = call(system, "propagate", reduced, command)
    gap = np.abs(shortest_way(arrived[valid, :dim], moved[valid], system.angular))
    if (gap > LARGEST_MISS).any():
        fail(
            system,
            "steer",
            f"misses a configuration within one step by {gap.max():.3g}; the command must lead "
            "to it exactly under propagate.",
        )


def check_close(system: System, reduced: Array, next_reduced: Array) -> None:
    """Check ``close``."""
    close = call_twice(system, "close", reduced, next_reduced)
    check_booleans(system, "close", close, len(reduced))
    if not call(system, "close", reduced, reduced).all():
        fail(system, "close", "says that a reduced state is not close to itself.")
    none = call_with_zero_rows(system, "close", reduced, next_reduced)
    check_zero_rows(system, "close", none, (0,))


def check_features(system: System, reduced: Array, next_reduced: Array) -> None:
    """Check ``features``, of many transitions and of none, and what they are called."""
    rows = call_twice(system, "features", reduced, next_reduced)
    if not isinstance(rows, np.ndarray) or rows.ndim != 2 or len(rows) != len(reduced):
        fail(system, "features", f"must return a row per transition, got {np.shape(rows)}.")
    if rows.dtype.kind not in "fiub" or not np.isfinite(rows).all():
        fail(system, "features", f"must return finite numbers, got {rows.dtype}: {rows[0]}.")
    check_rowwise(system, "features", reduced, next_reduced)
    none = call_with_zero_rows(system, "features", reduced, next_reduced)
    check_zero_rows(system, "features", none, (0, rows.shape[1]))
    try:
        feature_names(system, rows.shape[1])
    except ValueError as error:
        raise SystemContractError(str(error)) from error
