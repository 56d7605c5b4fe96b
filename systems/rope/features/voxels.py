"""Voxel grids of rope transitions, bit-packed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.rope.band.band import N_MATCHED, checked_bands
from systems.rope.features.voxel_kernels import SIDE, voxel_rows
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import Scene

N_CHANNELS = 3
PACKED_BYTES = N_CHANNELS * SIDE**3 // 8


def voxel_features(reduced: Array, next_reduced: Array, scene: Scene) -> NDArray[np.uint8]:
    """Describe transitions of bands by three grids of 32 x 32 x 32 cells: E, b and b'.

    The grid is a cube as wide as the band may be long, ``scene.max_band_length``, along the
    world's axes, around the mean of the grippers' positions before and after. A cell of E is
    occupied unless its centre is free: in the world and in no obstacle. A cell of a band is
    occupied if one of 500 points, evenly spaced along the band, is in it.

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
    scene : Scene

    Returns
    -------
    rows : ndarray of uint8 of shape (n, 12288)
        ``np.packbits`` of the cells in the order channel, x, y, z; see :func:`unpack_voxels`.

    References
    ----------
    McConachie et al. 2020, "Application to rope manipulation"; the size of the grid from the
    authors' public code.
    """
    before = checked_bands(reduced, "reduced", scene)
    after = checked_bands(next_reduced, "next_reduced", scene, len(before))
    rows: NDArray[np.uint8] = voxel_rows(
        before, after, scene.packed, scene.bounds, scene.max_band_length, N_MATCHED
    )
    return rows


def unpack_voxels(rows: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the cells, 0 or 1, of bit-packed rows.

    Parameters
    ----------
    rows : ndarray of uint8 of shape (n, 12288)

    Returns
    -------
    cells : ndarray of uint8 of shape (n, 3, 32, 32, 32)
        Channels E, b, b'; then x, y and z.

    Raises
    ------
    ValueError
        If the rows are of another width or type.
    """
    if rows.ndim != 2 or rows.shape[1] != PACKED_BYTES or rows.dtype != np.uint8:
        raise ValueError(
            f"rows must be uint8 of the shape (n, {PACKED_BYTES}), got {rows.dtype} of the shape "
            f"{rows.shape}."
        )
    return np.unpackbits(rows, axis=1).reshape(-1, N_CHANNELS, SIDE, SIDE, SIDE)
