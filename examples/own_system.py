"""A system of your own: a point that is planned for as if there were no wind."""

import numpy as np

from planners import BiasedRRTConnect
from reliability import TransitionReliabilityClassifier, collect_transitions
from systems import Problem, Rollout, StopReason, System, check_system


class WindyPoint(System):
    reduced_dim = configuration_dim = 2  # x and y, in metres
    step_size = 0.3
    bounds = np.array([[0.0, 0.0], [4.0, 4.0]])

    def reduce(self, state):
        return np.array(state, dtype=float)

    def propagate(self, reduced, command):  # the model to plan with, for many rows at a time
        return reduced + command, np.ones(len(reduced), dtype=bool)

    def rollout(self, state, commands):  # what truly happens
        states = [state]
        for command in commands:
            windy = 1.5 < states[-1][1] < 2.5 and states[-1][0] < 2.5
            states.append(states[-1] + command + np.array([0.2 * windy, 0.0]))
        return Rollout(states, len(commands), StopReason.COMPLETED)

    def steer(self, reduced, configuration):
        way = configuration - reduced
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return way * np.minimum(1, self.step_size / np.maximum(length, 1e-9))

    def close(self, predicted, executed):
        return np.linalg.norm(predicted - executed, axis=1) < 0.1

    def features(self, reduced, next_reduced):
        return np.hstack([reduced, (next_reduced - reduced) / self.step_size])

    def sample_problem(self, random_state=None):
        start, goal = np.random.default_rng(random_state).uniform(0, 4, (2, 2))
        return Problem(start, goal[None])

    def goal_reached(self, reduced, goal):
        return (np.linalg.norm(reduced[:, None] - goal[None], axis=2) < 1e-6).any(axis=1)

    def succeeded(self, state, goal, tolerance):
        return bool((np.linalg.norm(goal - state, axis=1) < tolerance).any())


point = WindyPoint()
check_system(point)  # names the first method that planners could not use
data = collect_transitions(point, BiasedRRTConnect(point), 400, n_jobs=2, random_state=0)
classifier = TransitionReliabilityClassifier(random_state=0)
classifier.fit(data.features(point), data.y, groups=data.plan)
start, goal = np.array([0.5, 1.0]), np.array([[0.5, 3.0]])
for name, estimator in (("without", None), ("with", classifier)):
    plan = BiasedRRTConnect(point, estimator, k=10, random_state=0).plan(start, goal)
    end = point.rollout(start, plan.commands).states[-1]
    print(f"{name} the classifier, the point ends at {end.round(2)} for a goal of {goal[0]}")
