"""A tractor that pulls a trailer among pillars, planned for as if it had no trailer."""

from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from systems import (
    MujocoObstacles,
    Problem,
    Rollout,
    StopReason,
    System,
    from_body_frame,
    motion_in_body_frame,
    mujoco_shapes,
)

MODEL_FILE = Path(__file__).with_name("tractor_trailer.xml")
# The distance of points, shape (..., 2), from the nearest pillar or wall.
free_space = MujocoObstacles(MODEL_FILE, ignore=["floor"], height=0.3)
ROOM = 6.0  # metres along each wall
TRACTOR_RADIUS, TRACK, WHEEL_RADIUS = 0.32, 0.32, 0.1  # metres
TOP_SPEED, TOP_TURN_RATE, LONGEST_COMMAND = 0.6, 1.5, 3.0  # m/s, rad/s and s
# Where the features measure the free space, in the tractor's frame: ahead and left.
SENSED = np.array([(a, b) for a in (-0.8, -0.4, 0, 0.4) for b in (-0.5, 0, 0.5)])


def state_at_rest(x, y, heading):
    """Return the true state with the trailer straight behind the tractor."""
    pose = [x, y, WHEEL_RADIUS, np.cos(heading / 2), 0, 0, np.sin(heading / 2)]
    return np.array([*pose, *[0] * 16])


class TractorTrailer(System):
    """A two-wheeled tractor and its trailer in a room, told to drive to one point after another.

    A true state holds MuJoCo's positions and velocities; reduced, it is the tractor's x, y and
    heading, of which planners steer x and y. The reduced model turns and drives straight to the
    commanded point. The trailer is what it ignores: it cuts corners and hits pillars.
    """

    reduced_dim, configuration_dim = 3, 2
    step_size = 0.4
    bounds = np.array([[0.35, 0.35], [ROOM - 0.35, ROOM - 0.35]])
    view_from = (0.0, -0.4, 1.0)  # for pictures: from above, over the walls
    feature_names_out = ["ahead", "left", "sin_of_turn", "cos_of_turn"] + [
        f"space_{a:+}_ahead_{b:+}_left" for a, b in SENSED
    ]

    def __getstate__(self):
        return {}  # Pickles leave MuJoCo's model out: each process makes its own.

    @cached_property
    def _model(self):
        return mujoco.MjModel.from_xml_path(str(MODEL_FILE))

    def reduce(self, state):
        x, y, _, qw, _, _, qz = state[:7]
        return np.array([x, y, 2 * np.arctan2(qz, qw)])

    def propagate(self, reduced, command):
        way = command - reduced[:, :2]
        heading = np.where(way.any(axis=1), np.arctan2(way[:, 1], way[:, 0]), reduced[:, 2])
        along = reduced[:, None, :2] + np.linspace(0, 1, 9)[:, None] * way[:, None]
        return np.column_stack([command, heading]), (free_space(along) > TRACTOR_RADIUS).all(axis=1)

    def steer(self, reduced, configuration):
        way = configuration - reduced[:, :2]
        share = self.step_size / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        return np.where(share < 1, reduced[:, :2] + share * way, configuration)

    def rollout(self, state, commands):
        states = [np.array(state)]
        for n_completed, target in enumerate(commands):
            following, touches = self._drive(states[-1], target)
            states.append(following)
            if touches:
                return Rollout(states, n_completed, StopReason.CONSTRAINT)
        return Rollout(states, len(commands), StopReason.COMPLETED)

    def _drive(self, state, target):
        """Carry out one command; return the last state free of contact, and whether one came."""
        data = mujoco.MjData(self._model)
        data.qpos, data.qvel = np.split(state, [self._model.nq])
        while data.time < LONGEST_COMMAND:
            *position, heading = self.reduce(state)
            gap = complex(*(target - position))
            if abs(gap) < 0.03:
                break
            error = np.angle(gap * np.exp(-1j * heading))
            speed = TOP_SPEED * max(0, np.cos(error)) ** 3
            turn_rate = min(max(4 * error, -TOP_TURN_RATE), TOP_TURN_RATE)
            data.ctrl = (speed + np.array([-0.5, 0.5]) * TRACK * turn_rate) / WHEEL_RADIUS
            mujoco.mj_step(self._model, data, nstep=2)
            if (data.contact.geom > 0).all(axis=1).any():  # Geom 0 is the floor.
                return state, True
            state = np.concatenate([data.qpos, data.qvel])
        return state, False

    def _drawn(self, state, moving):
        data = mujoco.MjData(self._model)
        data.qpos = state[: self._model.nq]
        return mujoco_shapes(self._model, data, moving=moving)

    def draw(self, reduced):
        """Return tractor and trailer as if the trailer were straight behind."""
        return self._drawn(state_at_rest(*reduced), moving=True)

    def draw_state(self, state):
        return self._drawn(state, moving=True)

    def draw_scene(self):
        return self._drawn(state_at_rest(0, 0, 0), moving=False)

    def traced_points(self, configurations):
        return np.insert(configurations, 2, WHEEL_RADIUS, axis=1)[:, None]

    def close(self, predicted, executed):
        gap = predicted - executed
        return (np.linalg.norm(gap[:, :2], axis=1) < 0.15) & (np.cos(gap[:, 2]) > np.cos(0.5))

    def features(self, reduced, next_reduced):
        """Describe the motion and the free space around, as seen from the tractor."""
        motion = motion_in_body_frame(reduced, next_reduced) / [*[self.step_size] * 2, 1, 1]
        space = np.minimum(free_space(from_body_frame(reduced, SENSED)), 1)
        return np.hstack([motion, space])

    def sample_problem(self, random_state=None):
        """Draw a start at rest, the trailer straight behind, and a point roughly ahead."""
        rng = np.random.default_rng(random_state)
        while True:
            start, goal = rng.uniform(*self.bounds, size=(2, 2))
            heading = np.arctan2(*(goal - start)[::-1]) + rng.uniform(-1.4, 1.4)
            behind = np.outer([0, -0.4, -0.8, -1.1], [np.cos(heading), np.sin(heading)])
            free = free_space(np.vstack([start + behind, goal])) > 0.4
            if free.all() and np.linalg.norm(goal - start) > 3:
                return Problem(state_at_rest(*start, heading), goal[None])

    def goal_reached(self, reduced, goal):
        return (np.linalg.norm(reduced[:, None, :2] - goal, axis=2) < 1e-6).any(axis=1)

    def succeeded(self, state, goal, tolerance):
        return bool((np.linalg.norm(goal - state[:2], axis=1) < tolerance).any())
