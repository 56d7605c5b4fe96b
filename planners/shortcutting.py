"""Shortcuts for plans whose reduced states are only configurations."""

from __future__ import annotations

import numpy as np

from planners.edge_checker import EdgeChecker
from planners.edge_discretization import split_edges
from systems.angles import shortest_way
from systems.system import Array, System

ROUNDS = 12
PROPOSALS_PER_ROUND = 8
SMALLEST_SAVING = 1e-6


def shorten(path: Array, checker: EdgeChecker, system: System, rng: np.random.Generator) -> Array:
    """Replace parts of a path by straight lines that are at least as reliable.

    Every transition of a shortcut must be classified Reliable in the direction in which it will
    be executed, and all of them together must be as likely to be Reliable as those they replace.
    No Unreliable transition is accepted at random here: a shortcut that is tried until it happens
    to be accepted would undo the bias. So every transition of the result was either accepted in
    the search or is classified Reliable.

    Parameters
    ----------
    path : ndarray of shape (T + 1, configuration_dim)
        One state per transition.
    checker : EdgeChecker
    system : System
    rng : Generator

    Returns
    -------
    shortened : ndarray of shape (S + 1, configuration_dim), S <= T
    """
    costs = checker.negative_log_likelihood(path[:-1], path[1:])
    for _ in range(ROUNDS):
        if len(path) <= 2:
            break
        first, last, saving = _propose(path, system.angular, rng)
        if len(first) == 0:
            continue
        reliable, cost = checker.evaluate(path[first], path[last])
        cost_before = np.concatenate([[0.0], np.cumsum(costs)])
        saving[~reliable | (cost > cost_before[last] - cost_before[first])] = 0
        best = int(np.argmax(saving))
        if saving[best] > 0:
            start, end = first[best], last[best]
            origins, straight, _ = split_edges(
                path[start][None], path[end][None], system.step_size, system.angular
            )
            new_costs = checker.negative_log_likelihood(origins, straight)
            costs = np.concatenate([costs[:start], new_costs, costs[end:]])
            path = np.concatenate([path[: start + 1], straight, path[end + 1 :]])
    return path


def _propose(
    path: Array, angular: tuple[int, ...], rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Draw pairs of states of which the path between them is longer than a straight line.

    Returns
    -------
    first, last : ndarray of int of shape (n,)
    saving : ndarray of shape (n,)
        Length that a straight line between the two would save.
    """
    pairs = np.sort(rng.integers(len(path), size=(PROPOSALS_PER_ROUND, 2)), axis=1)
    pairs[0] = 0, len(path) - 1
    first, last = pairs.T
    lengths = np.linalg.norm(shortest_way(path[:-1], path[1:], angular), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    direct = np.linalg.norm(shortest_way(path[first], path[last], angular), axis=1)
    saving = travelled[last] - travelled[first] - direct
    worthwhile = saving > SMALLEST_SAVING
    return first[worthwhile], last[worthwhile], saving[worthwhile]
