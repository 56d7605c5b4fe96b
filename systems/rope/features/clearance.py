"""Features of rope transitions that see what hangs below the band."""

from __future__ import annotations

import numpy as np

from systems.rope.band.band import band_length, gripper_separation, reduced_dim
from systems.rope.features.clearance_kernels import (
    LEAST_SPAN,
    N_COLUMNS,
    N_ROWS,
    fill_depths,
    fill_hanging_clearances,
    fill_slack_clearances,
)
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import STEP_SIZE, Scene
from systems.rope.slack.pbd_ropes import KINDS, pbd_dim
from systems.validation import as_finite_array

_N_CELLS = N_COLUMNS * N_ROWS
_N_LENGTHS = 4
_RISES = [2, 6]
_CURTAIN = 2 * _N_LENGTHS
_FIRST_SHEET = _CURTAIN + _N_CELLS
_N_OFFSETS = 3 * N_COLUMNS
_SHEETS = tuple(_FIRST_SHEET + i * (_N_CELLS + _N_OFFSETS + 1) for i in range(len(KINDS)))


def clearance_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions by the obstacles between the band and the rope that hangs below it.

    The band forgets how the rope hangs, and yet the length of the rope implies it: below the
    band, as deep as the slack lets it. What catches the rope goes through this region. Before
    and after the transition come the distance between the grippers, the length of the band, the
    rise from gripper A to B and the depth of the rope, as shares of the rope's length; then,
    after it, the signed distance to the obstacles on a grid of 16 columns along the band by 8
    rows from the band down to a little below the rope, clipped to -0.05 and 0.15 m, in units of
    0.05 m. A rope that rests on an edge drags behind its grippers, so then come, for each PBD
    rope (see :mod:`systems.rope.slack.pbd_ropes`), such a grid from the band towards it and beyond;
    the way from band to PBD rope in its 16 columns, in the same units, along the horizontal
    direction from A to B, to the left of it, and up; and its length as a share of the longest that
    is allowed. Last comes the motion of the grippers in steps of 0.025 m: along, to the left, and
    up. The features are the same wherever the scene is put and however it is turned about the
    vertical.

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
        Of a ``Rope`` with ``features="clearance"``: bands, and after them PBD ropes.
    scene : Scene

    Returns
    -------
    X : ndarray of float32 of shape (n, 496)
    """
    before, _ = _checked_parts(reduced, "reduced", scene)
    after, loose = _checked_parts(next_reduced, "next_reduced", scene, len(before))
    curtains, depths = np.empty((len(after), N_COLUMNS, N_ROWS)), np.empty((2, len(after)))
    fill_depths(before, scene.rope_length, depths[0])
    fill_hanging_clearances(after, scene.packed, scene.rope_length, curtains, depths[1])
    rows = [
        _lengths(before, depths[0], scene),
        _lengths(after, depths[1], scene),
        curtains.reshape(len(after), _N_CELLS),
        _sheets(after, loose, scene),
        _motion(before, after),
    ]
    return np.hstack(rows).astype(np.float32)


def mirrored(features: Array) -> Array:
    """Return the features of the same transitions in a mirror that stands along the rope."""
    image = features.copy()
    for offsets in map(_offsets, _SHEETS):
        image[:, offsets][:, 1::3] *= -1.0
    image[:, [-5, -2]] *= -1.0
    return image


def reversed_ends(features: Array) -> Array:
    """Return the features of the same transitions with the names of the grippers exchanged."""
    image = features.copy()
    for first in (_CURTAIN, *_SHEETS):
        cells = image[:, first : first + _N_CELLS].reshape(-1, N_COLUMNS, N_ROWS)
        image[:, first : first + _N_CELLS] = cells[:, ::-1].reshape(-1, _N_CELLS)
    image[:, _RISES] *= -1.0
    turned = np.array([-1.0, -1.0, 1.0], dtype=features.dtype)
    for offsets in map(_offsets, _SHEETS):
        ways = features[:, offsets].reshape(-1, N_COLUMNS, 3)
        image[:, offsets] = (ways[:, ::-1] * turned).reshape(-1, _N_OFFSETS)
    image[:, -6:-3], image[:, -3:] = features[:, -3:] * turned, features[:, -6:-3] * turned
    return image


def _offsets(sheet: int) -> slice:
    return slice(sheet + _N_CELLS, sheet + _N_CELLS + _N_OFFSETS)


def _checked_parts(
    rows: Array, name: str, scene: Scene, n_rows: int | None = None
) -> tuple[Array, Array]:
    """Return bands and PBD ropes as the kernels read them."""
    width = reduced_dim(scene)
    rows = as_finite_array(rows, name, (n_rows, width + pbd_dim(scene)))
    return np.ascontiguousarray(rows[:, :width]), np.ascontiguousarray(rows[:, width:])


def _lengths(bands: Array, depths: Array, scene: Scene) -> Array:
    rise = bands[:, 5] - bands[:, 2]
    lengths = np.column_stack([gripper_separation(bands), band_length(bands), rise, depths])
    return lengths / scene.rope_length


def _sheets(bands: Array, loose: Array, scene: Scene) -> Array:
    """Return the distances between bands and PBD ropes, the ways, and the ropes' lengths."""
    shape = (len(bands), len(KINDS))
    sheets, offsets = np.empty((*shape, N_COLUMNS, N_ROWS)), np.empty((*shape, N_COLUMNS, 3))
    lengths, ropes = np.empty(shape), loose.reshape(*shape, loose.shape[1] // len(KINDS))
    fill_slack_clearances(bands, ropes, scene.n_nodes, scene.packed, sheets, offsets, lengths)
    flat = sheets.reshape(*shape, _N_CELLS), offsets.reshape(*shape, _N_OFFSETS)
    parts = np.concatenate([*flat, lengths[..., None] / scene.max_band_length], axis=2)
    return parts.reshape(len(bands), len(KINDS) * (_N_CELLS + _N_OFFSETS + 1))


def _motion(before: Array, after: Array) -> Array:
    """Displacements of A and B along, across and up, shape (n, 6)."""
    span = before[:, 3:5] - before[:, :2]
    length = np.linalg.norm(span, axis=1, keepdims=True)
    along = np.where(length > LEAST_SPAN, span / np.maximum(length, LEAST_SPAN), [1.0, 0.0])
    moved = (after[:, :6] - before[:, :6]).reshape(-1, 2, 3) / STEP_SIZE
    x = np.einsum("ngk,nk->ng", moved[..., :2], along)
    y = moved[..., 1] * along[:, None, 0] - moved[..., 0] * along[:, None, 1]
    return np.stack([x, y, moved[..., 2]], axis=2).reshape(-1, 6)
