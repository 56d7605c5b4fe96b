"""The system of the paper's illustrative example: a car in a lot with obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.angles import shortest_way, wrap_columns
from systems.car.drawing import drawn_car, drawn_goal, drawn_scene, traced_axle
from systems.car.dynamics import (
    LONGEST_COMMAND,
    MAX_SPEED,
    TIME_STEP,
    execute_commands,
    execute_rows,
    trace_commands,
)
from systems.car.features import FEATURE_NAMES, transition_features
from systems.car.geometry import (
    CAR_RADIUS,
    WHEELBASE,
    clearances,
    limited_ways,
    straight_moves,
)
from systems.car.scenes import SCENES, CarScene, pack_scene
from systems.drawing.shapes import Shape
from systems.system import Array, Problem, Rollout, StopReason, System
from systems.validation import (
    RandomState,
    as_finite_array,
    as_generator,
    as_row_pair,
    as_rows,
    check_choice,
    check_number,
)

STEP_SIZE = 1.0
CLOSE_DISTANCE = 0.15
GOAL_DISTANCE = CLOSE_DISTANCE
# The least clearance of the starts and goals that are drawn, in metres.
ROOM_AT_ENDS = 0.05
_MOST_DRAWS = 10_000
ROWS = "poses or displacements [x, y, θ]"


class Car(System):
    """A car in a walled lot, planned for as if it could move in any direction.

    The true state is [x, y, θ, v, φ]: the middle of the rear axle (metres), the heading
    (radians, [-π, π)), the speed (m/s, negative in reverse) and the steering angle (radians).
    The reduced state is the pose [x, y, θ]. A command is a displacement [Δx, Δy, Δθ] of the pose
    in the scene's frame, and g(b, u) = b + u is valid if the car touches nothing while its pose
    changes in proportion from b to b + u. The car's footprint is everything within 0.15 m of the
    segment of 0.3 m between its axles. Distances between poses count a radian as a metre, and
    angles by the shorter way around the circle.

    The true car accelerates and brakes by 2 m/s² at most, turns its wheels at 6 rad/s up to
    0.55 rad, and slides if it would need more than 2 m/s² across. Γ drives it to the pose where it
    is plus the displacement, forwards or backwards as the displacement points, at 1.2 m/s or
    slower in curves, and slows down to 0.3 m/s at the target. A command ends when the car passes
    the target, or after 4 s; the next command starts with the speed that the car then has.

    Two poses are Close if they are less than 0.15 (m, rad) apart. That is a quarter of the car's
    length: less than a command to go sideways misses its target by, and more than the small
    errors of commands that the car can follow.

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
    >>> forwards = np.array([[0.5, 0.0, 0.0]] * 2)
    >>> slow, fast = car.execute([[0.6, 3, 0, 0.2, 0], [0.6, 3, 0, 2.5, 0]], forwards)[0]
    >>> bool(slow[3] < fast[3])
    True
    """

    reduced_dim = 3
    configuration_dim = 3
    angular = (2,)
    step_size = STEP_SIZE
    feature_names_out = FEATURE_NAMES
    view_from = (0.0, -0.5, 1.0)

    def __init__(self, scene: str | CarScene = "open_lot") -> None:
        if isinstance(scene, str):
            check_choice(scene, "scene", SCENES)
            scene = SCENES[scene]
        if not isinstance(scene, CarScene):
            raise ValueError(f"scene must be a scene's name or a CarScene, got {scene!r}.")
        self.scene = scene
        self._packed = pack_scene(scene)
        x_min, y_min, x_max, y_max = scene.bounds
        self.bounds = np.array([[x_min, y_min, -np.pi], [x_max, y_max, np.pi]])

    def __repr__(self) -> str:
        return f"Car({len(self.scene.obstacles)} obstacles, bounds={self.scene.bounds})"

    def reduce(self, state: Any) -> Array:
        """Return the pose of a true state, its heading in [-π, π): r."""
        return wrap_columns(as_finite_array(state, "state", (5,))[:3], self.angular)

    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Predict b + u, valid if the car touches nothing on the way: g."""
        reduced, command = as_row_pair(ROWS, 3, reduced=reduced, command=command)
        return straight_moves(reduced, command, self._packed)

    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return the displacement towards a pose, at most one step long."""
        reduced, configuration = as_row_pair(ROWS, 3, reduced=reduced, configuration=configuration)
        return limited_ways(reduced, configuration, self.step_size)

    def rollout(self, state: Any, commands: ArrayLike) -> Rollout:
        """Drive displacements one after the other: Γ.

        Parameters
        ----------
        state : ndarray of shape (5,)
        commands : ndarray of shape (T, 3)

        Returns
        -------
        Rollout
            ``states`` is an ndarray of shape (n, 5). If the car came to an obstacle or a wall, the
            last state is a millimetre away from it, at the speed with which the car came.

        Raises
        ------
        ValueError
            If the state or a command has the wrong shape or is not finite, or if the car touches
            something at the start.
        """
        start = self._checked_states(as_finite_array(state, "state", (5,))[None], "state")[0]
        moves = as_finite_array(commands, "commands", (None, 3))
        states = np.empty((len(moves) + 1, 5))
        n_completed = execute_commands(start, moves, self._packed, states)
        completed = n_completed == len(moves)
        reason = StopReason.COMPLETED if completed else StopReason.CONSTRAINT
        return Rollout(states[: n_completed + (1 if completed else 2)], n_completed, reason)

    def execute(self, states: ArrayLike, commands: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Drive one displacement from each of many states: Γ.

        Parameters
        ----------
        states : ndarray of shape (n, 5)
        commands : ndarray of shape (n, 3)

        Returns
        -------
        next_states : ndarray of shape (n, 5)
        completed : ndarray of bool of shape (n,)
            False where the car came to an obstacle or a wall.

        Raises
        ------
        ValueError
            As :meth:`rollout`.
        """
        starts = self._checked_states(as_finite_array(states, "states", (None, 5)), "states")
        moves = as_finite_array(commands, "commands", (len(starts), 3))
        return execute_rows(starts, moves, self._packed)

    def trace(self, state: ArrayLike, commands: ArrayLike) -> Array:
        """Return the states of a rollout every 0.01 s, for pictures.

        Parameters
        ----------
        state : ndarray of shape (5,)
        commands : ndarray of shape (T, 3)

        Returns
        -------
        states : ndarray of shape (n, 5)
        """
        start = self._checked_states(as_finite_array(state, "state", (5,))[None], "state")[0]
        moves = as_finite_array(commands, "commands", (None, 3))
        states = np.empty((1 + len(moves) * (1 + round(LONGEST_COMMAND / TIME_STEP)), 5))
        return states[: trace_commands(start, moves, self._packed, states)]

    def outline(self, pose: ArrayLike) -> Array:
        """Return the edge of the footprint at a pose, counter-clockwise, for pictures.

        Parameters
        ----------
        pose : array-like of shape (3,)
            x, y and θ; the entries of a longer array, such as a true state, are not read.

        Returns
        -------
        outline : ndarray of shape (43, 2)
            x and y, in metres, in the scene's frame; the last point is the first again.
        """
        numbers = as_finite_array(pose, "pose", (None,))
        if len(numbers) < 3:
            raise ValueError(f"pose must hold x, y and θ, got {numbers.tolist()}.")
        x, y, heading = numbers[:3]
        rear, front = np.linspace([np.pi / 2, -np.pi / 2], [3 * np.pi / 2, np.pi / 2], 21).T
        around = np.concatenate([rear, front, rear[:1]])
        axle = np.repeat([0.0, WHEELBASE, 0.0], [21, 21, 1])
        own = np.column_stack([axle, np.zeros_like(axle)])
        own += CAR_RADIUS * np.column_stack([np.cos(around), np.sin(around)])
        turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        return np.array([x, y]) + own @ turn

    def draw(self, reduced: Array) -> list[Shape]:
        """Return the car at a pose, its front darker."""
        return drawn_car(self.outline(np.zeros(3))[:-1], reduced)

    def draw_scene(self) -> list[Shape]:
        """Return the ground, the walls and the obstacles."""
        return drawn_scene(self.scene)

    def draw_goal(self, configuration: Array) -> list[Shape]:
        """Return the footprint at a goal's pose, and which way it points."""
        return drawn_goal(self.outline(configuration), configuration)

    def traced_points(self, configurations: Array) -> Array:
        """Return the middle of the rear axle."""
        return traced_axle(configurations)

    def states_between(self, state: Any, command: Array) -> Array:
        """Return the states every 0.01 s on the way of one command."""
        return self.trace(state, command[None])

    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say for each row whether two poses are less than α = 0.15 (m, rad) apart: Close."""
        predicted, executed = as_row_pair(ROWS, 3, predicted=predicted, executed=executed)
        return self.distance(predicted, executed) < CLOSE_DISTANCE

    def distance(self, one: Array, other: Array) -> Array:
        """Return the distance between the two poses of each row (m, rad).

        Parameters
        ----------
        one, other : ndarray of shape (n, 3)

        Returns
        -------
        distance : ndarray of shape (n,)
        """
        one, other = as_row_pair(ROWS, 3, one=one, other=other)
        return np.linalg.norm(shortest_way(one, other, self.angular), axis=1)

    def clearance(self, poses: Array) -> Array:
        """Return the footprint's distance from obstacles and walls, negative inside them.

        Parameters
        ----------
        poses : ndarray of shape (n, 3)

        Returns
        -------
        clearance : ndarray of shape (n,)
            In metres.
        """
        (poses,) = as_rows(ROWS, 3, poses=poses)
        return clearances(poses, self._packed)

    def features(self, reduced: Array, next_reduced: Array) -> Array:
        """Return the displacement and what is near, in the car's frame, as (n, 37) numbers.

        They do not depend on where in the scene the car is, so that an estimator serves any scene.
        See :func:`systems.car.features.transition_features` for the columns.
        """
        reduced, next_reduced = as_row_pair(ROWS, 3, reduced=reduced, next_reduced=next_reduced)
        return transition_features(reduced, next_reduced, self._packed)

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a goal pose, and a start at up to 2 m/s from which the car can brake in time."""
        rng = as_generator(random_state)
        for _ in range(_MOST_DRAWS):
            pose = self._draw_free_pose(rng)
            start = np.array([*pose, rng.uniform(0, MAX_SPEED), 0.0])
            if self.execute(start[None], np.zeros((1, 3)))[1][0]:
                return Problem(start, self._draw_free_pose(rng)[None])
        raise ValueError(_no_room("place where a moving car could brake"))

    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say for each row whether a pose is Close to one of the goal's: Goal_B."""
        reduced, goal = as_rows(ROWS, 3, reduced=reduced, goal=goal)
        gaps = shortest_way(reduced[:, None], goal[None], self.angular)
        return (np.linalg.norm(gaps, axis=2) < GOAL_DISTANCE).any(axis=1)

    def succeeded(self, state: Any, goal: ArrayLike, tolerance: float) -> bool:
        """Say whether the car is less than ``tolerance`` (m, rad) from one of the goal's poses."""
        check_number(tolerance, "tolerance", 0, np.inf)
        poses = as_finite_array(goal, "goal", (None, 3))
        here = np.tile(self.reduce(state), (len(poses), 1))
        return bool((self.distance(here, poses) < tolerance).any())

    def _draw_free_pose(self, rng: np.random.Generator) -> Array:
        low, high = self.bounds
        for _ in range(_MOST_DRAWS):
            pose = rng.uniform(low, high)
            if self.clearance(pose[None])[0] > ROOM_AT_ENDS:
                return pose
        raise ValueError(_no_room("free pose"))

    def _checked_states(self, states: Array, name: str) -> Array:
        inside = clearances(states[:, :3], self._packed) <= 0
        if inside.any():
            raise ValueError(
                f"{name} must not touch anything, and the car does at {states[inside][0]}."
            )
        return states


def _no_room(wanted: str) -> str:
    return (
        f"scene must have room for a car, and none of {_MOST_DRAWS} poses was a {wanted}. Give it "
        "wider bounds or fewer obstacles."
    )
