"""Features of rope transitions: the obstacles between the band and where the rope may hang."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from systems.rope.band.band import band_length, gripper_separation, reduced_dim
from systems.rope.features.clearance_kernels import (
    LEAST_SPAN,
    N_COLUMNS,
    N_ROWS,
    hanging_clearances,
    hanging_depths,
    pbd_clearances,
)
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import STEP_SIZE, Scene
from systems.rope.slack.pbd_ropes import KINDS, pbd_dim
from systems.validation import as_finite_array


class PbdColumns(NamedTuple):
    """Columns that describe one PBD rope."""

    clearances: slice
    offsets: slice
    length: slice


def _consecutive(start: int, *widths: int) -> list[slice]:
    ends = np.cumsum([start, *widths]).tolist()
    return [slice(first, end) for first, end in itertools.pairwise(ends)]


# The columns of the features, in their order. Offsets and motions are triples: along the
# horizontal direction from gripper A to B, to the left of it, and up.
_N_LENGTHS, _N_CELLS, _N_OFFSETS, _N_MOTION = 4, N_COLUMNS * N_ROWS, 3 * N_COLUMNS, 3
LENGTHS_BEFORE, LENGTHS_AFTER, HANGING = _consecutive(0, _N_LENGTHS, _N_LENGTHS, _N_CELLS)
PBD_WIDTH = _N_CELLS + _N_OFFSETS + 1
PBD = tuple(
    PbdColumns(*_consecutive(HANGING.stop + i * PBD_WIDTH, _N_CELLS, _N_OFFSETS, 1))
    for i in range(len(KINDS))
)
MOTION_A, MOTION_B = _consecutive(HANGING.stop + len(KINDS) * PBD_WIDTH, _N_MOTION, _N_MOTION)
N_FEATURES = MOTION_B.stop
# Within the lengths, and within a triple.
SEPARATION, BAND_LENGTH, RISE, DEPTH_OF_ROPE = range(_N_LENGTHS)
ALONG, LEFT, UP = range(3)


def _names() -> tuple[str, ...]:
    lengths = ("gripper_separation", "band_length", "rise", "depth_of_rope")
    cells = [f"column{i}_row{j}" for i in range(N_COLUMNS) for j in range(N_ROWS)]
    ways = ("along", "left", "up")
    offsets = [f"offset{i}_{way}" for i in range(N_COLUMNS) for way in ways]
    return (
        *(f"{name}_{when}" for when in ("before", "after") for name in lengths),
        *(f"distance_{cell}" for cell in cells),
        *(
            f"pbd{rope}_{name}"
            for rope in range(len(KINDS))
            for name in (*(f"distance_{cell}" for cell in cells), *offsets, "length")
        ),
        *(f"motion_{gripper}_{way}" for gripper in ("a", "b") for way in ways),
    )


FEATURE_NAMES = _names()

# A triple as seen after a turn by half a circle about the vertical.
_TURNED = (-1.0, -1.0, 1.0)


def clearance_features(reduced: Array, next_reduced: Array, scene: Scene) -> Array:
    """Describe transitions by the obstacles between the band and the rope that hangs below it.

    The band tells nothing about how the rope hangs, but the rope's length does: it hangs below
    the band, as deep as its slack allows. Obstacles that can catch it are in the region between.
    The features are, in this order:

    - 4 before and 4 after the transition, as shares of the rope's length: the distance between
      the grippers, the length of the band, the rise from gripper A to B, and the depth to which
      the rope hangs;
    - 128, the signed distances to the obstacles, after the transition, on a grid of 16 columns
      along the band by 8 rows from the band down to a little below the rope, clipped to -0.05 and
      0.15 m, in units of 0.05 m;
    - 177 for each of the two PBD ropes (:mod:`systems.rope.slack.pbd_ropes`), which also know
      where the rope rests on an edge and drags behind its grippers: 128 such distances on a grid
      from the band towards the PBD rope and a little beyond; the offset from the band to it in
      each of the 16 columns, in the same units, along the horizontal direction from A to B, to
      the left of it, and up; and its length as a share of the longest that is allowed;
    - 6, the motion of gripper A and of gripper B in steps of 0.025 m: along, to the left, and up.

    They are the same wherever the scene is put and however it is turned about the vertical.

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
    after, ropes = _checked_parts(next_reduced, "next_reduced", scene, len(before))
    hanging, depths = hanging_clearances(after, scene.packed, scene.rope_length)
    parts = [
        _lengths(before, hanging_depths(before, scene.rope_length), scene),
        _lengths(after, depths, scene),
        hanging.reshape(len(after), _N_CELLS),
        _pbd_parts(after, ropes, scene),
        _motion(before, after),
    ]
    return np.hstack(parts).astype(np.float32)


