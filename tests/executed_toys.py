"""A point that is planned for by going straight, and executions that go wrong in many ways."""

from types import SimpleNamespace

import numpy as np

from systems import Problem, Rollout, SimulationDivergedError, StopReason, System
from systems.validation import as_generator


class Point(System):
    """A point in a square of which g says that it goes where it is told, and so it does."""

    reduced_dim = configuration_dim = 2
    step_size = 0.1
    bounds = np.array([[-1.0, -1.0], [1.0, 1.0]])
    close_distance = 0.04

    def reduce(self, state):
        return np.array(state, dtype=np.float64)

    def propagate(self, reduced, command):
        return reduced + command, np.ones(len(reduced), dtype=bool)

    def steer(self, reduced, configuration):
        way = configuration - reduced
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return way * np.minimum(1, self.step_size / np.maximum(length, 1e-300))

    def move(self, state, command):
        """Return the next true state, and whether the command was completed."""
        return state + command, True

    def rollout(self, state, commands):
        states = [np.array(state, dtype=np.float64)]
        for i, command in enumerate(commands):
            following, completed = self.move(states[-1], command)
            states.append(following)
            if not completed:
                return Rollout(states, i, StopReason.CONSTRAINT)
        return Rollout(states, len(commands), StopReason.COMPLETED)

    def close(self, predicted, executed):
        return np.linalg.norm(predicted - executed, axis=1) < self.close_distance

    def features(self, reduced, next_reduced):
        return np.hstack([reduced, next_reduced])

    def sample_problem(self, random_state=None):
        start, goal = as_generator(random_state).uniform(-0.9, 0.9, (2, 2))
        return Problem(start, goal[None])

    def goal_reached(self, reduced, goal):
        return (np.linalg.norm(reduced[:, None] - goal[None], axis=2) < 1e-9).any(axis=1)

    def succeeded(self, state, goal, tolerance):
        return bool((np.linalg.norm(goal - state, axis=1) < tolerance).any())


class Slow(Point):
    """Moves half as far as it is told, everywhere."""

    def move(self, state, command):
        return state + 0.5 * command, True


class Peg(Point):
    """Has a peg in its middle of which g does not know; the point does not enter it."""

    close_distance = 0.05
    radius = 0.1

    def move(self, state, command):
        blocked = np.linalg.norm(state + command) < self.radius
        return (state if blocked else state + command), True


class StickyPeg(Peg):
    """The peg ends the rollout."""

    def move(self, state, command):
        following, _ = super().move(state, command)
        return following, bool((following != state).any())


class Wind(Point):
    """Blows the point out of its bounds beyond x = 0.3."""

    def move(self, state, command):
        gust = [0.9, 0.0] if state[0] > 0.3 else [0.0, 0.0]
        return state + command + gust, True


class Fragile(Point):
    """Its simulator diverges beyond x = 0."""

    def move(self, state, command):
        if state[0] + command[0] > 0:
            raise SimulationDivergedError("x is more than the simulator bears.")
        return super().move(state, command)


class Straight:
    """Plans straight to the first goal, if g allows it, and remembers its seeds."""

    def __init__(self, system=None, n_plans=10**6):
        self.system = system
        self.random_state = 0
        self.n_plans = n_plans
        self.seeds = []

    def plan(self, start_reduced, goal):
        self.seeds.append(self.random_state)
        path, commands, valid = [np.asarray(start_reduced)[None]], [], True
        while valid and not self.system.goal_reached(path[-1], goal)[0]:
            command = self.system.steer(path[-1], goal[:1])
            following, allowed = self.system.propagate(path[-1], command)
            valid = bool(allowed[0])
            path.append(following)
            commands.append(command)
        success = valid and len(self.seeds) <= self.n_plans
        commands = np.concatenate(commands) if success and commands else np.empty((0, 2))
        return SimpleNamespace(
            success=success,
            reduced=np.concatenate(path)[: len(commands) + 1],
            commands=commands,
            success_probability=0.5,
        )
