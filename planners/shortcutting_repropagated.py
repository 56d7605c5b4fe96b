"""Shortcuts for plans whose reduced states carry more than their configuration.

What is carried depends on the way: after a shortcut, the rest of the plan has to be propagated
again, and classified again wherever that made a difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planners.check_transition import CheckTransition, negative_log_likelihood
from systems.angles import shortest_way
from systems.system import Array, System

ROUNDS = 500
LONGEST_SHORTCUT = 40
SMALLEST_SAVING = 1e-6
# A share of the step: adding a displacement to a configuration rounds.
ARRIVED = 1e-6
CLASSIFIED_AT_ONCE = 16


@dataclass(frozen=True)
class Path:
    """States and the commands between them.

    Attributes
    ----------
    reduced : ndarray of shape (T + 1, reduced_dim)
    commands : ndarray of shape (T, command_dim)
    """

    reduced: Array
    commands: Array


@dataclass(frozen=True)
class _Steps:
    """States that were gone through, and the commands between them, maybe none."""

    reduced: Array
    commands: list[Array]


class RepropagatedShortcuts:
    """Makes plans shorter by straight lines, of which every transition is checked.

    Half of the lines are of the whole configuration; where the system has parts that move
    independently, the others are of one part, while the rest goes on as it did.

    A shortcut is taken if g allows every transition of it and of the plan's rest, the plan still
    ends in a goal, and every transition that is not bit by bit one of the old plan's is
    classified Reliable; and if together they are as likely to go well as those that they
    replace. Nothing is drawn: a shortcut that is tried again and again until a draw lets it pass
    would undo the bias.

    Parameters
    ----------
    system : System
    goals : ndarray of shape (n_goals, configuration_dim)
    check : CheckTransition
    rng : Generator
    """

    def __init__(
        self, system: System, goals: Array, check: CheckTransition, rng: np.random.Generator
    ) -> None:
        self._system = system
        self._dim = system.configuration_dim
        self._goals = goals
        self._check = check
        self._rng = rng

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
        doubted = negative_log_likelihood(
            self._check.probability(path.reduced[:-1], path.reduced[1:])
        )
        for _ in range(ROUNDS):
            if len(path.commands) < 2:
                break
            first, last = self._propose(len(path.reduced))
            way = self._shorter_way(path.reduced[first : last + 1, : self._dim], self._draw_part())
            if way is not None:
                better = self._with_shortcut(path, doubted, first, last, way)
                path, doubted = better or (path, doubted)
        return path

    def _propose(self, n_states: int) -> tuple[int, int]:
        first = int(self._rng.integers(n_states - 2))
        length = int(self._rng.integers(2, LONGEST_SHORTCUT + 1))
        return first, min(first + length, n_states - 1)

    def _draw_part(self) -> slice | None:
        parts = self._system.independent_parts
        drawn = int(self._rng.integers(2 * max(1, len(parts))))
        return parts[drawn] if drawn < len(parts) else None

    def _shorter_way(self, corners: Array, part: slice | None) -> Array | None:
        """Return configurations at most a step apart, or None if straightening saves nothing."""
        moves = shortest_way(corners[:-1], corners[1:], self._system.angular)
        line = corners[0] + np.concatenate([np.zeros((1, self._dim)), np.cumsum(moves, axis=0)])
        if part is None:
            straight = line[[0, -1]]
        else:
            others = np.delete(moves, np.arange(self._dim)[part], axis=1)
            straight = line.copy()
            ratio = _ratios(others)[:, None]
            straight[:, part] = line[0, part] + ratio * (line[-1, part] - line[0, part])
        travelled = np.linalg.norm(np.diff(straight, axis=0), axis=1).sum()
        if np.linalg.norm(moves, axis=1).sum() - travelled <= SMALLEST_SAVING:
            return None
        n_steps = max(1, int(np.ceil(travelled / self._system.step_size - ARRIVED)))
        return _resampled(straight, n_steps) if n_steps <= len(moves) else None

    def _with_shortcut(
        self, path: Path, doubted: Array, first: int, last: int, way: Array
    ) -> tuple[Path, Array] | None:
        """Return the plan with one shortcut and its transitions' costs, or None if not allowed."""
        shortcut = self._go(path.reduced[first], way)
        if shortcut is None:
            return None
        on_shortcut = self._doubts_if_reliable(shortcut)
        if on_shortcut is None:
            return None
        # What is carried differs behind the shortcut, until all is as it was.
        behind = path.reduced[last:]
        rest = self._go(shortcut.reduced[-1], behind[1:, : self._dim], behind)
        if rest is None:
            return None
        on_rest = self._doubts_if_reliable(rest)
        kept = last + len(rest.commands)
        if on_rest is None or on_shortcut.sum() + on_rest.sum() > doubted[first:kept].sum():
            return None
        reduced = [path.reduced[:first], shortcut.reduced, rest.reduced[1:]]
        commands = [*path.commands[:first], *shortcut.commands, *rest.commands]
        joined = Path(
            np.concatenate([*reduced, path.reduced[kept + 1 :]]),
            np.array([*commands, *path.commands[kept:]]),
        )
        if not self._system.goal_reached(joined.reduced[-1:], self._goals)[0]:
            return None
        return joined, np.concatenate([doubted[:first], on_shortcut, on_rest, doubted[kept:]])

    def _go(self, start: Array, way: Array, known: Array | None = None) -> _Steps | None:
        """Go from one configuration to the next; None where that is not allowed.

        Ends where a state is the one ``known`` before that configuration.
        """
        states: list[Array] = [start]
        commands: list[Array] = []
        for i, target in enumerate(way):
            if known is not None and np.array_equal(states[-1], known[i]):
                break
            step = self._step(states[-1], target)
            if step is None or not self._arrived(step[1], target):
                return None
            commands.append(step[0])
            states.append(step[1])
        return _Steps(np.array(states), commands)

    def _step(self, state: Array, target: Array) -> tuple[Array, Array] | None:
        command = self._system.steer(state[None], target[None])
        following, valid = self._system.propagate(state[None], command)
        return (command[0], following[0]) if valid[0] else None

    def _arrived(self, state: Array, target: Array) -> bool:
        gap = np.abs(shortest_way(state[: self._dim], target, self._system.angular)).max()
        return bool(gap <= ARRIVED * self._system.step_size)

    def _doubts_if_reliable(self, steps: _Steps) -> Array | None:
        """Return each transition's doubt, or None if one is not classified Reliable."""
        before, after = steps.reduced[:-1], steps.reduced[1:]
        doubted = np.zeros(len(before))
        for i in range(0, len(before), CLASSIFIED_AT_ONCE):
            part = slice(i, i + CLASSIFIED_AT_ONCE)
            reliable, probability = self._check.evaluate(before[part], after[part])
            if not reliable.all():
                return None
            doubted[part] = negative_log_likelihood(probability)
        return doubted


def _ratios(moves: Array) -> Array:
    """Share of the way travelled at each corner, from 0 to 1; evenly spaced if there is none."""
    lengths = np.linalg.norm(moves, axis=1)
    if lengths.sum() <= 0.0:
        lengths = np.ones(len(moves))
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    return travelled / travelled[-1]


def _resampled(line: Array, n_steps: int) -> Array:
    """Return the ends of steps of one length along a polyline, its last corner exactly."""
    at_corners = _ratios(np.diff(line, axis=0))
    at_ends = np.linspace(0.0, 1.0, n_steps + 1)[1:]
    columns = [np.interp(at_ends, at_corners, column) for column in line.T]
    return np.column_stack(columns)
