"""What an estimator sees of a system that does not say what it should see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import shortest_way
from systems.features.directions import directions

Array = NDArray[np.float64]


def default_features(
    reduced: Array, next_reduced: Array, bounds: Array, angular: tuple[int, ...], step_size: float
) -> Array:
    """Describe transitions by where they start and how they move.

    Parameters
    ----------
    reduced, next_reduced : ndarray of shape (n, reduced_dim)
    bounds : ndarray of shape (2, configuration_dim)
    angular : tuple of int
    step_size : float

    Returns
    -------
    X : ndarray of shape (n, 2 * reduced_dim + len(angular))
        The configuration from -1 to 1 within the bounds, angles as sine and cosine instead; the
        rest of the reduced state as it is; and the change of the configuration, angles the shorter
        way round, and of the rest, both over ``step_size``.
    """
    dim = bounds.shape[1]
    low, high = bounds
    start = reduced[:, :dim]
    placed = np.delete((2 * start - low - high) / (high - low), angular, axis=1)
    moved = shortest_way(reduced, next_reduced, angular) / step_size
    around = directions(start[:, list(angular)])
    return np.hstack([placed, around, reduced[:, dim:], moved])
