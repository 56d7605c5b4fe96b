"""Plain ways to read the rope's states, for its tests."""

from __future__ import annotations

import numpy as np

from systems.rope.band.band import N_MATCHED
from systems.rope.band.row_kernels import GRIPPERS_WIDTH, resample_row
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.slack.pbd_ropes import KINDS


def polyline_length(points):
    """Length of a polyline, points in the last axis but one."""
    return np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)


def plain_resample(points, n):
    """Points evenly spaced along a polyline, shape (n, 3)."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, arc[-1], n)
    return np.stack([np.interp(at, arc, points[:, axis]) for axis in range(3)], axis=1)


def band_points(row):
    """Points of one band, shape (n_points, 3), without the repeats of the last one."""
    points = row[GRIPPERS_WIDTH:].reshape(-1, 3)
    differs = (points[1:] != points[:-1]).any(axis=1)
    return points[: max(2, int(differs.nonzero()[0].max(initial=0)) + 2)]


def resample_bands(rows, n=N_MATCHED):
    """Points evenly spaced along each row's band by the compiled loop, shape (n_rows, n, 3)."""
    resampled = np.empty((len(rows), n, 3))
    for row, points in zip(np.ascontiguousarray(rows), resampled, strict=True):
        resample_row(row, points)
    return resampled


def pbd_nodes(ropes, grippers):
    """Nodes of one row's PBD ropes with the grippers, shape (n_ropes, n_nodes, 3)."""
    inner = ropes.reshape(len(KINDS), 2, -1, 3)[:, 0]
    first, last = np.reshape(grippers, (2, 1, 1, 3)).repeat(len(KINDS), axis=1)
    return np.concatenate([first, inner, last], axis=1)


def slow_margin(scene, grippers):
    """Distance of grippers, (2, 3), to obstacles, bounds and one another: the least."""
    inside = min((grippers - scene.bounds[0]).min(), (scene.bounds[1] - grippers).min())
    apart = np.linalg.norm(grippers[0] - grippers[1])
    return min(inside, apart, signed_distance(grippers, scene.packed).min())
