"""Compiled distances between the car and its scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.compilation import compiled

Array = NDArray[np.float64]

WHEELBASE = 0.3
CAR_RADIUS = 0.15
# Closer than this counts as touching: between two instants of 0.01 s the rounded car can cut a
# corner by half of it at most.
CONTACT = 1e-3


@compiled
def point_segment_squared(
    px: float, py: float, ax: float, ay: float, bx: float, by: float
) -> float:
    """Return the squared distance of a point from a segment."""
    dx, dy = bx - ax, by - ay
    squared = dx * dx + dy * dy
    along = 0.0
    if squared > 0:
        along = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / squared))
    gap_x, gap_y = px - ax - along * dx, py - ay - along * dy
    return gap_x * gap_x + gap_y * gap_y


@compiled
def _crossing(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    one = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    two = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    three = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    four = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return one * two < 0 and three * four < 0


@compiled
def polygon_distance(
    ax: float, ay: float, bx: float, by: float, corners: Array, n_corners: int
) -> float:
    """Return the signed distance of a segment from a convex polygon.

    Parameters
    ----------
    ax, ay, bx, by : float
        The segment's ends, which may coincide.
    corners : ndarray of shape (at least n_corners, 2)
        Counter-clockwise; one corner is a point.
    n_corners : int

    Returns
    -------
    distance : float
        Where the segment's first end is inside, minus that end's depth; where it only crosses, 0.
    """
    squared = np.inf
    outside = -np.inf
    for i in range(n_corners):
        j = i + 1 if i + 1 < n_corners else 0
        cx, cy, dx, dy = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
        squared = min(squared, point_segment_squared(ax, ay, cx, cy, dx, dy))
        squared = min(squared, point_segment_squared(bx, by, cx, cy, dx, dy))
        squared = min(squared, point_segment_squared(cx, cy, ax, ay, bx, by))
        if _crossing(ax, ay, bx, by, cx, cy, dx, dy):
            squared = 0.0
        length = np.sqrt((dx - cx) ** 2 + (dy - cy) ** 2)
        if length > 0:
            side = ((ax - cx) * (dy - cy) - (ay - cy) * (dx - cx)) / length
            outside = max(outside, side)
    if n_corners > 2 and outside < 0:
        return outside
    return np.sqrt(squared)


@compiled
def scene_distance(
    ax: float, ay: float, bx: float, by: float, hulls: Array, corners: Array, walls: Array
) -> float:
    """Return the signed distance of a segment from the nearest obstacle or wall."""
    nearest = min(
        min(min(ax, bx) - walls[0], walls[2] - max(ax, bx)),
        min(min(ay, by) - walls[1], walls[3] - max(ay, by)),
    )
    for i in range(hulls.shape[0]):
        apart = point_segment_squared(hulls[i, 0], hulls[i, 1], ax, ay, bx, by)
        reach = nearest + hulls[i, 2]
        if reach > 0 and apart > reach * reach:
            continue
        distance = polygon_distance(ax, ay, bx, by, corners[i], int(hulls[i, 4])) - hulls[i, 3]
        nearest = min(nearest, distance)
    return nearest


@compiled
def clearance(
    x: float, y: float, heading: float, hulls: Array, corners: Array, walls: Array
) -> float:
    """Return how far the car's footprint is from touching anything; negative inside."""
    front_x, front_y = x + WHEELBASE * np.cos(heading), y + WHEELBASE * np.sin(heading)
    return scene_distance(x, y, front_x, front_y, hulls, corners, walls) - CAR_RADIUS


@compiled
def clearances(poses: Array, hulls: Array, corners: Array, walls: Array) -> Array:
    """Return the clearance of each pose, (n, 3)."""
    distances = np.empty(poses.shape[0])
    for row in range(poses.shape[0]):
        x, y, heading = poses[row, 0], poses[row, 1], poses[row, 2]
        distances[row] = clearance(x, y, heading, hulls, corners, walls)
    return distances


@compiled
def limited_ways(poses: Array, targets: Array, step_size: float) -> Array:
    """Return the displacements towards poses, the short way round and of at most one step.

    Parameters
    ----------
    poses, targets : ndarray of shape (n, 3)
    step_size : float
    """
    ways = targets - poses
    for row in range(ways.shape[0]):
        ways[row, 2] = wrap_angle(ways[row, 2])
        length = np.sqrt(ways[row, 0] ** 2 + ways[row, 1] ** 2 + ways[row, 2] ** 2)
        # The allowance lets transitions that were cut to one step arrive exactly.
        if length > step_size * (1 + 1e-9):
            ways[row] *= step_size / length
    return ways


@compiled
def straight_moves(
    poses: Array, moves: Array, hulls: Array, corners: Array, walls: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Add displacements to poses, and tell whether the footprint touches nothing on the way.

    Advances by as much as the clearance allows, so nothing is missed between samples.

    Parameters
    ----------
    poses, moves : ndarray of shape (n, 3)

    Returns
    -------
    ends : ndarray of shape (n, 3)
        Headings in [-π, π).
    free : ndarray of bool of shape (n,)
    """
    ends = np.empty_like(poses)
    free = np.empty(poses.shape[0], np.bool_)
    for row in range(poses.shape[0]):
        dx, dy, turn = moves[row, 0], moves[row, 1], moves[row, 2]
        ends[row, 0] = poses[row, 0] + dx
        ends[row, 1] = poses[row, 1] + dy
        ends[row, 2] = wrap_angle(poses[row, 2] + turn)
        motion = np.sqrt(dx * dx + dy * dy) + WHEELBASE * abs(turn)
        along = 0.0
        free[row] = True
        while True:
            x, y = poses[row, 0] + along * dx, poses[row, 1] + along * dy
            room = clearance(x, y, poses[row, 2] + along * turn, hulls, corners, walls)
            if not room >= CONTACT:
                free[row] = False
                break
            if along >= 1 or room >= CONTACT + (1 - along) * motion:
                break
            # A tenth of the contact distance keeps the advance from stalling at a wall.
            along = min(1.0, along + (room - 0.9 * CONTACT) / motion)
    return ends, free
