"""What bit-packed rows hold: some channels of a cube of cells."""

from __future__ import annotations

SIDES = (16, 32, 64)
MOST_CHANNELS = 7
# The least that two convolutions and a maximum leave something of.
LEAST_SIDE = 12

# No two cubes of these sides and channels take up the same bytes.
_SHAPES = {
    channels * side**3 // 8: (channels, side)
    for side in SIDES
    for channels in range(1, MOST_CHANNELS + 1)
    if channels % 8
}


def grid_shape(n_bytes: int) -> tuple[int, int]:
    """Return the channels and the side of the grids that rows of so many bytes hold.

    Raises
    ------
    ValueError
        If there are no such grids.
    """
    if n_bytes not in _SHAPES:
        raise ValueError(
            "X of uint8 must hold bit-packed grids, up to 7 channels of 16, 32 or 64 cells cubed "
            f"(12288 bytes for 3 channels of 32), got {n_bytes} bytes a row. Give other numbers "
            "as floats."
        )
    return _SHAPES[n_bytes]
