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


def default_feature_names(
    reduced_dim: int, configuration_dim: int, angular: tuple[int, ...]
) -> tuple[str, ...]:
    """Return the names of the columns of :func:`default_features`.

    q0, q1, … are the entries of the configuration, and the further entries of the reduced state
    keep their places: b3 is the first after a configuration of three.
    """
    entries = [f"q{i}" for i in range(configuration_dim)]
    rest = [f"b{i}" for i in range(configuration_dim, reduced_dim)]
    placed = np.delete(entries, angular).tolist()
    around = [f"{function}_q{i}" for function in ("sin", "cos") for i in angular]
    return (*placed, *around, *rest, *(f"change_of_{name}" for name in [*entries, *rest]))