def mirrored(features: Array) -> Array:
    """Return the features of the same transitions in a vertical mirror through the grippers."""
    image = features.copy()
    for columns in (*(pbd.offsets for pbd in PBD), MOTION_A, MOTION_B):
        _triples(image, columns)[:, :, LEFT] *= -1.0
    return image


def reversed_ends(features: Array) -> Array:
    """Return the features of the same transitions with the names of the grippers exchanged."""
    image = features.copy()
    for lengths in (LENGTHS_BEFORE, LENGTHS_AFTER):
        image[:, lengths][:, RISE] *= -1.0
    for cells in (HANGING, *(pbd.clearances for pbd in PBD)):
        image[:, cells] = _grid(features, cells)[:, ::-1].reshape(-1, _N_CELLS)
    turned = np.array(_TURNED, dtype=features.dtype)
    for columns in (pbd.offsets for pbd in PBD):
        offsets = _triples(features, columns)[:, ::-1] * turned
        image[:, columns] = offsets.reshape(-1, _N_OFFSETS)
    image[:, MOTION_A] = features[:, MOTION_B] * turned
    image[:, MOTION_B] = features[:, MOTION_A] * turned
    return image


def _grid(features: Array, cells: slice) -> Array:
    return features[:, cells].reshape(-1, N_COLUMNS, N_ROWS)


def _triples(features: Array, columns: slice) -> Array:
    """Return a view of triples, shape (n, n_triples, 3)."""
    n_triples = (columns.stop - columns.start) // 3
    return features[:, columns].reshape(len(features), n_triples, 3)


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


def _pbd_parts(bands: Array, ropes: Array, scene: Scene) -> Array:
    """Return clearances, offsets and lengths of PBD ropes, shape (n, n_ropes * PBD_WIDTH)."""
    n, n_ropes = len(bands), len(KINDS)
    separate = ropes.reshape(n, n_ropes, ropes.shape[1] // n_ropes)
    clearances, offsets, lengths = pbd_clearances(bands, separate, scene.n_nodes, scene.packed)
    parts = [
        clearances.reshape(n, n_ropes, _N_CELLS),
        offsets.reshape(n, n_ropes, _N_OFFSETS),
        lengths[..., None] / scene.max_band_length,
    ]
    return np.concatenate(parts, axis=2).reshape(n, n_ropes * PBD_WIDTH)


def _motion(before: Array, after: Array) -> Array:
    """Displacements of A and B along, to the left and up, in steps, shape (n, 6)."""
    span = before[:, 3:5] - before[:, :2]
    length = np.linalg.norm(span, axis=1, keepdims=True)
    along = np.where(length > LEAST_SPAN, span / np.maximum(length, LEAST_SPAN), [1.0, 0.0])
    moved = (after[:, :6] - before[:, :6]).reshape(-1, 2, 3) / STEP_SIZE
    x = np.einsum("ngk,nk->ng", moved[..., :2], along)
    y = moved[..., 1] * along[:, None, 0] - moved[..., 0] * along[:, None, 1]
    return np.stack([x, y, moved[..., 2]], axis=2).reshape(-1, 6)
