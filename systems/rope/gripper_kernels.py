"""Compiled rules of the grippers: how they steer, and where they may move."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.compilation import compiled
from systems.rope.obstacles.signed_distance_kernels import distance
from systems.rope.scene import GRIPPER_CLEARANCE

_ROUNDING = 1e-9


@compiled
def steer_grippers(grippers: Any, targets: Any, longest: float) -> Any:
    """Return the displacements towards targets, shortened to ``longest`` in R^6, shape (n, 6).

    Parameters
    ----------
    grippers : ndarray of shape (n, 6) or wider
        Positions of gripper A and gripper B, metres, in the leading columns.
    targets : ndarray of shape (n, 6)
    longest : float
        Metres.
    """
    commands = np.empty(targets.shape)
    for i in range(targets.shape[0]):
        square = 0.0
        for k in range(6):
            commands[i, k] = targets[i, k] - grippers[i, k]
            square += commands[i, k] * commands[i, k]
        if square > longest * longest:
            scale = longest / np.sqrt(square)
            for k in range(6):
                commands[i, k] *= scale
    return commands


@compiled
def gripper_margin(q: Any, u: Any, bounds: Any, packed: Any) -> float:
    """Distance of grippers at q + u to one another, the world's bounds and obstacles: the least."""
    ax, ay, az = q[0] + u[0], q[1] + u[1], q[2] + u[2]
    bx, by, bz = q[3] + u[3], q[4] + u[4], q[5] + u[5]
    margin = np.sqrt((ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2)
    for k in range(6):
        margin = min(margin, q[k] + u[k] - bounds[0, k], bounds[1, k] - q[k] - u[k])
    margin = min(margin, distance(ax, ay, az, packed))
    return min(margin, distance(bx, by, bz, packed))


@compiled
def gripper_margins(grippers: Any, bounds: Any, packed: Any) -> Any:
    """Return the margin of each row's grippers, shape (n,); see :func:`gripper_margin`."""
    still, margins = np.zeros(6), np.empty(grippers.shape[0])
    for i in range(grippers.shape[0]):
        margins[i] = gripper_margin(grippers[i], still, bounds, packed)
    return margins


@compiled
def allowed_moves(grippers: Any, commands: Any, bounds: Any, packed: Any) -> Any:
    """Say, row by row, whether grippers may move so.

    Afterwards they must be at least ``GRIPPER_CLEARANCE`` away from the obstacles, the bounds and
    one another. Grippers that were nearer before may move if they do not come nearer still.

    Parameters
    ----------
    grippers : ndarray of shape (n, 6) or wider
        Positions of gripper A and gripper B, metres, in the leading columns.
    commands : ndarray of shape (n, 6)
        Their displacements, metres.
    bounds : ndarray of shape (2, 6)
        Lower and upper limits of the positions.
    packed : ndarray of shape (n_rows, 8)

    Returns
    -------
    allowed : ndarray of bool of shape (n,)
    """
    still, allowed = np.zeros(6), np.empty(commands.shape[0], np.bool_)
    for i in range(commands.shape[0]):
        margin = gripper_margin(grippers[i], commands[i], bounds, packed)
        allowed[i] = margin >= GRIPPER_CLEARANCE or (
            margin >= gripper_margin(grippers[i], still, bounds, packed) - _ROUNDING
        )
    return allowed
