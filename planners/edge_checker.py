"""Checking straight edges: g and CheckTransition, transition by transition."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.check_transition import CheckTransition, negative_log_likelihood
from planners.edge_discretization import split_edges
from systems.system import Array, System


class EdgeChecker:
    """Checks straight edges of a system whose reduced state is only a configuration.

    Parameters
    ----------
    system : System
    check : CheckTransition
    """

    def __init__(self, system: System, check: CheckTransition) -> None:
        self._system = system
        self._check = check
        self._accepted: list[tuple[Array, Array, NDArray[np.bool_]]] = []

    def __repr__(self) -> str:
        return f"<EdgeChecker of {self._system!r}>"

    def accept(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Accept the edges of which g allows, and CheckTransition accepts, every transition.

        Parameters
        ----------
        starts, ends : ndarray of shape (n_edges, configuration_dim)
            To be executed from start to end.

        Returns
        -------
        accepted : ndarray of bool of shape (n_edges,)
        """
        possible, origins, following, edge = self._propagate(starts, ends)
        accepted = _all_per_edge(possible, edge, self._check(origins, following))
        if accepted.any():
            self._accepted.append((starts, ends, accepted))
        return accepted

    def accepted_edges(self) -> Array:
        """Return all edges that :meth:`accept` let pass, shape (n, 2, configuration_dim)."""
        edges = [np.stack([starts[a], ends[a]], axis=1) for starts, ends, a in self._accepted]
        return np.concatenate([np.empty((0, 2, self._system.reduced_dim)), *edges])

    def evaluate(self, starts: Array, ends: Array) -> tuple[NDArray[np.bool_], Array]:
        """Classify edges without any random acceptance.

        Parameters
        ----------
        starts, ends : ndarray of shape (n_edges, configuration_dim)
            To be executed from start to end.

        Returns
        -------
        reliable : ndarray of bool of shape (n_edges,)
            Whether g allows every transition of the edge, and each is classified Reliable.
        cost : ndarray of shape (n_edges,)
            Negative log-likelihood: -log of the probability that all of the edge's transitions
            are Reliable.
        """
        possible, origins, following, edge = self._propagate(starts, ends)
        reliable, probability = self._check.evaluate(origins, following)
        cost = np.zeros(len(starts))
        np.add.at(cost, edge, negative_log_likelihood(probability))
        return _all_per_edge(possible, edge, reliable), cost

    def negative_log_likelihood(self, reduced: Array, next_reduced: Array) -> Array:
        """Return -log of the probability that each transition is Reliable, shape (n,)."""
        return negative_log_likelihood(self._check.probability(reduced, next_reduced))

    def _propagate(
        self, starts: Array, ends: Array
    ) -> tuple[NDArray[np.bool_], Array, Array, NDArray[np.int64]]:
        """Return which edges g allows, and the transitions of those edges.

        Returns
        -------
        possible : ndarray of bool of shape (n_edges,)
        origins, following : ndarray of shape (n_transitions, configuration_dim)
        edge : ndarray of int of shape (n_transitions,)
            The edge that each transition belongs to.
        """
        system = self._system
        origins, targets, edge = split_edges(starts, ends, system.step_size, system.angular)
        command = system.steer(origins, targets)
        following, valid = system.propagate(origins, command)
        possible = np.ones(len(starts), dtype=np.bool_)
        if not valid.all():
            possible[edge[~valid]] = False
            kept = possible[edge]
            origins, following, edge = origins[kept], following[kept], edge[kept]
        return possible, origins, following, edge


def _all_per_edge(
    possible: NDArray[np.bool_], edge: NDArray[np.int64], accepted: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which possible edges have all of their transitions accepted."""
    if not accepted.all():
        possible[edge[~accepted]] = False
    return possible
