"""The paper's illustrative system: a car that is planned for as if it could move any way."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.angles import shortest_way
from systems.car.dynamics import (
    LONGEST_COMMAND,
    MAX_SPEED,
    TIME_STEP,
    execute_commands,
    execute_rows,
    trace_commands,
)
from systems.car.features import transition_features
from systems.car.geometry import clearances, limited_ways, straight_moves
from systems.car.scenes import SCENES, CarScene, pack_scene
from systems.system import Array, Problem, Rollout, StopReason, System
from systems.validation import RandomState, as_finite_array, as_generator

STEP_SIZE = 1.0
CLOSE_DISTANCE = 0.15
GOAL_DISTANCE = CLOSE_DISTANCE
ROOM_AT_ENDS = 0.05


class Car(System):
    """A car in a walled lot, planned for as if it could move in any direction.

    The true state is [x, y, θ, v, φ]: the middle of the rear axle (metres), the heading
    (radians, [-π, π)), the speed (m/s, negative in reverse) and the steering angle (radians).
    The reduced state is the pose [x, y, θ], a command a displacement [Δx, Δy, Δθ] of it in the
    scene's frame, and g(b, u) = b + u wherever the footprint touches nothing on the straight
    way. The footprint is everything within 0.15 m of the 0.3 m between the axles. Distances
    between poses count a radian as a metre and angles the short way round.

    The true car accelerates by 2 m/s² at most, turns its wheels by 6 rad/s up to 0.55 rad, and
    has grip for 2 m/s² across. Γ steers it towards the pose that it is at plus the displacement,
    forwards or backwards, whichever way the displacement points, at 1.2 m/s or what the bend
    allows, and means to be at 0.3 m/s at its target. It ends where the car passes the target, at
    whatever speed it then has, or after 4 s, and the next command begins at that speed.

    Two poses are Close less than 0.15 m apart: a quarter of the car's length, so that a command
    to go sideways is Unreliable at once, and a plan's small errors are not.

    Parameters
    ----------
    scene : str or CarScene, default="open_lot"
        "open_lot", "slalom", "narrow_gate" or a scene of your own.

    Attributes
    ----------
    scene : CarScene
    step_size : float
        1 m.

    Raises
    ------
    ValueError
        If there is no such scene.

    References
    ----------
    McConachie et al. 2020, "An Illustrative Navigation Example".

    Examples
    --------
    >>> import numpy as np
    >>> from systems import Car
    >>> car = Car("slalom")
    >>> forwards = np.array([[0.5, 0.0, 0.0]])
    >>> slow, fast = car.execute([[0.6, 3, 0, 0.2, 0], [0.6, 3, 0, 2.5, 0]], forwards)[0]
    >>> slow[3] < fast[3]
    True
    """

    reduced_dim = 3
    configuration_dim = 3
    angular = (2,)
    step_size = STEP_SIZE

    def __init__(self, scene: str | CarScene = "open_lot") -> None:
        if isinstance(scene, str):
            if scene not in SCENES:
                raise ValueError(f"scene must be one of {', '.join(SCENES)}, got {scene!r}.")
            scene = SCENES[scene]
        if not isinstance(scene, CarScene):
            raise ValueError(f"scene must be a scene's name or a CarScene, got {scene!r}.")
        self.scene = scene
        self._packed = pack_scene(scene)
        x_min, y_min, x_max, y_max = scene.bounds
        self.bounds = np.array([[x_min, y_min, -np.pi], [x_max, y_max, np.pi]])

    def reduce(self, state: Any) -> Array:
        """Return the pose of a true state: r."""
        return as_finite_array(state, "state", (5,))[:3].copy()

    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Predict b + u, valid where the footprint touches nothing on the straight way: g."""
        _check_rows(reduced, command)
        return straight_moves(reduced, command, *self._packed)

    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return the displacement of at most one step towards a pose, the short way round."""
        _check_rows(reduced, configuration)
        return limited_ways(reduced, configuration, self.step_size)

    def rollout(self, state: Any, commands: ArrayLike) -> Rollout:
        """Drive one displacement after the other: Γ.

        Parameters
        ----------
        state : ndarray of shape (5,)
        commands : ndarray of shape (T, 3)

        Returns
        -------
        Rollout
            ``states`` is an ndarray of shape (n, 5). A state at a boundary is a millimetre away
            from it and has the speed at which the car got there.

        Raises
        ------
        ValueError
            If the state or a command has the wrong shape or is not finite, or the car touches
            something at its start.
        """
        start = self._checked_states(as_finite_array(state, "state", (5,))[None])[0]
        moves = as_finite_array(commands, "commands", (None, 3))
        states = np.empty((len(moves) + 1, 5))
        n_completed = execute_commands(start, moves, *self._packed, states)
        completed = n_completed == len(moves)
        reason = StopReason.COMPLETED if completed else StopReason.CONSTRAINT
        return Rollout(states[: n_completed + (1 if completed else 2)], n_completed, reason)

    def execute(self, states: ArrayLike, commands: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Carry out one command from each state: Γ, row by row.

        Parameters
        ----------
        states : ndarray of shape (n, 5)
        commands : ndarray of shape (n, 3)

        Returns
        -------
        next_states : ndarray of shape (n, 5)
        completed : ndarray of bool of shape (n,)
            False where the car came to a boundary.

        Raises
        ------
        ValueError
            As :meth:`rollout`.
        """
        starts = self._checked_states(as_finite_array(states, "states", (None, 5)))
        moves = as_finite_array(commands, "commands", (len(starts), 3))
        return execute_rows(starts, moves, *self._packed)

    def trace(self, state: ArrayLike, commands: ArrayLike) -> Array:
        """Return the states of a rollout every 0.01 s, shape (n, 5), for pictures."""
        start = self._checked_states(as_finite_array(state, "state", (5,))[None])[0]
        moves = as_finite_array(commands, "commands", (None, 3))
        states = np.empty((1 + len(moves) * (1 + round(LONGEST_COMMAND / TIME_STEP)), 5))
        return states[: trace_commands(start, moves, *self._packed, states)]

    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say whether poses are less than α = 0.15 (m, rad) apart: Close."""
        return self.distance(predicted, executed) < CLOSE_DISTANCE

    def distance(self, one: Array, other: Array) -> Array:
        """Return the distances between poses, (n, 3), with angles the short way round."""
        _check_rows(one, other)
        return np.linalg.norm(shortest_way(one, other, self.angular), axis=1)

    def clearance(self, poses: Array) -> Array:
        """Return how far the footprint is from everything at each pose, in metres."""
        _check_rows(poses)
        return clearances(poses, *self._packed)

    def features(self, reduced: Array, next_reduced: Array) -> Array:
        """Return (n, 37) rows: the displacement and what is near, in the car's frame."""
        _check_rows(reduced, next_reduced)
        return transition_features(reduced, next_reduced, *self._packed)

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a pose to go to, and a start at up to 2 m/s from which the car can still stop."""
        rng = as_generator(random_state)
        while True:
            pose = self._draw_free_pose(rng)
            start = np.array([*pose, rng.uniform(0, MAX_SPEED), 0.0])
            if self.execute(start[None], np.zeros((1, 3)))[1][0]:
                return Problem(start, self._draw_free_pose(rng)[None])

    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether a pose is Close to one of the goal's: Goal_B."""
        _check_rows(reduced, goal)
        gaps = shortest_way(reduced[:, None], goal[None], self.angular)
        return (np.linalg.norm(gaps, axis=2) < GOAL_DISTANCE).any(axis=1)

    def succeeded(self, state: Any, goal: ArrayLike, tolerance: float) -> bool:
        """Say whether the car is less than ``tolerance`` (m, rad) from one of the goal's poses."""
        poses = as_finite_array(goal, "goal", (None, 3))
        return bool((self.distance(self.reduce(state)[None], poses) < tolerance).any())

    def _draw_free_pose(self, rng: np.random.Generator) -> Array:
        while True:
            low, high = self.bounds
            pose = rng.uniform(low, high)
            if self.clearance(pose[None])[0] > ROOM_AT_ENDS:
                return pose

    def _checked_states(self, states: Array) -> Array:
        inside = clearances(states[:, :3], *self._packed) <= 0
        if inside.any():
            raise ValueError(f"The car must not touch anything, and does at {states[inside][0]}.")
        return states


def _check_rows(*arrays: Array) -> None:
    for array in arrays:
        if getattr(array, "ndim", 0) != 2 or array.shape[1] != 3:
            raise ValueError(
                "Poses and displacements must be rows of x, y and θ, an array of shape (n, 3), "
                f"got {np.shape(array)}."
            )
