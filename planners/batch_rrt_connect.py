"""RRT-Connect for estimators that are slow to ask: many extensions per question."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.edge_checker import EdgeChecker
from planners.ompl_search import Clock
from planners.search_tree import SearchTree
from systems.angles import shortest_way, wrap_columns
from systems.system import Array

EXTENSIONS_PER_ROUND = 8


class BatchRRTConnect:
    """RRT-Connect that grows its trees by several samples at a time.

    A round draws a few samples, extends one tree towards each by an edge, and then the other tree
    towards every new state, edge by edge, until it is blocked or arrives; the trees swap roles
    after each round. All edges of one depth are checked in one call.

    Parameters
    ----------
    bounds : ndarray of shape (2, d)
    start : ndarray of shape (d,)
    goals : ndarray of shape (n_goals, d)
    checker : EdgeChecker
    longest_edge : float
    angular : tuple of int
        Entries that are angles which wrap.
    rng : Generator
    """

    def __init__(
        self,
        bounds: Array,
        start: Array,
        goals: Array,
        checker: EdgeChecker,
        longest_edge: float,
        angular: tuple[int, ...],
        rng: np.random.Generator,
    ) -> None:
        self._bounds = bounds
        self._from_start = SearchTree(start[None], len(start), angular)
        self._to_goal = SearchTree(goals, len(start), angular)
        self._checker = checker
        self._longest_edge = longest_edge
        self._angular = angular
        self._rng = rng

    def __call__(self, clock: Clock) -> Array | None:
        """Search until the trees meet; return the path's vertices, None when time is up."""
        tree, other = self._from_start, self._to_goal
        while not clock.spent(EXTENSIONS_PER_ROUND):
            low, high = self._bounds
            samples = self._rng.uniform(low, high, size=(EXTENSIONS_PER_ROUND, len(low)))
            added, _ = self._extend(tree, samples, tree.nearest(samples))
            met = self._connect(other, tree.reduced[added])
            if met is not None:
                reached, arrived = met
                return self._path(tree, int(added[reached]), other, arrived)
            tree, other = other, tree
        return None

    def _extend(
        self, tree: SearchTree, targets: Array, nearest: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Grow one edge towards each target; return the new states and which targets they serve."""
        origins = tree.reduced[nearest]
        ends = _limited(origins, targets, self._longest_edge, self._angular)
        if tree is self._from_start:
            accepted = self._checker.accept(origins, ends)
        else:
            accepted = self._checker.accept(ends, origins)
        served = np.flatnonzero(accepted)
        return tree.add(ends[served], nearest[served]), served

    def _connect(self, tree: SearchTree, targets: Array) -> tuple[int, int] | None:
        """Grow towards each target until it is reached or blocked; return the first pair met."""
        active = np.arange(len(targets))
        nearest = tree.nearest(targets)
        while len(active):
            added, served = self._extend(tree, targets[active], nearest)
            active, nearest = active[served], added
            arrived = np.flatnonzero((tree.reduced[nearest] == targets[active]).all(axis=1))
            if len(arrived):
                return int(active[arrived[0]]), int(nearest[arrived[0]])
        return None

    def _path(self, tree: SearchTree, index: int, other: SearchTree, met: int) -> Array:
        one, two = tree.reduced[tree.branch(index)], other.reduced[other.branch(met)]
        outward, homeward = (one, two) if tree is self._from_start else (two, one)
        return np.concatenate([outward, homeward[::-1][1:]])


def _limited(origins: Array, targets: Array, longest: float, angular: tuple[int, ...]) -> Array:
    ways = shortest_way(origins, targets, angular)
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    scale = np.minimum(1.0, longest / np.maximum(lengths, 1e-300))
    return np.where(scale < 1, wrap_columns(origins + ways * scale, angular), targets)
