"""Compiled sums over the trees of forests and of gradient boosting."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

LEAF = -1
# A node as the kernel reads it, small enough for one line of the cache.
NODE = np.dtype(
    [
        ("threshold", np.float64),
        ("feature", np.int32),
        ("left", np.int32),
        ("right", np.int32),
        ("missing_goes_left", np.bool_),
    ],
    align=True,
)


@compiled
def leaf_sums(
    rows: NDArray[Any],
    start: float,
    roots: NDArray[np.int64],
    nodes: NDArray[np.void],
    leaf_values: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Add up the values of the leaves that rows arrive at, in the order of the trees.

    Parameters
    ----------
    rows : ndarray of float32 or float64 of shape (n, n_features)
        NaN where a value is missing.
    start : float
        What the sums start from.
    roots : ndarray of int of shape (n_trees,)
        The nodes of all trees are numbered together.
    nodes : ndarray of ``NODE`` of shape (n_nodes,)
        A row goes left where the value of ``feature`` is at most ``threshold``. For a leaf,
        ``feature`` is ``LEAF`` and ``left`` its row of ``leaf_values``.
    leaf_values : ndarray of shape (n_leaves, n_columns)

    Returns
    -------
    sums : ndarray of shape (n, n_columns)
    """
    sums = np.full((rows.shape[0], leaf_values.shape[1]), start)
    for root in roots:
        for i in range(rows.shape[0]):
            node = root
            while nodes[node].feature != LEAF:
                value = rows[i, nodes[node].feature]
                if np.isnan(value):
                    goes_left = nodes[node].missing_goes_left
                else:
                    goes_left = value <= nodes[node].threshold
                node = nodes[node].left if goes_left else nodes[node].right
            for column in range(leaf_values.shape[1]):
                sums[i, column] += leaf_values[nodes[node].left, column]
    return sums


@compiled
def holds_unfit(rows: NDArray[Any], nan_is_fit: bool) -> bool:
    """Say whether rows hold an infinite value, or a missing one where those are not taken.

    Parameters
    ----------
    rows : ndarray of float32 or float64 of shape (n, n_features)
    nan_is_fit : bool

    Returns
    -------
    unfit : bool
    """
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            value = rows[i, j]
            if np.isinf(value) or (np.isnan(value) and not nan_is_fit):
                return True
    return False
