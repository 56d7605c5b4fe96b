"""Compiled unpacking of bit-packed grids, for networks on the CPU."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled


@compiled
def fill_grids(
    rows: NDArray[np.uint8], channels: int, pooling: int, grids: NDArray[np.float32]
) -> None:
    """Unpack bits into zeros, pooling cubes of cells: the first channel's mean, others' maximum.

    Parameters
    ----------
    rows : ndarray of uint8 of shape (n, n_bytes)
    channels : int
    pooling : {1, 2, 4, 8}
        Side of the cubes.
    grids : ndarray of float32 of shape (n, side, side, side, channels)
        ``side`` is after pooling. The channels come last, as convolutions like them.
    """
    side = grids.shape[1] * pooling
    column, mask, shift = side // 8, (1 << pooling) - 1, 8 - pooling
    share = np.zeros(mask + 1, np.float32)
    for bits in range(1, mask + 1):
        share[bits] = share[bits >> 1] + np.float32((bits & 1) / pooling**3)
    for n in range(rows.shape[0]):
        at = 0
        for channel in range(channels):
            for x in range(side):
                for y in range(side):
                    cells = grids[n, x // pooling, y // pooling]
                    for byte in range(column):
                        cube = np.int64(rows[n, at])
                        at += 1
                        if cube == 0:
                            continue
                        for k in range(8 // pooling):
                            part = (cube >> (shift - k * pooling)) & mask
                            z = byte * (8 // pooling) + k
                            if channel == 0:
                                cells[z, 0] += share[part]
                            elif part:
                                cells[z, channel] = np.float32(1.0)
