"""RRT-Connect that grows towards several samples at a time, for estimators slow to answer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.budget import Budget, free_edges
from planners.edge_checker import EdgeChecker
from planners.planning_problem import PlanningProblem
from planners.search_tree import SearchTree
from systems.angles import shortest_way, wrap_columns
from systems.system import Array

EXTENSIONS_PER_ROUND = 8
GOALS_PER_ROUND = 4


class BatchRRTConnect:
    """RRT-Connect that grows its trees by several samples at a time.

    A round draws a few samples, extends one tree towards each by an edge, and then connects the
    other tree to every new state, edge by edge, until it is blocked or arrives; the trees swap
    roles after each round. All edges of one depth are checked in one call. Where the goal is a
    region, the tree that grows from the goals gets further ones as it grows.

    Parameters
    ----------
    problem : PlanningProblem
    checker : EdgeChecker
    longest_edge : float
    rng : Generator
    """

    def __init__(
        self,
        problem: PlanningProblem,
        checker: EdgeChecker,
        longest_edge: float,
        rng: np.random.Generator,
    ) -> None:
        self._problem = problem
        self._bounds = problem.system.bounds
        self._angular = problem.system.angular
        dim = problem.system.configuration_dim
        self._from_start = SearchTree(problem.starts, dim, self._angular)
        self._to_goal = SearchTree(problem.goals, dim, self._angular)
        self._checker = checker
        self._longest_edge = longest_edge
        self._free_edges = free_edges(problem.system.bounds, longest_edge)
        self._rng = rng

    def grow(self, budget: Budget) -> Array | None:
        """Grow the trees until they meet; return the path's vertices, or None without one."""
        tree, other = self._from_start, self._to_goal
        while not budget.exhausted(EXTENSIONS_PER_ROUND):
            self._add_goals()
            low, high = self._bounds
            samples = self._rng.uniform(low, high, size=(EXTENSIONS_PER_ROUND, len(low)))
            added, _ = self._extend(tree, samples, tree.nearest(samples))
            met = self._connect(other, tree.reduced[added], budget)
            if met is not None:
                target, arrived = met
                return self._path(tree, int(added[target]), other, arrived)
            tree, other = other, tree
        return None

    def _add_goals(self) -> None:
        """Keep a region's goals at half of the nodes of their tree, as OMPL's RRT-Connect does."""
        if 2 * len(self._problem.goals) < len(self._to_goal.reduced):
            drawn = self._problem.draw_goals(GOALS_PER_ROUND)
            self._to_goal.add(drawn, np.full(len(drawn), -1))

    def _extend(
        self, tree: SearchTree, targets: Array, nearest: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Grow one edge towards each target; return the new nodes and the rows of their targets."""
        origins = tree.reduced[nearest]
        ends = _within_range(origins, targets, self._longest_edge, self._angular)
        if tree is self._from_start:
            accepted = self._checker.accept(origins, ends)
        else:
            accepted = self._checker.accept(ends, origins)
        extended = np.flatnonzero(accepted)
        return tree.add(ends[extended], nearest[extended]), extended

    def _connect(self, tree: SearchTree, targets: Array, budget: Budget) -> tuple[int, int] | None:
        """Grow towards each target until it is reached or an edge to it is rejected.

        Returns
        -------
        met : (target, node) or None
            The row of a target that was reached, and the tree's node there.
        """
        active = np.arange(len(targets))
        nodes = tree.nearest(targets)
        n_edges = 0
        while len(active):
            n_edges += 1
            if n_edges > self._free_edges and not budget.pay(len(active)):
                break
            added, extended = self._extend(tree, targets[active], nodes)
            active, nodes = active[extended], added
            arrived = np.flatnonzero((tree.reduced[nodes] == targets[active]).all(axis=1))
            if len(arrived):
                return int(active[arrived[0]]), int(nodes[arrived[0]])
        return None

    def _path(self, tree: SearchTree, node: int, other: SearchTree, other_node: int) -> Array:
        """Return the vertices from a start to a goal through two nodes at one place."""
        one = tree.reduced[tree.path_from_root(node)]
        two = other.reduced[other.path_from_root(other_node)]
        from_start, from_goal = (one, two) if tree is self._from_start else (two, one)
        return np.concatenate([from_start, from_goal[::-1][1:]])


def _within_range(
    origins: Array, targets: Array, longest: float, angular: tuple[int, ...]
) -> Array:
    """Return the targets, those too far away moved towards their origins."""
    ways = shortest_way(origins, targets, angular)
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    scale = np.minimum(1.0, longest / np.maximum(lengths, 1e-300))
    return np.where(scale < 1, wrap_columns(origins + ways * scale, angular), targets)
