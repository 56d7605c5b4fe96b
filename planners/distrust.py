"""Transitions that have just failed, which planning leaves out near where they failed."""

from __future__ import annotations

import copy
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from systems.angles import shortest_way
from systems.system import Array, System

S = TypeVar("S", bound=System)

# Two motions are alike if they differ by at most this share of the one that failed.
ALIKE = 0.5


class DistrustedTransitions:
    """Remembers transitions that failed in an execution.

    A transition is distrusted if it begins at a state that is Close to where one failed, and its
    motion differs from the failed one's by at most half of that one's length. Equal lengths are
    then at most 29° apart.

    Parameters
    ----------
    system : System

    References
    ----------
    Vemula, Oza, Bagnell and Likhachev 2020, "Planning and Execution using Inaccurate Models with
    Provable Guarantees" (CMAX), which makes transitions near failed ones costly. Here g has no
    successor for them, which works with any estimator, and with none.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._failed: list[tuple[Array, Array]] = []

    def __len__(self) -> int:
        return len(self._failed)

    def add(self, reduced: Array, next_reduced: Array) -> None:
        """Remember a transition, given by two reduced states of shape (reduced_dim,).

        One that goes nowhere is not remembered: planning could not start at that place any more.
        """
        motion = self._motions(reduced[None], next_reduced[None])[0]
        if motion.any():
            self._failed.append((reduced, motion))

    def includes(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        """Say which transitions are distrusted.

        Parameters
        ----------
        reduced, next_reduced : ndarray of shape (n, reduced_dim)

        Returns
        -------
        distrusted : ndarray of bool of shape (n,)
        """
        distrusted = np.zeros(len(reduced), dtype=np.bool_)
        motions = self._motions(reduced, next_reduced)
        for origin, failed in self._failed:
            apart = np.linalg.norm(motions - failed, axis=1)
            alike = np.flatnonzero(apart <= ALIKE * np.linalg.norm(failed))
            origins = np.broadcast_to(origin, (len(alike), len(origin)))
            distrusted[alike] |= self._system.close(reduced[alike], origins)
        return distrusted

    def left_out_of(self, system: S) -> S:
        """Return a copy of a system whose g has no successor for distrusted transitions."""
        if not self._failed:
            return system
        propagate = system.propagate

        def trusted(reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
            following, valid = propagate(reduced, command)
            possible = np.flatnonzero(valid)
            trusted = valid.copy()
            trusted[possible] = ~self.includes(reduced[possible], following[possible])
            return following, trusted

        view = copy.copy(system)
        # A system may be a frozen dataclass. Variants of a view would be the view itself.
        object.__setattr__(view, "propagate", trusted)
        object.__setattr__(view, "vary", system.vary)
        return view

    def _motions(self, reduced: Array, next_reduced: Array) -> Array:
        system, dim = self._system, self._system.configuration_dim
        return shortest_way(reduced[:, :dim], next_reduced[:, :dim], system.angular)
