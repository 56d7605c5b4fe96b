"""Bit-packed voxel grids: unpacking, pooling, rotating and mirroring."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from systems.compilation import compiled

N_SYMMETRIES = 8
# An integer holds one column of cells along z.
_COLUMN_TYPES = {16: torch.int16, 32: torch.int32, 64: torch.int64}


def unpacked(rows: Tensor, channels: int, side: int, pooling: int) -> Tensor:
    """Unpack bit-packed rows into grids on the CPU, and pool them.

    Parameters
    ----------
    rows : Tensor of uint8 of shape (n, channels * side**3 / 8)
    channels, side : int
        Of the packed grids.
    pooling : int
        Each cube of ``pooling`` cells a side becomes one: the mean in the first channel, the
        maximum in the others.

    Returns
    -------
    grids : Tensor of float32 of shape (n, channels, side / pooling, ...)
        In the memory layout "channels last", in which convolutions are fastest.
    """
    seen = side // pooling
    grids = np.zeros((len(rows), seen, seen, seen, channels), dtype=np.float32)
    fill_grids(rows.numpy(), channels, pooling, grids)
    return torch.from_numpy(grids).permute(0, 4, 1, 2, 3)


def unpacked_on_device(rows: Tensor, channels: int, side: int, pooling: int) -> Tensor:
    """Return the same as :func:`unpacked`, by tensor operations, which run on any device."""
    shifts = torch.arange(7, -1, -1, dtype=torch.uint8, device=rows.device)
    bits = (rows.unsqueeze(-1) >> shifts) & 1
    grids = bits.reshape(-1, channels, side, side, side).float()
    if pooling > 1:
        parts = [nn.functional.avg_pool3d(grids[:, :1], pooling)]
        if channels > 1:
            parts.append(nn.functional.max_pool3d(grids[:, 1:], pooling))
        grids = torch.cat(parts, dim=1)
    return grids.contiguous(memory_format=torch.channels_last_3d)


def transformed(rows: Tensor, channels: int, side: int, draws: Tensor) -> Tensor:
    """Rotate and mirror bit-packed grids about the z axis, without unpacking them.

    A column of cells along z lies in consecutive bits, so that columns move as whole numbers.

    Parameters
    ----------
    rows : Tensor of uint8 of shape (n, channels * side**3 / 8)
    channels, side : int
    draws : Tensor of int of shape (n,)
        From 0 to 7: the number of quarter turns about z, plus 4 to exchange x and y afterwards.

    Returns
    -------
    rows : Tensor of uint8 of the same shape
    """
    columns = rows.view(_COLUMN_TYPES[side]).reshape(len(rows), channels, side * side)
    index = _symmetries(side).to(rows.device)[draws]
    moved = columns.gather(2, index[:, None].expand_as(columns))
    return moved.reshape(len(rows), -1).view(torch.uint8)


def _symmetries(side: int) -> Tensor:
    """Return, for each symmetry and each place, the column that moves there: (8, side * side)."""
    plane = torch.arange(side * side).reshape(side, side)
    turned = [torch.rot90(plane, k) for k in range(4)]
    return torch.stack([p.reshape(-1) for p in (*turned, *(t.T for t in turned))])


@compiled
def fill_grids(
    rows: NDArray[np.uint8], channels: int, pooling: int, grids: NDArray[np.float32]
) -> None:
    """Unpack rows of bits into grids, and pool cubes of cells.

    Pooling takes the mean in the first channel and the maximum in the others.

    Parameters
    ----------
    rows : ndarray of uint8 of shape (n, n_bytes)
    channels : int
    pooling : {1, 2, 4, 8}
        Side of the cubes.
    grids : ndarray of float32 of shape (n, side, side, side, channels)
        Filled in; zeros at first. ``side`` is that after pooling. Channels come last, which is
        the memory layout in which convolutions are fastest.
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
