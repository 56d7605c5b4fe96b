"""Features of rope transitions that see what hangs below the band."""

from __future__ import annotations

import numpy as np

from systems.band import band_length, checked_bands, gripper_separation
from systems.obstacles import Array
from systems.rope_curtain_kernels import N_COLUMNS, N_ROWS, fill_curtains
from systems.rope_scene import STEP_SIZE, Scene

_LEAST_SPAN = 1e-6


def curtain_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions by the obstacles between the band and the rope that hangs below it.

    The band forgets how the rope hangs, and yet the length of the rope implies it: below the
    band, as deep as the slack lets it. What catches the rope goes through this curtain. Before
    and after the transition, the signed distance to the obstacles is taken on a grid of 16
    columns along the band by 8 rows from the band down to a little below the rope, clipped to
    -0.05 and 0.15 m, in units of 0.05 m. Then come the distance between the grippers, the
    length of the band, the rise from gripper A to B and the depth of the rope, as shares of the
    rope's length, before and after; and the motion of the grippers in steps of 0.025 m: along
    the horizontal direction from A to B, across it, and up. The features are the same wherever
    the scene is put and however it is turned about the vertical.

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    X : ndarray of float32 of shape (n, 270)
    """
    before = checked_bands(reduced, "reduced", scene)
    after = checked_bands(next_reduced, "next_reduced", scene, len(before))
    rows = [_curtains(before, scene), _curtains(after, scene), _motion(before, after)]
    return np.hstack(rows).astype(np.float32)


def mirrored(features: Array) -> Array:
    """Return the features of the same transitions in a mirror that stands along the rope."""
    image = features.copy()
    image[:, [-5, -2]] *= -1.0
    return image


def reversed_ends(features: Array) -> Array:
    """Return the features of the same transitions with the names of the grippers exchanged."""
    image = features.copy()
    n_cells = N_COLUMNS * N_ROWS
    for first in (0, n_cells + 4):
        cells = features[:, first : first + n_cells].reshape(-1, N_COLUMNS, N_ROWS)
        image[:, first : first + n_cells] = cells[:, ::-1].reshape(-1, n_cells)
        image[:, first + n_cells + 2] *= -1.0
    turned = np.array([-1.0, -1.0, 1.0], dtype=features.dtype)
    image[:, -6:-3], image[:, -3:] = features[:, -3:] * turned, features[:, -6:-3] * turned
    return image


def _curtains(rows: Array, scene: Scene) -> Array:
    curtains, depths = np.empty((len(rows), N_COLUMNS * N_ROWS)), np.empty(len(rows))
    fill_curtains(rows, scene.packed, scene.rope_length, curtains, depths)
    rise = rows[:, 5] - rows[:, 2]
    lengths = np.column_stack([gripper_separation(rows), band_length(rows), rise, depths])
    return np.hstack([curtains, lengths / scene.rope_length])


def _motion(before: Array, after: Array) -> Array:
    """Displacements of A and B along, across and up, shape (n, 6)."""
    span = before[:, 3:5] - before[:, :2]
    length = np.linalg.norm(span, axis=1, keepdims=True)
    along = np.where(length > _LEAST_SPAN, span / np.maximum(length, _LEAST_SPAN), [1.0, 0.0])
    moved = (after[:, :6] - before[:, :6]).reshape(-1, 2, 3) / STEP_SIZE
    x = np.einsum("ngk,nk->ng", moved[..., :2], along)
    y = moved[..., 1] * along[:, None, 0] - moved[..., 0] * along[:, None, 1]
    return np.stack([x, y, moved[..., 2]], axis=2).reshape(-1, 6)
