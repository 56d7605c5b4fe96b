"""RRT with carried states, growing towards several samples at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.check_transition import CheckTransition
from planners.ompl_search import Clock
from planners.search_tree import SearchTree
from systems.angles import shortest_way
from systems.system import Array, System

EXTENSIONS_PER_ROUND = 8
GOAL_BIAS = 0.1
# A share of the step: adding a displacement to a configuration rounds.
ARRIVED = 1e-9


class LockstepRRT:
    """An RRT of which each round extends a few branches, one transition each at a time.

    Parameters
    ----------
    system : System
    start : ndarray of shape (reduced_dim,)
    goals : ndarray of shape (n_goals, configuration_dim)
    check : CheckTransition
    rng : Generator

    Attributes
    ----------
    tree : SearchTree
    """

    def __init__(
        self,
        system: System,
        start: Array,
        goals: Array,
        check: CheckTransition,
        rng: np.random.Generator,
    ) -> None:
        self.tree = SearchTree(start[None], system.configuration_dim, system.angular)
        self._system = system
        self._goals = goals
        self._check = check
        self._rng = rng
        self._commands: list[Array] = []
        self._last = 0

    def __call__(self, clock: Clock) -> Array | None:
        """Search until a state is a goal; return the configurations, None when time is up."""
        found = bool(self._system.goal_reached(self.tree.reduced, self._goals)[0])
        while not found:
            if clock.spent(EXTENSIONS_PER_ROUND):
                return None
            found = self._grow(self._sample())
        return self.path()[0][:, : self._system.configuration_dim]

    def path(self) -> tuple[Array, Array]:
        """Return states and commands from the start to the goal, or the start alone."""
        branch = self.tree.branch(self._last)
        all_commands = np.concatenate([self._no_command(), *self._commands])
        return self.tree.reduced[branch], all_commands[branch[1:] - 1]

    def _no_command(self) -> Array:
        start = self.tree.reduced[:1]
        return self._system.steer(start, start[:, : self._system.configuration_dim])[:0]

    def _sample(self) -> Array:
        low, high = self._system.bounds
        samples = self._rng.uniform(low, high, size=(EXTENSIONS_PER_ROUND, len(low)))
        to_goal = self._rng.random(EXTENSIONS_PER_ROUND) < GOAL_BIAS
        chosen = self._rng.integers(len(self._goals), size=int(to_goal.sum()))
        samples[to_goal] = self._goals[chosen]
        return samples

    def _grow(self, targets: Array) -> bool:
        """Extend a branch towards each target until all have ended; tell whether a goal is met."""
        nearest = self.tree.nearest(targets)
        while len(targets):
            advancing, targets, nearest = self._step(targets, nearest)
            if len(advancing) == 0:
                return False
            reached = self._system.goal_reached(self.tree.reduced[advancing], self._goals)
            if reached.any():
                self._last = int(advancing[np.argmax(reached)])
                return True
        return False

    def _step(
        self, targets: Array, nearest: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
        """Add one transition to each branch; return the new states and who goes on from where."""
        system = self._system
        reduced = self.tree.reduced[nearest]
        command = system.steer(reduced, targets)
        following, valid = system.propagate(reduced, command)
        moved = following[:, : system.configuration_dim] != reduced[:, : system.configuration_dim]
        possible = np.flatnonzero(valid & moved.any(axis=1))
        accepted = possible[self._check(reduced[possible], following[possible])]
        added = self.tree.add(following[accepted], nearest[accepted])
        self._commands.append(command[accepted])
        configurations = following[accepted, : system.configuration_dim]
        left = shortest_way(configurations, targets[accepted], system.angular)
        going_on = (np.abs(left) > ARRIVED * system.step_size).any(axis=1)
        return added, targets[accepted[going_on]], added[going_on]
