"""The virtual elastic band: the rope pulled taut between the grippers, as a reduced state.

A reduced state is a row of ``reduced_dim(scene)`` numbers: gripper A, gripper B, then the
band's points from A to B, metres in the world frame; the last point fills what remains.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.band_comparison_kernels import (
    compare_rows,
    fill_homotopic,
    fill_lengths,
    fill_resampled,
    fill_square_distances,
)
from systems.band_kernels import propagate_rows, reduce_points
from systems.errors import SimulationDivergedError
from systems.obstacles import Array
from systems.rope_scene import Scene
from systems.validation import as_finite_array

N_MATCHED = 500
# α of the paper, for a distance over 500 matched points.
CLOSE_DISTANCE = 0.5

_WORKSPACE = 640


def max_band_points(scene: Scene) -> int:
    """Return the most points that a band in this scene may have."""
    return 24 + math.ceil(scene.max_band_length / 0.01)


def reduced_dim(scene: Scene) -> int:
    """Return the length of a reduced state in this scene."""
    return 6 + 3 * max_band_points(scene)


def reduce_rope(nodes: Array, grippers: Array, scene: Scene) -> Array:
    """Pull a rope taut within its homotopy class: the paper's r.

    Parameters
    ----------
    nodes : ndarray of shape (n_nodes, 3)
        The rope's centre line, from gripper A to gripper B.
    grippers : ndarray of shape (2, 3)
    scene : Scene

    Returns
    -------
    reduced : ndarray of shape (reduced_dim,)

    Raises
    ------
    SimulationDivergedError
        If the rope passes through an obstacle.

    References
    ----------
    McConachie et al. 2020, "Reduction"; Quinlan 1994.
    """
    nodes = as_finite_array(nodes, "nodes", (None, 3))
    first, last = as_finite_array(grippers, "grippers", (2, 3))
    points = np.vstack([first, nodes, last])
    reduced = np.empty(reduced_dim(scene))
    code = reduce_points(points, scene.packed, np.empty((2, _WORKSPACE, 5)), reduced)
    if code == -1:
        raise SimulationDivergedError("The rope or a gripper passes through an obstacle.")
    if code == -2:
        raise SimulationDivergedError("The rope is too entangled to be pulled taut.")
    return reduced


def propagate_bands(
    reduced: Array, command: Array, scene: Scene
) -> tuple[Array, NDArray[np.bool_]]:
    """Move the ends of bands and let the bands contract: the paper's g.

    Parameters
    ----------
    reduced : ndarray of shape (n, reduced_dim)
    command : ndarray of shape (n, 6)
        Displacements of gripper A and gripper B, metres.
    scene : Scene

    Returns
    -------
    next_reduced : ndarray of shape (n, reduced_dim)
    valid : ndarray of bool of shape (n,)
        False, with the row left as it was, where the band would be overstretched, a gripper
        would be in collision or the band could not be linked to the grippers.

    References
    ----------
    McConachie et al. 2020, "Reduction"; Quinlan 1994.
    """
    next_reduced, valid = np.empty_like(reduced), np.empty(len(reduced), dtype=np.bool_)
    workspace = np.empty((2, _WORKSPACE, 5))
    propagate_rows(
        reduced, command, scene.packed, scene.max_band_length, workspace, next_reduced, valid
    )
    return next_reduced, valid


def bands_close(
    predicted: Array,
    executed: Array,
    scene: Scene,
    *,
    n_matched: int = N_MATCHED,
    alpha: float = CLOSE_DISTANCE,
) -> NDArray[np.bool_]:
    """Say, row by row, whether bands are near one another and of one homotopy class: Close.

    Parameters
    ----------
    predicted, executed : ndarray of shape (n, reduced_dim)
    scene : Scene
    n_matched : int
        Points at which the bands are compared.
    alpha : float
        α for 500 points; it is scaled by sqrt(n_matched / 500), so that it always means the
        same distance from point to point, 2.2 cm in root mean square.

    Returns
    -------
    close : ndarray of bool of shape (n,)

    References
    ----------
    McConachie et al. 2020, "Learning the Classifier".
    """
    close = np.empty(len(predicted), dtype=np.bool_)
    max_square = alpha**2 * n_matched / N_MATCHED
    workspace = np.empty((2, n_matched, 3))
    compare_rows(predicted, executed, scene.packed, max_square, workspace, close)
    return close


def band_distance(reduced: Array, others: Array, n_matched: int = N_MATCHED) -> Array:
    """Euclidean norm of the differences of matched points, row by row: the paper's D.

    Returns
    -------
    distances : ndarray of shape (n,)
        Metres.
    """
    squares = np.empty(len(reduced))
    fill_square_distances(reduced, others, np.empty((2, n_matched, 3)), squares)
    return np.sqrt(squares)


def same_homotopy_class(
    reduced: Array, others: Array, scene: Scene, n_matched: int = N_MATCHED
) -> NDArray[np.bool_]:
    """Say, row by row, whether bands deform into one another along straight ways: FOH.

    Points at the same fraction of the length are matched, and the segments between them must
    be free of obstacles. It is stricter than first-order homotopy, which matches them freely.

    Returns
    -------
    homotopic : ndarray of bool of shape (n,)
    """
    homotopic = np.empty(len(reduced), dtype=np.bool_)
    fill_homotopic(reduced, others, scene.packed, np.empty((2, n_matched, 3)), homotopic)
    return homotopic


def band_points(reduced: Array) -> Array:
    """Return the points of one band, (n_points, 3), without the repeated last one."""
    points = reduced[6:].reshape(-1, 3)
    differs = (points[1:] != points[:-1]).any(axis=1)
    return points[: max(2, int(differs.nonzero()[0].max(initial=0)) + 2)]


def band_length(reduced: Array) -> Array:
    """Return the length of each row's band, metres, shape (n,)."""
    lengths = np.empty(len(reduced))
    fill_lengths(reduced, lengths)
    return lengths


def resample_bands(reduced: Array, n_points: int = N_MATCHED) -> Array:
    """Return evenly spaced points along each row's band, shape (n, n_points, 3)."""
    points = np.empty((len(reduced), n_points, 3))
    fill_resampled(reduced, points)
    return points
