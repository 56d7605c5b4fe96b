"""Small systems for tests."""

from __future__ import annotations

import numpy as np

from systems import GoalRegion, Problem, Rollout, SimulationDivergedError, StopReason, System
from systems.angles import shortest_way, wrap_columns
from systems.validation import as_generator


class Disc(System):
    """A point in a square with a disc in its middle; the true point sticks in the right half.

    The rollout stops on the disc's rim and, where ``sticky``, moves half as far as commanded
    wherever x > 0.6.
    """

    reduced_dim = 2
    configuration_dim = 2
    step_size = 0.1
    bounds = np.array([[-1.0, -1.0], [1.0, 1.0]])
    radius = 0.4

    def __init__(self, sticky: bool = True) -> None:
        self.sticky = sticky

    def reduce(self, state):
        return np.array(state, dtype=np.float64)

    def propagate(self, reduced, command):
        following = reduced + command
        along = np.linspace(0, 1, 9)[:, None, None]
        way = reduced + along * command
        valid = (np.linalg.norm(way, axis=2) >= self.radius).all(axis=0)
        return following, valid

    def steer(self, reduced, configuration):
        way = configuration - reduced[:, :2]
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return way * np.minimum(1, self.step_size / np.maximum(length, 1e-300))

    def rollout(self, state, commands):
        states = [np.array(state, dtype=np.float64)]
        for i, command in enumerate(commands):
            moved = command * (0.5 if self.sticky and states[-1][0] > 0.6 else 1.0)
            following = states[-1] + moved
            if np.linalg.norm(following) < self.radius:
                states.append(self.radius * following / np.linalg.norm(following))
                return Rollout(states, i, StopReason.CONSTRAINT)
            states.append(following)
        return Rollout(states, len(commands), StopReason.COMPLETED)

    def close(self, predicted, executed):
        return np.linalg.norm(predicted - executed, axis=1) < 0.04

    def features(self, reduced, next_reduced):
        return np.hstack([reduced, 10 * (next_reduced - reduced)])

    def sample_problem(self, random_state=None):
        rng = as_generator(random_state)
        start, goal = (self._draw(rng) for _ in range(2))
        return Problem(start, goal[None])

    def goal_reached(self, reduced, goal):
        return (np.linalg.norm(reduced[:, None, :2] - goal[None], axis=2) < 1e-9).any(axis=1)

    def succeeded(self, state, goal, tolerance):
        return bool((np.linalg.norm(goal - state[:2], axis=1) < tolerance).any())

    def _draw(self, rng):
        while True:
            point = rng.uniform(*self.bounds)
            if np.linalg.norm(point) > 1.1 * self.radius:
                return point


class Odometer(Disc):
    """The disc world with the way travelled carried along in the reduced state."""

    reduced_dim = 3

    def reduce(self, state):
        return np.array([*state[:2], 0.0])

    def propagate(self, reduced, command):
        following, valid = super().propagate(reduced[:, :2], command)
        travelled = reduced[:, 2] + np.linalg.norm(command, axis=1)
        return np.column_stack([following, travelled]), valid

    def close(self, predicted, executed):
        return np.linalg.norm((predicted - executed)[:, :2], axis=1) < 0.04


class Turntable(Disc):
    """A table that turns and slides along a rail; its problems start near the angle π."""

    bounds = np.array([[-np.pi, -1.0], [np.pi, 1.0]])
    angular = (0,)

    def propagate(self, reduced, command):
        return wrap_columns(reduced + command, self.angular), np.ones(len(reduced), dtype=bool)

    def steer(self, reduced, configuration):
        return super().steer(np.zeros_like(reduced), shortest_way(reduced, configuration, (0,)))

    def rollout(self, state, commands):
        states = np.vstack([state, state + np.cumsum(commands, axis=0)])
        return Rollout(wrap_columns(states, self.angular), len(commands), StopReason.COMPLETED)

    def sample_problem(self, random_state=None):
        rng = as_generator(random_state)
        return Problem(np.array([np.pi - 0.01, rng.uniform(-1, 1)]), rng.uniform(-1, 1, (1, 2)))


class Unstable(Disc):
    """The disc world in a simulator that diverges above y = 0.5."""

    def rollout(self, state, commands):
        rollout = super().rollout(state, commands)
        if max(point[1] for point in rollout.states) > 0.5:
            raise SimulationDivergedError("y is more than the simulator bears.")
        return rollout


class RightOf(GoalRegion):
    """All configurations at or beyond an x; half of the draws lie out of the disc world."""

    def __init__(self, x):
        self.x = x

    def sample(self, rng, n):
        return rng.uniform([self.x, -2.0], [1.0, 2.0], size=(n, 2))

    def distance(self, configurations):
        return np.maximum(self.x - configurations[:, 0], 0)


class Shore(Disc):
    """The disc world, from the left of whose problems it has to be crossed to a region."""

    def __init__(self, x=0.8, sticky=False):
        super().__init__(sticky)
        self.x = x

    def sample_problem(self, random_state=None):
        rng = as_generator(random_state)
        return Problem(rng.uniform([-0.9, -0.9], [-0.5, 0.9]), RightOf(self.x))
