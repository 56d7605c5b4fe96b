"""The system of the paper's arm experiment: a planar arm with a weak first joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.drawing.shapes import BoxShape, Color, Shape, SphereShape, TubeShape
from systems.planar_arm.kernels import FEATURE_NAMES, limited_targets, transition_features
from systems.planar_arm.kinematics import REACH, forward_kinematics, inverse_kinematics
from systems.system import Array, Problem, Rollout, StopReason, System
from systems.validation import (
    RandomState,
    as_finite_array,
    as_generator,
    as_row_pair,
    as_rows,
    check_number,
)

if TYPE_CHECKING:
    from systems.planar_arm.simulation import ArmSimulation

CLOSE_DISTANCE = 0.075
GOAL_DISTANCE = 1e-6
HEADINGS_PER_TARGET = 8
ROWS = "configurations of three joint angles"
# For pictures: metres, and colours.
DRAWN_RADIUS = 0.035
LINK_COLOR: Color = (0.27, 0.44, 0.62, 1.0)
JOINT_COLOR: Color = (0.16, 0.20, 0.26, 1.0)


class PlanarArm(System):
    """A three-link arm in the X-Z plane whose first joint is too weak to hold it out straight.

    The links are 0.5 m long and weigh 1 kg each. Joint angles are in radians, counter-clockwise,
    the first from the x axis, the others from the link before: [-π/2, 0, 0] hangs down,
    [π/2, 0, 0] stands up. The joints do not wrap: π and -π are a whole turn apart. State, reduced
    state and command are all a configuration of three joint angles. r is the identity, and g
    predicts that the arm gets to the commanded configuration.

    The true arm, simulated by MuJoCo, has position servos limited to 9, 40 and 40 Nm. Γ commands a
    configuration and waits until all joints are slower than 1e-3 rad/s, for 10 s of simulated time
    at most. Each thread has a simulation of its own, which starts when it is first needed.

    Attributes
    ----------
    step_size : float
        0.109 rad, 1 % of the diagonal of the bounds.

    References
    ----------
    McConachie et al. 2020, "Application to a torque-limited planar arm".
    """

    reduced_dim = 3
    configuration_dim = 3
    bounds = np.array([[-np.pi] * 3, [np.pi] * 3])
    step_size = 0.01 * float(np.linalg.norm(bounds[1] - bounds[0]))
    feature_names_out = FEATURE_NAMES
    view_from = (0.0, -1.0, 0.12)

    def reduce(self, state: Any) -> Array:
        """Return the joint angles of a true state: r, the identity."""
        return as_finite_array(state, "state", (3,)).copy()

    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Predict that the arm gets to the commanded configuration: g."""
        reduced, command = as_row_pair(ROWS, 3, reduced=reduced, command=command)
        return command.copy(), np.ones(len(command), dtype=np.bool_)

    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return the configuration to command: the given one, or one step towards it."""
        reduced, configuration = as_row_pair(ROWS, 3, reduced=reduced, configuration=configuration)
        return limited_targets(reduced, configuration, self.step_size)

    def rollout(self, state: Any, commands: ArrayLike) -> Rollout:
        """Command configurations one after the other, each until the arm has settled: Γ.

        Parameters
        ----------
        state : ndarray of shape (3,)
            Joint angles of the arm at rest.
        commands : ndarray of shape (T, 3)

        Returns
        -------
        Rollout
            Always complete, as the arm has no constraint to stop at. ``states`` is an ndarray of
            shape (T + 1, 3). Where the arm falls, its joint angles can leave the bounds.

        Raises
        ------
        ValueError
            If the state or a command has the wrong shape or is not finite.
        SimulationDivergedError
            If MuJoCo reports a bad position, velocity or acceleration.
        """
        start = as_finite_array(state, "state", (3,))
        targets = as_finite_array(commands, "commands", (None, 3))
        simulation = _simulation()
        states = np.empty((len(targets) + 1, 3))
        states[0] = start
        for i, target in enumerate(targets):
            states[i + 1] = simulation.settle(states[i], target)
        return Rollout(states, len(targets), StopReason.COMPLETED)

    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say for each row whether two configurations are less than α = 0.075 rad apart: Close."""
        predicted, executed = as_row_pair(ROWS, 3, predicted=predicted, executed=executed)
        return np.linalg.norm(predicted - executed, axis=1) < CLOSE_DISTANCE

    def features(self, reduced: Array, next_reduced: Array) -> Array:
        """Return joint angles, directions of the links, and the motion in steps, (n, 12)."""
        reduced, next_reduced = as_row_pair(ROWS, 3, reduced=reduced, next_reduced=next_reduced)
        return transition_features(reduced, next_reduced, self.step_size)

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a start in which the servos can hold the arm, and any goal configuration."""
        rng = as_generator(random_state)
        return Problem(self._draw_resting_start(rng), self._draw_configuration(rng)[None])

    def sample_reaching_problem(
        self, random_state: RandomState = None, *, start_at_rest: bool = True
    ) -> Problem:
        """Draw a query of the paper's experiment: a start, and a point for the arm's tip.

        Parameters
        ----------
        random_state : None, int, SeedSequence, Generator or RandomState
        start_at_rest : bool, default=True
            Draw a start in which the servos can hold the arm. False draws any start, as the paper
            says; from about 45 % of them the arm falls before it is commanded to move.

        Returns
        -------
        problem : Problem
            Its goal are inverse kinematics solutions of the point, of which the servos can hold
            the arm in at least one.
        """
        rng = as_generator(random_state)
        start = self._draw_resting_start(rng) if start_at_rest else self._draw_configuration(rng)
        while True:
            target = rng.uniform(-REACH, REACH, 2)
            headings = rng.uniform(-np.pi, np.pi, HEADINGS_PER_TARGET)
            if np.linalg.norm(target) > REACH:
                continue
            solutions = self.inverse_kinematics(target, headings)
            if len(solutions) and self.can_hold(solutions).any():
                return Problem(start, solutions)

    def can_hold(self, configurations: ArrayLike) -> NDArray[np.bool_]:
        """Say for each row whether the servos can hold the arm in a configuration.

        That is, whether the arm stays Close to it if it is placed there and commanded to stay.

        Parameters
        ----------
        configurations : ndarray of shape (n, 3)

        Returns
        -------
        held : ndarray of bool of shape (n,)

        Raises
        ------
        ValueError
            If a configuration has the wrong shape or is not finite.
        SimulationDivergedError
            If MuJoCo reports a bad position, velocity or acceleration.
        """
        rows = as_finite_array(configurations, "configurations", (None, 3))
        simulation = _simulation()
        settled = [simulation.settle(row, row) for row in rows]
        return self.close(rows, np.reshape(settled, (-1, 3)))

    def inverse_kinematics(self, target: ArrayLike, headings: ArrayLike) -> Array:
        """Find configurations that put the arm's tip on a point.

        Parameters
        ----------
        target : ndarray of shape (2,)
            x and z, in metres.
        headings : ndarray of shape (n,)
            Directions of the last link to try, in radians from the x axis.

        Returns
        -------
        solutions : ndarray of shape (n_solutions, 3)
            Both ways to bend the elbow, for each heading that is possible; within the bounds.

        Raises
        ------
        ValueError
            If the point is out of the arm's reach of 1.5 m.
        """
        point = as_finite_array(target, "target", (2,))
        distance = np.linalg.norm(point)
        if distance > REACH:
            raise ValueError(
                f"target must lie within the arm's reach of {REACH} m, "
                f"got {point.tolist()} at {distance:.3f} m."
            )
        return inverse_kinematics(point, as_finite_array(headings, "headings", (None,)))

    def joint_positions(self, configurations: Array) -> Array:
        """Locate the base, the two inner joints and the tip of the arm.

        Parameters
        ----------
        configurations : ndarray of shape (n, 3)

        Returns
        -------
        positions : ndarray of shape (n, 4, 2)
            x and z, in metres, with the base at the origin.
        """
        (configurations,) = as_rows(ROWS, 3, configurations=configurations)
        return forward_kinematics(configurations)

    def draw(self, reduced: Array) -> list[Shape]:
        """Return three links, joints and a tip."""
        joints = _in_space(self.joint_positions(np.asarray(reduced)[None]))[0]
        links = [
            TubeShape(ends, DRAWN_RADIUS, LINK_COLOR)
            for ends in np.stack([joints[:-1], joints[1:]], axis=1)
        ]
        radii = np.array([1.3, 1.3, 1.3, 1.0]) * DRAWN_RADIUS
        return [
            *links,
            *(SphereShape(*joint, JOINT_COLOR) for joint in zip(joints, radii, strict=True)),
        ]

    def draw_scene(self) -> list[Shape]:
        """Return the foot that the arm stands on."""
        return [BoxShape(np.zeros(3), np.array([0.08, 0.05, 0.05]))]

    def traced_points(self, configurations: Array) -> Array:
        """Return where the arm's tip is."""
        return _in_space(self.joint_positions(configurations))[:, -1:]

    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say for each row whether a configuration is one of the goal's: Goal_B."""
        reduced, goal = as_rows(ROWS, 3, reduced=reduced, goal=goal)
        distances = np.linalg.norm(reduced[:, None] - goal[None], axis=2)
        return (distances < GOAL_DISTANCE).any(axis=1)

    def succeeded(self, state: Any, goal: ArrayLike, tolerance: float) -> bool:
        """Say whether a state is less than ``tolerance`` (β, rad) from one of the goal's: Goal_X.

        The joints do not wrap: a configuration that differs by a whole turn is not the same.
        """
        check_number(tolerance, "tolerance", 0, np.inf)
        executed = as_finite_array(state, "state", (3,))
        solutions = as_finite_array(goal, "goal", (None, 3))
        return bool((np.linalg.norm(solutions - executed, axis=1) < tolerance).any())

    def _draw_configuration(self, rng: np.random.Generator) -> Array:
        low, high = self.bounds
        return rng.uniform(low, high)

    def _draw_resting_start(self, rng: np.random.Generator) -> Array:
        while True:
            start = self._draw_configuration(rng)
            if self.can_hold(start[None])[0]:
                return start


def _in_space(points: Array) -> Array:
    """Return points x and z, (..., 2), as x, y and z."""
    return np.insert(points, 1, 0.0, axis=-1)


def _simulation() -> ArmSimulation:
    # MuJoCo is imported only where something is executed.
    from systems.planar_arm.simulation import thread_simulation

    return thread_simulation()
