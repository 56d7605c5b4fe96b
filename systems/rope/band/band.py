"""The virtual elastic band: the rope pulled taut between the grippers, as a reduced state.

A band is a row of ``reduced_dim(scene)`` numbers: the positions of gripper A and gripper B, then
the band's points from A to B, in metres in the world frame. The last point is repeated until the
row is full.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.errors import SimulationDivergedError
from systems.rope.band.comparison_kernels import compare_bands
from systems.rope.band.propagation_kernels import IN_OBSTACLE, TOO_MANY_POINTS, reduce_curve
from systems.rope.band.row_kernels import GRIPPERS_WIDTH, fill_lengths
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene
from systems.validation import as_finite_array

# Points at which bands are compared, and the paper's α: the largest norm, in metres, of all their
# differences together.
N_MATCHED = 500
CLOSE_DISTANCE = 0.5

# Points that a band may have: some for what it is bent around, and more the longer it is.
_FEWEST_POINTS = 32
_LENGTH_PER_POINT = 0.05


def max_band_points(scene: Scene) -> int:
    """Return the most points that a band in this scene may have."""
    return _FEWEST_POINTS + math.ceil(scene.max_band_length / _LENGTH_PER_POINT)


def reduced_dim(scene: Scene) -> int:
    """Return the length of a reduced state in this scene."""
    return GRIPPERS_WIDTH + 3 * max_band_points(scene)


def reduce_rope(nodes: Array, grippers: Array, scene: Scene) -> Array:
    """Pull a rope taut without crossing an obstacle, within its homotopy class: the paper's r.

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
    reduced = np.empty(reduced_dim(scene))
    failure = reduce_curve(np.vstack([first, nodes, last]), scene.packed, reduced)
    if failure == IN_OBSTACLE:
        raise SimulationDivergedError("The rope or a gripper passes through an obstacle.")
    if failure == TOO_MANY_POINTS:
        raise SimulationDivergedError("The rope is too entangled to be pulled taut.")
    return reduced


def bands_close(predicted: Array, executed: Array, scene: Scene) -> NDArray[np.bool_]:
    """Say, row by row, whether bands are near one another and of one homotopy class: Close.

    500 points at the same fractions of the bands' lengths are compared. They must be near one
    another, 2.2 cm in root mean square, and the straight segments between them free of obstacles.
    That is stricter than first-order homotopy, which may match points freely.

    Parameters
    ----------
    predicted, executed : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    close : ndarray of bool of shape (n,)

    References
    ----------
    McConachie et al. 2020, "Learning the Classifier"; Jaillet and Simeon 2008.
    """
    predicted = checked_bands(predicted, "predicted", scene)
    executed = checked_bands(executed, "executed", scene, len(predicted))
    close: NDArray[np.bool_] = compare_bands(
        predicted, executed, scene.packed, N_MATCHED, CLOSE_DISTANCE
    )
    return close


def band_length(reduced: Array) -> Array:
    """Return the length of each row's band, metres, shape (n,)."""
    lengths = np.empty(len(reduced))
    fill_lengths(np.ascontiguousarray(reduced), lengths)
    return lengths


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
