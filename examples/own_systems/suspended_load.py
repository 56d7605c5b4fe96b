"""A load on the cable of an overhead crane, planned for as if it hung still all the time."""

from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from systems import MujocoObstacles, Problem, Rollout, StopReason, System, mujoco_shapes

MODEL_FILE = Path(__file__).with_name("suspended_load.xml")
free_space = MujocoObstacles(MODEL_FILE)  # of points, shape (..., 3): stacks and floor
TROLLEY_HEIGHT, LOAD_RADIUS = 4.0, 0.2  # metres
COMMAND_DURATION, CONTROL_PERIOD = 1.0, 0.1  # seconds
MUJOCO_STEPS = 5  # of 0.02 s in each control period
# Where the features measure the free space around the load.
SENSED = 0.4 * np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, -1]])
# Problems start and end down here; higher up there is room to travel.
LOW_PLACES = np.array([[0.3, 0.3, 0.3], [7.7, 5.7, 2.2]])


class SuspendedLoad(System):
    """A load that hangs from a trolley and is carried over and around stacks.

    A true state holds MuJoCo's positions and velocities; reduced, it is the load's x, y and z. A
    command is the place where the load is to hang next: trolley and hoist set off gently and stop
    there within a second. The reduced model moves the load there straight. It ignores that the load
    swings, the wider the longer the cable, and may run into stacks or be elsewhere at the end.
    """

    reduced_dim = configuration_dim = 3
    step_size = 0.6
    bounds = np.array([[0.3, 0.3, 0.3], [7.7, 5.7, 3.5]])
    feature_names_out = ["height", "motion_x", "motion_y", "motion_z", "motion_horizontal"] + [
        f"space_{side}" for side in ("here", "east", "west", "north", "south", "below")
    ]

    def __getstate__(self):
        return {}  # Pickles leave MuJoCo's model out: each process makes its own.

    @cached_property
    def _model(self):
        return mujoco.MjModel.from_xml_path(str(MODEL_FILE))

    def reduce(self, state):
        x, y, swing_x, swing_y, cable = state[:5]
        hanging = np.array([np.sin(swing_x), np.tan(swing_y), -np.cos(swing_x)]) * np.cos(swing_y)
        return np.array([x, y, TROLLEY_HEIGHT]) + cable * hanging

    def propagate(self, reduced, command):
        along = reduced[:, None] + np.linspace(0, 1, 9)[:, None] * (command - reduced)[:, None]
        return command.copy(), (free_space(along) > LOAD_RADIUS).all(axis=1)

    def steer(self, reduced, configuration):
        way = configuration - reduced
        share = self.step_size / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        return np.where(share < 1, reduced + share * way, configuration)

    def rollout(self, state, commands):
        states = [np.array(state)]
        for n_completed, target in enumerate(commands):
            following, touches = self._carry(states[-1], target)
            states.append(following)
            if touches:
                return Rollout(states, n_completed, StopReason.CONSTRAINT)
        return Rollout(states, len(commands), StopReason.COMPLETED)

    def _carry(self, state, target):
        """Carry out one command; return the last state free of contact, and whether one came."""
        data = mujoco.MjData(self._model)
        data.qpos, data.qvel = np.split(state, [self._model.nq])
        start = state[[0, 1, 4]]
        end = np.array([target[0], target[1], TROLLEY_HEIGHT - target[2]])
        for share in np.linspace(0, 1, round(COMMAND_DURATION / CONTROL_PERIOD) + 1)[1:]:
            data.ctrl = start + share**2 * (3 - 2 * share) * (end - start)
            mujoco.mj_step(self._model, data, nstep=MUJOCO_STEPS)
            if data.ncon:
                return state, True
            state = np.concatenate([data.qpos, data.qvel])
        return state, False

    def _drawn(self, state, moving):
        data = mujoco.MjData(self._model)
        data.qpos = state[: self._model.nq]
        return mujoco_shapes(self._model, data, moving=moving)

    def draw(self, reduced):
        """Return crane and load as if the load hung still."""
        return self._drawn([*reduced[:2], 0, 0, TROLLEY_HEIGHT - reduced[2]], moving=True)

    def draw_state(self, state):
        return self._drawn(state, moving=True)

    def draw_scene(self):
        return self._drawn(np.zeros(5), moving=False)

    def traced_points(self, configurations):
        return configurations[:, None]

    def close(self, predicted, executed):
        return np.linalg.norm(predicted - executed, axis=1) < 0.15

    def features(self, reduced, next_reduced):
        """Describe the height, the motion, and how much space is around its end."""
        motion = (next_reduced - reduced) / self.step_size
        horizontal = np.linalg.norm(motion[:, :2], axis=1)
        space = np.minimum(free_space(next_reduced[:, None] + SENSED), 1)
        return np.column_stack([reduced[:, 2], motion, horizontal, space])

    def sample_problem(self, random_state=None):
        """Draw a place where the load hangs still, and one to carry it to."""
        rng = np.random.default_rng(random_state)
        while True:
            start, goal = rng.uniform(*LOW_PLACES, size=(2, 3))
            free = free_space(np.stack([start, goal])) > 0.35
            if free.all() and np.linalg.norm(goal - start) > 3:
                cable = TROLLEY_HEIGHT - start[2]
                return Problem(np.array([*start[:2], 0, 0, cable, *[0] * 5]), goal[None])

    def goal_reached(self, reduced, goal):
        return (np.linalg.norm(reduced[:, None] - goal, axis=2) < 1e-6).any(axis=1)

    def succeeded(self, state, goal, tolerance):
        return bool((np.linalg.norm(goal - self.reduce(state), axis=1) < tolerance).any())
