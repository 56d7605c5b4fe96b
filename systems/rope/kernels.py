"""Compiled steering and g of the rope, grippers before bands."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.band.propagation_kernels import propagate_row
from systems.rope.obstacles.signed_distance_kernels import distance

_ROUNDING = 1e-9


@compiled
def steer_rows(rows: Any, targets: Any, longest: float, out: Any) -> None:
    """Write the displacements of grippers towards targets, shortened to ``longest`` in R^6."""
    for i in range(rows.shape[0]):
        square = 0.0
        for k in range(6):
            out[i, k] = targets[i, k] - rows[i, k]
            square += out[i, k] * out[i, k]
        if square > longest * longest:
            scale = longest / np.sqrt(square)
            for k in range(6):
                out[i, k] *= scale


@compiled
def gripper_margin(q: Any, u: Any, bounds: Any, packed: Any) -> float:
    """Distance of grippers at q + u to one another, the bounds and obstacles: the least."""
    ax, ay, az = q[0] + u[0], q[1] + u[1], q[2] + u[2]
    bx, by, bz = q[3] + u[3], q[4] + u[4], q[5] + u[5]
    margin = np.sqrt((ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2)
    for k in range(6):
        margin = min(margin, q[k] + u[k] - bounds[0, k], bounds[1, k] - q[k] - u[k])
    margin = min(margin, distance(ax, ay, az, packed))
    return min(margin, distance(bx, by, bz, packed))


@compiled
def fill_margins(rows: Any, bounds: Any, packed: Any, margins: Any) -> None:
    """Write the margin of each row's grippers."""
    still = np.zeros(6)
    for i in range(rows.shape[0]):
        margins[i] = gripper_margin(rows[i], still, bounds, packed)


@compiled
def length_between(grippers: Any, nodes: Any) -> float:
    """Length from the first gripper along the nodes to the second."""
    total, x, y, z = 0.0, grippers[0, 0], grippers[0, 1], grippers[0, 2]
    for i in range(nodes.shape[0] + 1):
        end = nodes[i] if i < nodes.shape[0] else grippers[1]
        total += np.sqrt((end[0] - x) ** 2 + (end[1] - y) ** 2 + (end[2] - z) ** 2)
        x, y, z = end[0], end[1], end[2]
    return total


@compiled
def all_finite(rows: Any) -> bool:
    """Say whether rows hold no NaN and no infinity."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            if not np.isfinite(rows[i, k]):
                return False
    return True


@compiled
def propagate_rope_rows(
    rows: Any,
    commands: Any,
    bounds: Any,
    packed: Any,
    clearance: float,
    max_length: float,
    workspace: Any,
    out: Any,
    valid: Any,
) -> None:
    """Write g of each row and command; invalid rows are copied.

    Grippers that are nearer to something than ``clearance`` may not come nearer still.
    """
    still = np.zeros(6)
    for i in range(rows.shape[0]):
        margin = gripper_margin(rows[i], commands[i], bounds, packed)
        valid[i] = margin >= clearance or (
            margin >= gripper_margin(rows[i], still, bounds, packed) - _ROUNDING
        )
        if valid[i]:
            valid[i] = propagate_row(
                rows[i], commands[i], packed, max_length, workspace[0], workspace[1], out[i]
            )
        else:
            out[i] = rows[i]
