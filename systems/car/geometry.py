"""Compiled distances between the car and its scene."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.compilation import compiled

Array = NDArray[np.float64]

WHEELBASE = 0.3
CAR_RADIUS = 0.15
# A clearance below this counts as contact. Clearance is checked every 0.01 s of a drive, and
# between two checks the footprint can enter an obstacle's corner by half of this at most.
CONTACT = 1e-3
# Metres that a point of the footprint moves at most in one displacement.
LONGEST_MOTION = 1e4
# Rounding of a displacement that was shortened to one step.
STEP_ALLOWANCE = 1 + 1e-9


class PackedScene(NamedTuple):
    """A scene as arrays, for compiled code.

    Every obstacle is a convex polygon, grown by a radius: a circle is a polygon of one corner.

    Attributes
    ----------
    bounding_circles : ndarray of shape (n_obstacles, 3)
        x, y and radius of a circle that contains the obstacle.
    corners : ndarray of shape (n_obstacles, most_corners, 2)
        x and y of each polygon's corners, counter-clockwise, padded with zeros.
    n_corners : ndarray of int of shape (n_obstacles,)
    grown_by : ndarray of shape (n_obstacles,)
        The radius that each polygon is grown by.
    walls : tuple of float
        x_min, y_min, x_max, y_max.
    """

    bounding_circles: Array
    corners: Array
    n_corners: NDArray[np.int64]
    grown_by: Array
    walls: tuple[float, float, float, float]


@compiled
def clipped(value: float, limit: float) -> float:
    """Return a value limited to [-limit, limit]."""
    return max(-limit, min(limit, value))


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
    """Say whether the segments from a to b and from c to d cross."""
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
        Negative if the segment's first end is inside the polygon: then how deep that end is.
        0 if the segment only crosses the polygon.
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
def scene_distance(ax: float, ay: float, bx: float, by: float, scene: PackedScene) -> float:
    """Return the signed distance of a segment from the nearest obstacle or wall."""
    x_min, y_min, x_max, y_max = scene.walls
    nearest = min(
        min(min(ax, bx) - x_min, x_max - max(ax, bx)),
        min(min(ay, by) - y_min, y_max - max(ay, by)),
    )
    for i in range(scene.corners.shape[0]):
        x, y, radius = scene.bounding_circles[i]
        apart = point_segment_squared(x, y, ax, ay, bx, by)
        reach = nearest + radius
        if reach > 0 and apart > reach * reach:
            continue
        distance = polygon_distance(ax, ay, bx, by, scene.corners[i], scene.n_corners[i])
        nearest = min(nearest, distance - scene.grown_by[i])
    return nearest


@compiled
def clearance(x: float, y: float, heading: float, scene: PackedScene) -> float:
    """Return the distance of the car's footprint from obstacles and walls; negative inside."""
    front_x, front_y = x + WHEELBASE * np.cos(heading), y + WHEELBASE * np.sin(heading)
    return scene_distance(x, y, front_x, front_y, scene) - CAR_RADIUS


@compiled
def clearances(poses: Array, scene: PackedScene) -> Array:
    """Return the clearance of each pose, (n, 3)."""
    distances = np.empty(poses.shape[0])
    for row in range(poses.shape[0]):
        distances[row] = clearance(poses[row, 0], poses[row, 1], poses[row, 2], scene)
    return distances


@compiled
def limited_ways(poses: Array, targets: Array, step_size: float) -> Array:
    """Return displacements towards target poses, at most one step long.

    Parameters
    ----------
    poses, targets : ndarray of shape (n, 3)
        x, y, θ; headings differ by the shorter way around the circle.
    step_size : float

    Returns
    -------
    ways : ndarray of shape (n, 3)
    """
    ways = targets - poses
    for row in range(ways.shape[0]):
        ways[row, 2] = wrap_angle(ways[row, 2])
        length = np.sqrt(ways[row, 0] ** 2 + ways[row, 1] ** 2 + ways[row, 2] ** 2)
        if length > step_size * STEP_ALLOWANCE:
            ways[row] *= step_size / length
    return ways


@compiled
def straight_moves(
    poses: Array, moves: Array, scene: PackedScene
) -> tuple[Array, NDArray[np.bool_]]:
    """Add displacements to poses, and check that the footprint touches nothing on the way.

    Displacements of more than ``LONGEST_MOTION`` are none that a car could make, would be checked
    for ever, and are not free. Along the others, position and heading change in proportion. Each
    check is followed by the longest motion that the clearance there allows, so that no contact is
    missed in between.

    Parameters
    ----------
    poses, moves : ndarray of shape (n, 3)
    scene : PackedScene

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
        # No point of the footprint moves further than this.
        motion = np.sqrt(dx * dx + dy * dy) + WHEELBASE * abs(turn)
        along = 0.0
        free[row] = motion <= LONGEST_MOTION
        while free[row]:
            x, y = poses[row, 0] + along * dx, poses[row, 1] + along * dy
            room = clearance(x, y, poses[row, 2] + along * turn, scene)
            if not room >= CONTACT:
                free[row] = False
                break
            if along >= 1 or room >= CONTACT + (1 - along) * motion:
                break
            # A tenth of the contact distance is added, so that near a wall the advance never
            # shrinks to nothing.
            along = min(1.0, along + (room - 0.9 * CONTACT) / motion)
    return ends, free
