"""RRT with carried states, growing towards several samples at a time."""

from __future__ import annotations

from dataclasses import dataclass

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


class BatchRRT:
    """An RRT that extends a few branches at once, one transition each per question.

    A branch grows towards its sample until it arrives or a transition is rejected. Then another
    sample takes its place; or else, for a tenth of the branches, a goal, from where it ended.
    Growing towards goals from whichever state is nearest would fail again and again in one place.

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
        self._goal_tried: set[int] = set()

    def __call__(self, clock: Clock) -> Array | None:
        """Search until a state is a goal; return the configurations, None when time is up."""
        found = bool(self._system.goal_reached(self.tree.reduced, self._goals)[0])
        growing = _Branches(self._goals[:0], np.arange(0), np.zeros(0, dtype=np.bool_))
        ended = growing.tips
        while not found:
            n_idle = EXTENSIONS_PER_ROUND - len(growing.tips)
            if clock.spent(n_idle):
                return None
            found, growing, ended = self._step(growing.and_also(self._start(n_idle, ended)))
        return self.path()[0][:, : self._system.configuration_dim]

    def path(self) -> tuple[Array, Array]:
        """Return states and commands from the start to the goal, or the start alone."""
        branch = self.tree.branch(self._last)
        all_commands = np.concatenate([self._no_command(), *self._commands])
        return self.tree.reduced[branch], all_commands[branch[1:] - 1]

    def _no_command(self) -> Array:
        start = self.tree.reduced[:1]
        return self._system.steer(start, start[:, : self._system.configuration_dim])[:0]

    def _start(self, n: int, ended: NDArray[np.int64]) -> _Branches:
        """Start branches, some towards a goal from where others ended."""
        fresh = np.array([tip for tip in ended if tip not in self._goal_tried], dtype=np.int64)
        from_tips = fresh[self._rng.random(len(fresh)) < GOAL_BIAS]
        self._goal_tried.update(from_tips.tolist())
        goals = self._goals[self._rng.integers(len(self._goals), size=len(from_tips))]
        samples = self._system.sample_configurations(self._rng, n - len(from_tips))
        return _Branches(
            np.concatenate([goals, samples]),
            np.concatenate([from_tips, self.tree.nearest(samples)]),
            np.arange(n) < len(from_tips),
        )

    def _step(self, growing: _Branches) -> tuple[bool, _Branches, NDArray[np.int64]]:
        """Add one transition to each branch.

        Returns whether a goal is met, the branches that go on, and the tips of those that ended
        on their way to a sample.
        """
        system, targets, tips = self._system, growing.targets, growing.tips
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
        going_on = np.zeros(len(tips), dtype=np.bool_)
        going_on[accepted] = (np.abs(left) > ARRIVED * system.step_size).any(axis=1)
        new_tips = tips.copy()
        new_tips[accepted] = added
        grown = _Branches(targets, new_tips, growing.to_goal)
        ended = new_tips[~going_on & ~growing.to_goal]
        return bool(reached.any()), grown.only(going_on), ended


@dataclass(frozen=True)
class _Branches:
    """Branches that grow: what towards, from which states, and whether towards a goal."""

    targets: Array
    tips: NDArray[np.int64]
    to_goal: NDArray[np.bool_]

    def only(self, which: NDArray[np.bool_]) -> _Branches:
        return _Branches(self.targets[which], self.tips[which], self.to_goal[which])

    def and_also(self, others: _Branches) -> _Branches:
        return _Branches(
            np.concatenate([self.targets, others.targets]),
            np.concatenate([self.tips, others.tips]),
            np.concatenate([self.to_goal, others.to_goal]),
        )
