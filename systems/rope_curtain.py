"""Features of rope transitions that see what hangs below the band."""

from __future__ import annotations

import numpy as np

from systems.band import band_length, checked_bands, gripper_separation
from systems.obstacles import Array
from systems.rope_curtain_kernels import LEAST_SPAN, N_COLUMNS, N_ROWS, fill_curtains
from systems.rope_scene import STEP_SIZE, Scene
from systems.rope_slice import slice_counts

# To the left of the way from A to B, then to the right.
TILTS = np.radians([90.0, 45.0, -45.0, -90.0])

_UPRIGHT = np.zeros(1)
_N_CELLS = N_COLUMNS * N_ROWS
_N_LENGTHS = 4
_CURTAINS = (0, _N_CELLS + _N_LENGTHS)
_FIRST_TILTED = 2 * (_N_CELLS + _N_LENGTHS)
_TILTED = slice(_FIRST_TILTED, _FIRST_TILTED + len(TILTS) * _N_CELLS)


def curtain_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions by the obstacles between the band and the rope that hangs below it.

    The band forgets how the rope hangs, and yet the length of the rope implies it: below the
    band, as deep as the slack lets it. What catches the rope goes through this curtain. Before
    and after the transition, the signed distance to the obstacles is taken on a grid of 16
    columns along the band by 8 rows from the band down to a little below the rope, clipped to
    -0.05 and 0.15 m, in units of 0.05 m; each is followed by the distance between the grippers,
    the length of the band, the rise from gripper A to B and the depth of the rope, as shares of
    the rope's length. A rope that rests on an edge drags behind its grippers, so then come four
    curtains after the transition that are tilted aside, as much as ``TILTS`` to the left of the
    way from A to B; the parts of the slice between the grippers
    (:func:`systems.rope_slice.slice_counts`); and the motion of the grippers in steps of 0.025 m:
    along the horizontal direction from A to B, across it, and up. The features are the same
    wherever the scene is put and however it is turned about the vertical.

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    X : ndarray of float32 of shape (n, 791)
    """
    before = checked_bands(reduced, "reduced", scene)
    after = checked_bands(next_reduced, "next_reduced", scene, len(before))
    upright_before, _, lengths_before = _curtains_and_lengths(before, _UPRIGHT, scene)
    tilts = np.concatenate([_UPRIGHT, TILTS])
    upright, tilted, lengths = _curtains_and_lengths(after, tilts, scene)
    counts, motion = slice_counts(before, after, scene), _motion(before, after)
    rows = [upright_before, lengths_before, upright, lengths, tilted, counts, motion]
    return np.hstack(rows).astype(np.float32)


def mirrored(features: Array) -> Array:
    """Return the features of the same transitions in a mirror that stands along the rope."""
    image = features.copy()
    image[:, [-5, -2]] *= -1.0
    image[:, _TILTED] = _sides_exchanged(features)
    return image


def reversed_ends(features: Array) -> Array:
    """Return the features of the same transitions with the names of the grippers exchanged."""
    image = features.copy()
    image[:, _TILTED] = _sides_exchanged(features)
    for first in (*_CURTAINS, *range(_TILTED.start, _TILTED.stop, _N_CELLS)):
        cells = image[:, first : first + _N_CELLS].reshape(-1, N_COLUMNS, N_ROWS)
        image[:, first : first + _N_CELLS] = cells[:, ::-1].reshape(-1, _N_CELLS)
    image[:, [first + _N_CELLS + 2 for first in _CURTAINS]] *= -1.0
    turned = np.array([-1.0, -1.0, 1.0], dtype=features.dtype)
    image[:, -6:-3], image[:, -3:] = features[:, -3:] * turned, features[:, -6:-3] * turned
    return image


def _sides_exchanged(features: Array) -> Array:
    tilted = features[:, _TILTED].reshape(len(features), len(TILTS), _N_CELLS)
    return tilted[:, ::-1].reshape(len(features), len(TILTS) * _N_CELLS)


def _curtains_and_lengths(rows: Array, tilts: Array, scene: Scene) -> tuple[Array, Array, Array]:
    """Return the distances on the first curtain, on the others, and the lengths of the bands."""
    curtains = np.empty((len(rows), len(tilts), N_COLUMNS, N_ROWS))
    depths = np.empty(len(rows))
    fill_curtains(rows, tilts, scene.packed, scene.rope_length, curtains, depths)
    rise = rows[:, 5] - rows[:, 2]
    lengths = np.column_stack([gripper_separation(rows), band_length(rows), rise, depths])
    flat = curtains.reshape(len(rows), len(tilts) * _N_CELLS)
    return flat[:, :_N_CELLS], flat[:, _N_CELLS:], lengths / scene.rope_length


def _motion(before: Array, after: Array) -> Array:
    """Displacements of A and B along, across and up, shape (n, 6)."""
    span = before[:, 3:5] - before[:, :2]
    length = np.linalg.norm(span, axis=1, keepdims=True)
    along = np.where(length > LEAST_SPAN, span / np.maximum(length, LEAST_SPAN), [1.0, 0.0])
    moved = (after[:, :6] - before[:, :6]).reshape(-1, 2, 3) / STEP_SIZE
    x = np.einsum("ngk,nk->ng", moved[..., :2], along)
    y = moved[..., 1] * along[:, None, 0] - moved[..., 0] * along[:, None, 1]
    return np.stack([x, y, moved[..., 2]], axis=2).reshape(-1, 6)
