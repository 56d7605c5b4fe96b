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
    """An RRT that extends a few branches at once, one transition each per question.

    A branch grows towards its sample until it arrives or a transition is rejected; then another
    sample takes its place.

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
        targets, tips = self._goals[:0], np.arange(0)
        while not found:
            n_idle = EXTENSIONS_PER_ROUND - len(targets)
            if clock.spent(n_idle):
                return None
            samples = self._sample(n_idle)
            targets = np.concatenate([targets, samples])
            tips = np.concatenate([tips, self.tree.nearest(samples)])
            found, targets, tips = self._step(targets, tips)
        return self.path()[0][:, : self._system.configuration_dim]

    def path(self) -> tuple[Array, Array]:
        """Return states and commands from the start to the goal, or the start alone."""
        branch = self.tree.branch(self._last)
        all_commands = np.concatenate([self._no_command(), *self._commands])
        return self.tree.reduced[branch], all_commands[branch[1:] - 1]

    def _no_command(self) -> Array:
        start = self.tree.reduced[:1]
        return self._system.steer(start, start[:, : self._system.configuration_dim])[:0]

    def _sample(self, n: int) -> Array:
        samples = self._system.sample_configurations(self._rng, n)
        to_goal = self._rng.random(n) < GOAL_BIAS
        chosen = self._rng.integers(len(self._goals), size=int(to_goal.sum()))
        samples[to_goal] = self._goals[chosen]
        return samples

    def _step(
        self, targets: Array, tips: NDArray[np.int64]
    ) -> tuple[bool, Array, NDArray[np.int64]]:
        """Add one transition to each branch; return whether a goal is met, and who goes on."""
        system = self._system
        reduced = self.tree.reduced[tips]
        command = system.steer(reduced, targets)
        following, valid = system.propagate(reduced, command)
        moved = following[:, : system.configuration_dim] != reduced[:, : system.configuration_dim]
        possible = np.flatnonzero(valid & moved.any(axis=1))
        accepted = possible[self._check(reduced[possible], following[possible])]
        added = self.tree.add(following[accepted], tips[accepted])
        self._commands.append(command[accepted])
        reached = system.goal_reached(following[accepted], self._goals)
        if reached.any():
            self._last = int(added[np.argmax(reached)])
        configurations = following[accepted, : system.configuration_dim]
        left = shortest_way(configurations, targets[accepted], system.angular)
        going_on = (np.abs(left) > ARRIVED * system.step_size).any(axis=1)
        return bool(reached.any()), targets[accepted[going_on]], added[going_on]
