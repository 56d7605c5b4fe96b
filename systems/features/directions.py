"""Angles as directions, which do not jump where an angle passes π."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.validation import as_numbers


def directions(angles: ArrayLike) -> NDArray[np.float64]:
    """Return the sines, then the cosines, of angles.

    An angle of -π and one of π are the same direction, and as numbers they are as far apart as can
    be; their sines and cosines are the same.

    Parameters
    ----------
    angles : array-like of shape (..., d)
        In radians.

    Returns
    -------
    directions : ndarray of shape (..., 2 d)
        In [-1, 1].

    Examples
    --------
    >>> import numpy as np
    >>> from systems import directions
    >>> directions([[np.pi, np.pi / 2]]).round(3) + 0.0
    array([[ 0.,  1., -1.,  0.]])
    """
    radians = as_numbers(angles, "angles")
    if not radians.ndim:
        raise ValueError(f"angles must be an array, got the number {angles!r}.")
    return np.concatenate([np.sin(radians), np.cos(radians)], axis=-1)
