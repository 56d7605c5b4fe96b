"""A system of your own in PyBullet: a puck that is planned for as if there were no wall."""

import threading
import weakref

import numpy as np
import pybullet

from planners import BiasedRRTConnect
from reliability import collect_transitions
from systems import Problem, Rollout, StopReason, System, check_system


class Puck(System):  # configurations are x and y in metres, commands displacements
    reduced_dim, configuration_dim, step_size = 2, 2, 0.3
    bounds = np.array([[0.0, 0.0], [4.0, 4.0]])

    def __getstate__(self):  # pickles leave out the client, which no other process knows
        return {name: value for name, value in vars(self).items() if name != "_thread"}

    def _client(self):  # one for each thread, connected when a rollout first needs it
        thread = vars(self).setdefault("_thread", threading.local())
        if not hasattr(thread, "client"):
            thread.client = pybullet.connect(pybullet.DIRECT)
            weakref.finalize(thread, pybullet.disconnect, thread.client)
        return thread.client

    def rollout(self, state, commands):
        bullet, states = {"physicsClientId": self._client()}, [np.array(state)]
        pybullet.resetSimulation(**bullet)  # what was simulated before must leave no trace
        wall = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[0.05, 1.5, 1], **bullet
        )
        pybullet.createMultiBody(0, wall, basePosition=[2, 2.5, 0], **bullet)
        ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.1, **bullet)
        puck = pybullet.createMultiBody(1, ball, basePosition=[*state, 0], **bullet)
        for dx, dy in commands:
            pybullet.resetBaseVelocity(puck, [4 * dx, 4 * dy, 0], [0, 0, 0], **bullet)
            for _ in range(60):  # a quarter of a second
                pybullet.stepSimulation(**bullet)
            position, _ = pybullet.getBasePositionAndOrientation(puck, **bullet)
            states.append(np.array(position[:2]))
        return Rollout(states, len(commands), StopReason.COMPLETED)

    def reduce(self, state):
        return np.array(state)

    def propagate(self, reduced, command):
        return reduced + command, np.ones(len(reduced), dtype=bool)

    def steer(self, reduced, configuration):
        way = configuration - reduced
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return way * np.minimum(1, self.step_size / np.maximum(length, 1e-9))

    def close(self, predicted, executed):
        return np.linalg.norm(predicted - executed, axis=1) < 0.05

    def features(self, reduced, next_reduced):
        return np.hstack([reduced, (next_reduced - reduced) / self.step_size])

    def sample_problem(self, random_state=None):
        left, right = np.random.default_rng(random_state).uniform([0, 0], [1.5, 4], (2, 2))
        return Problem(left, np.array([4, 4]) - right[None])

    def goal_reached(self, reduced, goal):
        return (np.linalg.norm(reduced[:, None] - goal, axis=2) < 1e-6).any(axis=1)

    def succeeded(self, state, goal, tolerance):
        return bool((np.linalg.norm(goal - state, axis=1) < tolerance).any())


puck = Puck()
check_system(puck)  # also asks a copy of it in another process
data = collect_transitions(puck, BiasedRRTConnect(puck), 100, n_jobs=2, random_state=0)
print(f"{len(data)} transitions, {1 - data.y.mean():.0%} of them Unreliable")
