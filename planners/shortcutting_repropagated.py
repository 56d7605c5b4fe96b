"""Shortcuts for plans whose reduced states are more than configurations.

The rest of a reduced state, such as the rope's band, depends on the way that led to it. After a
shortcut the states behind it are therefore propagated again, and the transitions that changed are
classified again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners.check_transition import CheckTransition, negative_log_likelihood
from planners.path import Path
from planners.planning_problem import PlanningProblem
from systems.angles import shortest_way
from systems.system import Array

ROUNDS = 500
LONGEST_SHORTCUT = 40
SMALLEST_SAVING = 1e-6
# A share of the step: adding a displacement to a configuration rounds.
ARRIVED = 1e-6
CLASSIFIED_AT_ONCE = 16


class _Costed(NamedTuple):
    """A path with the negative log-likelihood of each transition, shape (T,)."""

    path: Path
    costs: Array


class RepropagatedShortcuts:
    """Replaces parts of a plan by straight lines, and checks every transition that changes.

    Half of the lines are of the whole configuration. Where the system has parts that move
    independently, the others are of one part, while the rest moves as it did.

    A shortcut is taken if g allows every transition of it and of the plan's rest, if the plan
    still ends in a goal, if every transition that is not bit by bit one of the old plan's is
    classified Reliable, and if the new transitions are together as likely to be Reliable as those
    they replace. No Unreliable transition is accepted at random here: a shortcut that is tried
    until it happens to be accepted would undo the bias.

    Parameters
    ----------
    problem : PlanningProblem
    check : CheckTransition
    rng : Generator
    """

    def __init__(
        self, problem: PlanningProblem, check: CheckTransition, rng: np.random.Generator
    ) -> None:
        self._system = problem.system
        self._dim = problem.system.configuration_dim
        self._goals = problem.goals
        self._check = check
        self._rng = rng
        start = problem.starts[:1]
        self._no_command = self._system.steer(start, start[:, : self._dim])[:0]

    def shorten(self, path: Path) -> Path:
        """Take shortcuts between random states of a plan.

        Parameters
        ----------
        path : Path
            Ends in a goal.

        Returns
        -------
        shortened : Path
            From the same start, in no more transitions.
        """
        probability = self._check.probability(path.reduced[:-1], path.reduced[1:])
        plan = _Costed(path, negative_log_likelihood(probability))
        for _ in range(ROUNDS):
            if len(plan.costs) < 2:
                break
            first, last = self._propose(len(plan.path.reduced))
            configurations = plan.path.reduced[first : last + 1, : self._dim]
            waypoints = self._straightened(configurations, self._draw_part())
            if waypoints is not None:
                plan = self._with_shortcut(plan, first, last, waypoints) or plan
        return plan.path

    def _propose(self, n_states: int) -> tuple[int, int]:
        """Draw the first and the last state of a part of the plan."""
        first = int(self._rng.integers(n_states - 2))
        length = int(self._rng.integers(2, LONGEST_SHORTCUT + 1))
        return first, min(first + length, n_states - 1)

    def _draw_part(self) -> slice | None:
        """Draw an independent part of the configuration, or None for the whole."""
        parts = self._system.independent_parts
        drawn = int(self._rng.integers(2 * max(1, len(parts))))
        return parts[drawn] if drawn < len(parts) else None

    def _straightened(self, configurations: Array, part: slice | None) -> Array | None:
        """Return configurations at most a step apart, or None if straightening saves nothing."""
        moves = shortest_way(configurations[:-1], configurations[1:], self._system.angular)
        line = configurations[0] + np.concatenate(
            [np.zeros((1, self._dim)), np.cumsum(moves, axis=0)]
        )
        if part is None:
            straight = line[[0, -1]]
        else:
            others = np.delete(moves, np.arange(self._dim)[part], axis=1)
            straight = line.copy()
            share = _shares_travelled(others)[:, None]
            straight[:, part] = line[0, part] + share * (line[-1, part] - line[0, part])
        travelled = np.linalg.norm(np.diff(straight, axis=0), axis=1).sum()
        if np.linalg.norm(moves, axis=1).sum() - travelled <= SMALLEST_SAVING:
            return None
        n_steps = max(1, int(np.ceil(travelled / self._system.step_size - ARRIVED)))
        return _resampled(straight, n_steps) if n_steps <= len(moves) else None

    def _with_shortcut(
        self, plan: _Costed, first: int, last: int, waypoints: Array
    ) -> _Costed | None:
        """Return the plan with a shortcut from one state to another; None if not allowed."""
        path, costs = plan
        shortcut = self._follow(path.reduced[first], waypoints)
        if shortcut is None:
            return None
        # Behind the shortcut states differ, until they happen to be the same as before.
        behind = path.reduced[last:]
        rest = self._follow(shortcut.path.reduced[-1], behind[1:, : self._dim], behind)
        if rest is None:
            return None
        kept = last + len(rest.costs)
        if shortcut.costs.sum() + rest.costs.sum() > costs[first:kept].sum():
            return None
        states = (shortcut.path.reduced, rest.path.reduced[1:], path.reduced[kept + 1 :])
        commands = (shortcut.path.commands, rest.path.commands, path.commands[kept:])
        joined = Path(
            np.concatenate([path.reduced[:first], *states]),
            np.concatenate([path.commands[:first], *commands]),
        )
        if not self._system.goal_reached(joined.reduced[-1:], self._goals)[0]:
            return None
        new_costs = [costs[:first], shortcut.costs, rest.costs, costs[kept:]]
        return _Costed(joined, np.concatenate(new_costs))

    def _follow(self, start: Array, waypoints: Array, known: Array | None = None) -> _Costed | None:
        """Move from one configuration to the next by Reliable transitions that g allows.

        Parameters
        ----------
        start : ndarray of shape (reduced_dim,)
        waypoints : ndarray of shape (n, configuration_dim)
        known : ndarray of shape (n + 1, reduced_dim), default=None
            States of the old plan; moving ends at the first that is the same.

        Returns
        -------
        followed : _Costed or None
            None where a transition is not allowed or not Reliable.
        """
        path = self._propagated(start, waypoints, known)
        costs = None if path is None else self._costs_if_reliable(path)
        return None if path is None or costs is None else _Costed(path, costs)

    def _propagated(self, start: Array, waypoints: Array, known: Array | None) -> Path | None:
        states = [start]
        commands = [self._no_command]
        for i, target in enumerate(waypoints):
            if known is not None and np.array_equal(states[-1], known[i]):
                break
            command = self._system.steer(states[-1][None], target[None])
            following, valid = self._system.propagate(states[-1][None], command)
            if not valid[0] or not self._arrived(following[0], target):
                return None
            commands.append(command)
            states.append(following[0])
        return Path(np.array(states), np.concatenate(commands))

    def _arrived(self, state: Array, target: Array) -> bool:
        gap = np.abs(shortest_way(state[: self._dim], target, self._system.angular)).max()
        return bool(gap <= ARRIVED * self._system.step_size)

    def _costs_if_reliable(self, path: Path) -> Array | None:
        """Return each transition's cost, or None if one is not classified Reliable."""
        before, after = path.reduced[:-1], path.reduced[1:]
        costs = np.zeros(len(before))
        for i in range(0, len(before), CLASSIFIED_AT_ONCE):
            rows = slice(i, i + CLASSIFIED_AT_ONCE)
            reliable, probability = self._check.evaluate(before[rows], after[rows])
            if not reliable.all():
                return None
            costs[rows] = negative_log_likelihood(probability)
        return costs


def _shares_travelled(moves: Array) -> Array:
    """Return the share of the way travelled before and after each move, from 0 to 1.

    Evenly spaced if there is no way to travel.
    """
    lengths = np.linalg.norm(moves, axis=1)
    if lengths.sum() <= 0.0:
        lengths = np.ones(len(moves))
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    return travelled / travelled[-1]


def _resampled(line: Array, n_steps: int) -> Array:
    """Return the ends of steps of one length along a polyline, its last corner exactly."""
    at_corners = _shares_travelled(np.diff(line, axis=0))
    at_ends = np.linspace(0.0, 1.0, n_steps + 1)[1:]
    columns = [np.interp(at_ends, at_corners, column) for column in line.T]
    return np.column_stack(columns)
