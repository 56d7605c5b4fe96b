"""Compiled sums over boosted trees, for a few rows at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

LEAF = -1


@compiled
def boosted_sums(
    rows: NDArray[np.float64],
    baseline: float,
    roots: NDArray[np.int64],
    features: NDArray[np.int64],
    values: NDArray[np.float64],
    children: NDArray[np.int64],
    missing_goes_left: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Add up what each tree says, in the order of the trees.

    Parameters
    ----------
    rows : ndarray of shape (n, n_features)
    baseline : float
        What no tree would say.
    roots : ndarray of int of shape (n_trees,)
        Nodes of all trees are numbered together.
    features : ndarray of int of shape (n_nodes,)
        What a node asks about, or ``LEAF``.
    values : ndarray of shape (n_nodes,)
        Greatest value that goes left; of a leaf, what it says.
    children : ndarray of int of shape (n_nodes, 2)
        Left and right.
    missing_goes_left : ndarray of bool of shape (n_nodes,)

    Returns
    -------
    sums : ndarray of shape (n,)
    """
    sums = np.empty(rows.shape[0])
    for i in range(rows.shape[0]):
        total = baseline
        for root in roots:
            node = root
            while features[node] != LEAF:
                value = rows[i, features[node]]
                left = missing_goes_left[node] if np.isnan(value) else value <= values[node]
                node = children[node, 0 if left else 1]
            total += values[node]
        sums[i] = total
    return sums
