"""The tree of a sampling-based search."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

Array = NDArray[np.float64]


class SearchTree:
    """Reduced states with their parents and the commands that led to them.

    Parameters
    ----------
    roots : ndarray of shape (n_roots, reduced_dim)
    configuration_dim : int
        Leading entries of a reduced state that distances are measured in.
    angular : tuple of int, default=()
        Entries that are angles which wrap.
    """

    def __init__(self, roots: Array, configuration_dim: int, angular: tuple[int, ...] = ()) -> None:
        self._dim = configuration_dim
        self._wraps = np.isin(np.arange(configuration_dim), angular)
        self._reduced = np.array(roots)
        # A copy of the columns that distances need: searching whole states would read memory that
        # is mostly of no use.
        self._configurations = np.array(roots[:, :configuration_dim])
        self._parents = np.full(len(roots), -1)
        self._size = len(roots)

    @property
    def reduced(self) -> Array:
        """Reduced states, shape (n, reduced_dim)."""
        return self._reduced[: self._size]

    @property
    def parents(self) -> NDArray[np.int64]:
        """Index of each state's parent, -1 for roots; shape (n,)."""
        return self._parents[: self._size]

    def add(self, reduced: Array, parents: NDArray[np.int64]) -> NDArray[np.int64]:
        """Add states, shape (m, reduced_dim), and return their indices."""
        new_size = self._size + len(reduced)
        if new_size > len(self._reduced):
            capacity = max(2 * len(self._reduced), new_size, 256)
            self._reduced = _with_room(self._reduced, capacity)
            self._configurations = _with_room(self._configurations, capacity)
            self._parents = _with_room(self._parents, capacity)
        added = np.arange(self._size, new_size)
        self._reduced[added] = reduced
        self._configurations[added] = reduced[:, : self._dim]
        self._parents[added] = parents
        self._size = new_size
        return added

    def nearest(self, configurations: Array) -> NDArray[np.int64]:
        """Return the index of the state nearest to each configuration, (m, configuration_dim)."""
        if self._wraps.any():
            return nearest_wrapped_rows(
                self._configurations, self._size, self._wraps, configurations
            )
        return nearest_rows(self._configurations, self._size, self._dim, configurations)

    def path_from_root(self, index: int) -> NDArray[np.int64]:
        """Return the indices of the states from a root to a state, both included."""
        indices = []
        while index >= 0:
            indices.append(index)
            index = int(self._parents[index])
        return np.array(indices[::-1])

    def edges(self) -> Array:
        """Return (parent, child) pairs of configurations, shape (n_edges, 2, configuration_dim)."""
        children = np.flatnonzero(self.parents >= 0)
        configurations = self._configurations[: self._size]
        return np.stack([configurations[self.parents[children]], configurations[children]], axis=1)


def _with_room(rows: NDArray[Any], capacity: int) -> NDArray[Any]:
    roomy = np.empty((capacity, *rows.shape[1:]), rows.dtype)
    roomy[: len(rows)] = rows
    return roomy


@compiled
def nearest_rows(rows: Array, n_rows: int, dim: int, queries: Array) -> NDArray[np.int64]:
    """Return, for each query, the first row at the smallest Euclidean distance.

    Parameters
    ----------
    rows : ndarray of shape (capacity, at least dim)
        Only the first ``n_rows`` rows and ``dim`` columns count.
    n_rows, dim : int
    queries : ndarray of shape (m, dim)

    Returns
    -------
    nearest : ndarray of int of shape (m,)
    """
    nearest = np.empty(queries.shape[0], np.int64)
    for query in range(queries.shape[0]):
        smallest = np.inf
        for row in range(n_rows):
            squared = 0.0
            for i in range(dim):
                squared += (rows[row, i] - queries[query, i]) ** 2
            if squared < smallest:
                smallest = squared
                nearest[query] = row
    return nearest


@compiled
def nearest_wrapped_rows(
    rows: Array, n_rows: int, wraps: NDArray[np.bool_], queries: Array
) -> NDArray[np.int64]:
    """Return what :func:`nearest_rows` does, with distances the short way round.

    Parameters
    ----------
    rows : ndarray of shape (capacity, at least d)
    n_rows : int
    wraps : ndarray of bool of shape (d,)
        Which entries are angles in [-π, π].
    queries : ndarray of shape (m, d)

    Returns
    -------
    nearest : ndarray of int of shape (m,)
    """
    nearest = np.empty(queries.shape[0], np.int64)
    for query in range(queries.shape[0]):
        smallest = np.inf
        for row in range(n_rows):
            squared = 0.0
            for i in range(wraps.shape[0]):
                gap = abs(rows[row, i] - queries[query, i])
                if wraps[i] and gap > np.pi:
                    gap = 2 * np.pi - gap
                squared += gap * gap
            if squared < smallest:
                smallest = squared
                nearest[query] = row
    return nearest
