"""The virtual elastic band: the rope pulled taut between the grippers, as a reduced state.

A reduced state is a row of ``reduced_dim(scene)`` numbers: gripper A, gripper B, then the
band's points from A to B, metres in the world frame; the last point fills what remains.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.errors import SimulationDivergedError
from systems.rope.band.comparison_kernels import (
    compare_rows,
    fill_lengths,
    fill_resampled,
)
from systems.rope.band.propagation_kernels import propagate_rows, reduce_points
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene
from systems.validation import as_finite_array

N_MATCHED = 500
# α of the paper, for a distance over 500 matched points.
CLOSE_DISTANCE = 0.5

# Two chains of points, for the kernels to work in.
WORKSPACE_SHAPE = (2, 640, 5)


def max_band_points(scene: Scene) -> int:
    """Return the most points that a band in this scene may have."""
    return 32 + math.ceil(scene.max_band_length / 0.05)


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
    code = reduce_points(points, scene.packed, np.empty(WORKSPACE_SHAPE), reduced)
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
    reduced = checked_bands(reduced, "reduced", scene)
    command = np.ascontiguousarray(as_finite_array(command, "command", (len(reduced), 6)))
    next_reduced, valid = np.empty_like(reduced), np.empty(len(reduced), dtype=np.bool_)
    workspace = np.empty(WORKSPACE_SHAPE)
    propagate_rows(
        reduced, command, scene.packed, scene.max_band_length, workspace, next_reduced, valid
    )
    return next_reduced, valid


def bands_close(
    predicted: Array, executed: Array, scene: Scene, n_matched: int = N_MATCHED
) -> NDArray[np.bool_]:
    """Say, row by row, whether bands are near one another and of one homotopy class: Close.

    Parameters
    ----------
    predicted, executed : ndarray of shape (n, reduced_dim)
    scene : Scene
    n_matched : int
        Points at which the bands are compared. α is scaled by sqrt(n_matched / 500), so that
        it always means the same: 2.2 cm from point to point, in root mean square.

    Returns
    -------
    close : ndarray of bool of shape (n,)

    References
    ----------
    McConachie et al. 2020, "Learning the Classifier".
    """
    alpha = CLOSE_DISTANCE * math.sqrt(n_matched / N_MATCHED)
    return _compare(predicted, executed, scene, n_matched, alpha)


def same_homotopy_class(reduced: Array, others: Array, scene: Scene) -> NDArray[np.bool_]:
    """Say, row by row, whether bands deform into one another along straight ways: FOH.

    500 points at the same fractions of the length are matched, and the segments between them
    must be free of obstacles. It is stricter than first-order homotopy, which matches them
    freely.

    Parameters
    ----------
    reduced, others : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    homotopic : ndarray of bool of shape (n,)

    References
    ----------
    McConachie et al. 2020, "Learning the Classifier"; Jaillet and Simeon 2008.
    """
    return _compare(reduced, others, scene, N_MATCHED, math.inf)


def band_distance(reduced: Array, others: Array, n_matched: int = N_MATCHED) -> Array:
    """Euclidean norm of the differences of matched points, row by row: the paper's D.

    Parameters
    ----------
    reduced, others : ndarray of shape (n, reduced_dim)
    n_matched : int
        Points, evenly spaced along each band.

    Returns
    -------
    distances : ndarray of shape (n,)
        Metres.
    """
    differences = resample_bands(reduced, n_matched) - resample_bands(others, n_matched)
    return np.linalg.norm(differences.reshape(len(differences), -1), axis=1)


def resample_bands(reduced: Array, n_points: int = N_MATCHED) -> Array:
    """Return evenly spaced points along each row's band, shape (n, n_points, 3)."""
    points = np.empty((len(reduced), n_points, 3))
    fill_resampled(np.ascontiguousarray(reduced), points)
    return points


def band_length(reduced: Array) -> Array:
    """Return the length of each row's band, metres, shape (n,)."""
    lengths = np.empty(len(reduced))
    fill_lengths(np.ascontiguousarray(reduced), lengths)
    return lengths


def band_points(reduced: Array) -> Array:
    """Return the points of one band, (n_points, 3), without the repeated last one."""
    points = reduced[6:].reshape(-1, 3)
    differs = (points[1:] != points[:-1]).any(axis=1)
    return points[: max(2, int(differs.nonzero()[0].max(initial=0)) + 2)]


def gripper_separation(reduced: Array) -> Array:
    """Return how far apart the grippers of each row are, metres, shape (n,)."""
    return np.linalg.norm(reduced[:, 3:6] - reduced[:, :3], axis=1)


def checked_bands(rows: Array, name: str, scene: Scene, n_rows: int | None = None) -> Array:
    """Return rows as the kernels read them.

    Raises
    ------
    ValueError
        If they are no bands of the scene, not ``n_rows`` of them, or not finite.
    """
    # A copy is made only of rows that the kernels could not read.
    return np.ascontiguousarray(as_finite_array(rows, name, (n_rows, reduced_dim(scene))))


def _compare(
    reduced: Array, others: Array, scene: Scene, n_matched: int, max_distance: float
) -> NDArray[np.bool_]:
    reduced = checked_bands(reduced, "reduced", scene)
    others = checked_bands(others, "others", scene)
    if len(reduced) != len(others):
        raise ValueError(f"Give as many bands as others, got {len(reduced)} and {len(others)}.")
    close = np.empty(len(reduced), dtype=np.bool_)
    workspace = np.empty((2, n_matched, 3))
    compare_rows(reduced, others, scene.packed, max_distance**2, workspace, close)
    return close
