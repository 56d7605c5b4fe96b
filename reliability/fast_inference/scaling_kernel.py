"""Compiled arithmetic of scalers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled


@compiled
def scaled_rows(
    rows: NDArray[Any],
    subtract: NDArray[Any],
    divide: NDArray[Any],
    multiply: NDArray[Any],
    add: NDArray[Any],
    low: float,
    high: float,
) -> NDArray[Any]:
    """Return clip((rows - subtract) / divide * multiply + add, low, high).

    Each operation is rounded to the precision of the rows, as scikit-learn's are.

    Parameters
    ----------
    rows : ndarray of float32 or float64 of shape (n, n_features)
    subtract, divide, multiply, add : ndarray of shape (n_features,)
    low, high : float

    Returns
    -------
    scaled : ndarray of the same type and shape as ``rows``
    """
    scaled = np.empty_like(rows)
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            scaled[i, j] = rows[i, j] - subtract[j]
            scaled[i, j] = scaled[i, j] / divide[j]
            scaled[i, j] = scaled[i, j] * multiply[j]
            scaled[i, j] = scaled[i, j] + add[j]
            if scaled[i, j] < low:
                scaled[i, j] = low
            elif scaled[i, j] > high:
                scaled[i, j] = high
    return scaled
