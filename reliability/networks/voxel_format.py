"""The format of bit-packed voxel grids: channels and cells from the bytes of a row."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.validation import is_integer

SIDES = (16, 32, 64)
MOST_CHANNELS = 7
# The smallest side of which two convolutions and a pooling layer leave a cell.
LEAST_SIDE = 12

# The number of bytes tells the format: no two of these grids take up the same. (Eight channels of
# 16 would be as large as one of 32.)
_SHAPES = {
    channels * side**3 // 8: (channels, side)
    for side in SIDES
    for channels in range(1, MOST_CHANNELS + 1)
}


def grid_shape(n_bytes: int) -> tuple[int, int]:
    """Return the number of channels and the cells a side of a grid of so many bytes.

    Raises
    ------
    ValueError
        If no grid has so many bytes.
    """
    if n_bytes not in _SHAPES:
        raise ValueError(
            "X of uint8 must hold bit-packed grids, up to 7 channels of 16, 32 or 64 cells cubed "
            f"(12288 bytes for 3 channels of 32), got {n_bytes} bytes a row. Give other numbers "
            "as floats."
        )
    return _SHAPES[n_bytes]


def check_pooling(pooling: Any, side: int | None = None) -> None:
    """Raise ``ValueError`` if pooling is unknown, or leaves too few cells of a grid's side."""
    if not is_integer(pooling) or pooling not in (1, 2, 4):
        raise ValueError(f"pooling must be 1, 2 or 4, got {pooling!r}.")
    if side is not None and side // pooling < LEAST_SIDE:
        raise ValueError(
            f"pooling must leave at least {LEAST_SIDE} cells a side, got {pooling} for grids of "
            f"{side} (grids may have {', '.join(map(str, SIDES))})."
        )


def check_packed(X: Any, n_features: int) -> None:
    """Raise ``ValueError`` unless X holds bytes, as the grids that a model was trained on."""
    found = getattr(X, "dtype", type(X).__name__)
    if found != np.uint8:
        channels, side = grid_shape(n_features)
        raise ValueError(
            f"X must hold the bit-packed grids that this model was trained on, uint8 rows of "
            f"{n_features} bytes ({channels} channels of {side} x {side} x {side} cells), got "
            f"{found}."
        )
