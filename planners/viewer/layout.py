"""Where panels stand beside one another, and where the camera stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.viewer.panel import Panel
from systems.drawing.shapes import BoxShape, CylinderShape, MeshShape, Shape, SphereShape, TubeShape
from systems.system import Array

FIELD_OF_VIEW = math.radians(35)
_GAP = 1.08
_MARGIN = 1.06
_MOST_IN_ONE_ROW = 3
_LEAST_EXTENT = 1e-3


@dataclass(frozen=True, eq=False)
class Layout:
    """Where everything stands.

    Attributes
    ----------
    offsets : ndarray of shape (n_panels, 3)
        What each panel is moved by.
    labels : ndarray of shape (n_panels, 3)
        Where the names of the panels stand, before they are moved.
    camera, look_at : ndarray of shape (3,)
    size : float
        Metres from one end of a panel to the other.
    """

    offsets: Array
    labels: Array
    camera: Array
    look_at: Array
    size: float


def lay_out(panels: Sequence[Panel], view_from: Sequence[float], width_per_height: float) -> Layout:
    """Set panels side by side, as seen from a direction, and the camera so that it sees all.

    Parameters
    ----------
    panels : sequence of Panel
    view_from : sequence of three floats
    width_per_height : float
        Of the part of the window in which the scene is shown; in narrower ones it is cut off.
    """
    right, up, towards = axes = _camera_axes(view_from)
    clouds = [_corners(panel) for panel in panels]
    seen = np.array(
        [[(cloud @ axes.T).min(axis=0), (cloud @ axes.T).max(axis=0)] for cloud in clouds]
    )
    width, height, _ = np.maximum((seen[:, 1] - seen[:, 0]).max(axis=0), _LEAST_EXTENT)
    n_columns = len(panels) if len(panels) <= _MOST_IN_ONE_ROW else math.ceil(len(panels) ** 0.5)
    rows, columns = np.divmod(np.arange(len(panels)), n_columns)
    offsets = _GAP * (columns[:, None] * width * right - rows[:, None] * height * up)
    middles = seen.mean(axis=1)
    labels = middles[:, :1] * right + seen[:, 0, 1:2] * up + middles[:, 2:] * towards
    everything = np.concatenate(
        [cloud + offset for cloud, offset in zip(clouds, offsets, strict=True)]
    )
    camera, look_at = _camera(everything @ axes.T, axes, width_per_height)
    size = float(np.linalg.norm(np.ptp(np.concatenate(clouds), axis=0)))
    return Layout(offsets, labels, camera, look_at, max(size, _LEAST_EXTENT))


def _camera_axes(view_from: Sequence[float]) -> Array:
    """Return the camera's right, up and backward directions as rows."""
    towards = np.asarray(view_from, dtype=np.float64) / np.linalg.norm(view_from)
    right = np.cross([0.0, 0.0, 1.0], towards)
    if np.linalg.norm(right) < _LEAST_EXTENT:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(towards, right), towards])


def _camera(seen: Array, axes: Array, width_per_height: float) -> tuple[Array, Array]:
    """Return the nearest place from which points, (n, 3) in camera axes, are in sight."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = (low + high) / 2
    vertical = math.tan(FIELD_OF_VIEW / 2) / _MARGIN
    x, y, z = (seen - middle).T
    distance = np.max(
        z + np.maximum(np.abs(x) / (vertical * width_per_height), np.abs(y) / vertical)
    )
    look_at = middle @ axes
    return look_at + max(float(distance), _LEAST_EXTENT) * axes[2], look_at


def _corners(panel: Panel) -> Array:
    """Return points around everything that a panel shows, (n, 3)."""
    moving = [shape for shapes in (*panel.planned, *panel.executed) for shape in shapes]
    clouds = [_extent(shape) for shape in (*panel.scene, *panel.goal, *moving)]
    paths = (panel.planned_path.points, panel.executed_path.points, panel.tree)
    points = np.concatenate([*clouds, *(path.reshape(-1, 3) for path in paths), panel.goal_points])
    if not len(points):
        return np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T


def _extent(shape: Shape) -> Array:
    """Return points around a shape, (n, 3)."""
    if isinstance(shape, TubeShape):
        return np.concatenate([shape.points - shape.radius, shape.points + shape.radius])
    if isinstance(shape, SphereShape):
        return shape.position + np.outer([-1.0, 1.0], np.full(3, shape.radius))
    if isinstance(shape, MeshShape):
        return shape.position + shape.vertices @ shape.rotation.T
    half = _half_extents(shape)
    corners = half * (np.array(list(np.ndindex(2, 2, 2))) * 2 - 1)
    return shape.position + corners @ shape.rotation.T


def _half_extents(shape: BoxShape | CylinderShape) -> Array:
    if isinstance(shape, BoxShape):
        return shape.half_extents
    return np.array([shape.radius, shape.radius, shape.half_length])
