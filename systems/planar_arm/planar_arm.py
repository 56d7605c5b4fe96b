"""The paper's torque-limited planar arm, in MuJoCo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.errors import SimulationDivergedError
from systems.planar_arm.kernels import limited_targets, transition_features
from systems.system import Array, Problem, Rollout, StopReason, System
from systems.validation import RandomState, as_finite_array, as_generator

MODEL_FILE = Path(__file__).with_name("planar_arm.xml")
LINK_LENGTH = 0.5
REACH = 3 * LINK_LENGTH
CLOSE_DISTANCE = 0.075
GOAL_DISTANCE = 1e-6
REST_SPEED = 1e-3
STEPS_PER_CHECK = 5
LONGEST_SETTLING = 10.0
HEADINGS_PER_TARGET = 8


class PlanarArm(System):
    """A three-link arm in the X-Z plane whose first joint is too weak to hold it out straight.

    The links are 0.5 m long and weigh 1 kg each. Joint angles are in radians, counter-clockwise,
    the first from the x axis: [-π/2, 0, 0] hangs down, [π/2, 0, 0] stands up. State, reduced
    state and command are all a configuration of three joint angles: r is the identity, and g
    takes the arm to the commanded configuration. Every method takes and returns rows of those.

    The true arm, in MuJoCo, has position servos limited to 9, 40 and 40 Nm. Γ commands a
    configuration and waits until every joint is slower than 1e-3 rad/s, which is looked at every
    0.1 s of simulated time, for 10 s at most.

    Attributes
    ----------
    step_size : float
        0.109 rad, 1 % of the longest straight line within the bounds.

    References
    ----------
    McConachie et al. 2020, "Application to a torque-limited planar arm".
    """

    reduced_dim = 3
    configuration_dim = 3
    bounds = np.array([[-np.pi] * 3, [np.pi] * 3])
    step_size = 0.01 * float(np.linalg.norm(bounds[1] - bounds[0]))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_started"}

    def reduce(self, state: Any) -> Array:
        """Return the joint angles of a true state: r, the identity."""
        return as_finite_array(state, "state", (3,)).copy()

    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Predict that the arm gets to where it is commanded: g."""
        _check_rows(reduced, command)
        return command.copy(), np.ones(len(command), dtype=np.bool_)

    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return the configuration within one step that lies towards ``configuration``."""
        _check_rows(reduced, configuration)
        return limited_targets(reduced, configuration, self.step_size)

    def rollout(self, state: Any, commands: ArrayLike) -> Rollout:
        """Command configurations in turn, each until the arm has settled: Γ.

        Parameters
        ----------
        state : ndarray of shape (3,)
            Joint angles of the arm at rest.
        commands : ndarray of shape (T, 3)

        Returns
        -------
        Rollout
            Always complete: the arm has no constraint to stop at. ``states`` is an ndarray of
            shape (T + 1, 3); its angles are not wrapped, a fallen arm may leave the bounds.

        Raises
        ------
        ValueError
            If the state or a command has the wrong shape or is not finite.
        SimulationDivergedError
            If MuJoCo reports a bad position, velocity or acceleration.
        """
        start = as_finite_array(state, "state", (3,))
        targets = as_finite_array(commands, "commands", (None, 3))
        simulation = self._simulation()
        states = np.empty((len(targets) + 1, 3))
        states[0] = start
        for i, target in enumerate(targets):
            states[i + 1] = simulation.settle(states[i], target)
        return Rollout(states, len(targets), StopReason.COMPLETED)

    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say whether configurations are less than α = 0.075 rad apart: Close."""
        _check_rows(predicted, executed)
        return np.linalg.norm(predicted - executed, axis=1) < CLOSE_DISTANCE

    def features(self, reduced: Array, next_reduced: Array) -> Array:
        """Return (n, 12) rows: joint angles, directions of the links, and the motion in steps."""
        _check_rows(reduced, next_reduced)
        return transition_features(reduced, next_reduced, self.step_size)

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a start at which the arm can rest and any goal configuration.

        A configuration that the servos can't hold is no state of the quasi-static system, so
        it is drawn again.
        """
        rng = as_generator(random_state)
        return Problem(self._draw_resting_start(rng), self._draw_configuration(rng)[None])

    def sample_reaching_problem(
        self, random_state: RandomState = None, *, start_at_rest: bool = True
    ) -> Problem:
        """Draw a query of the paper's experiment: a start and a point for the arm's tip.

        The goal holds inverse kinematics solutions of the point, of which at least one is a
        configuration that the servos can hold.

        Parameters
        ----------
        random_state : int, Generator, RandomState, SeedSequence or None
        start_at_rest : bool, default=True
            False draws any start, as the paper's text says; the arm falls from about 45 % of
            them before it has moved.
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
        """Say, row by row, whether the arm stays Close to a configuration that it is put in.

        Parameters
        ----------
        configurations : ndarray of shape (n, 3)
        """
        rows = as_finite_array(configurations, "configurations", (None, 3))
        simulation = self._simulation()
        settled = [simulation.settle(row, row) for row in rows]
        return self.close(rows, np.reshape(settled, (-1, 3)))

    def inverse_kinematics(self, target: ArrayLike, headings: ArrayLike) -> Array:
        """Find configurations that put the arm's tip on a point.

        Parameters
        ----------
        target : ndarray of shape (2,)
            x and z, in metres.
        headings : ndarray of shape (n,)
            Absolute angles of the last link to try, in radians.

        Returns
        -------
        solutions : ndarray of shape (n_solutions, 3)
            Both elbows of every heading that can be had, within the bounds.

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
        heading = as_finite_array(headings, "headings", (None,))
        wrist = point - LINK_LENGTH * np.column_stack([np.cos(heading), np.sin(heading)])
        cosine = np.sum(wrist**2, axis=1) / (2 * LINK_LENGTH**2) - 1
        found = cosine <= 1
        bend = np.arccos(cosine[found])
        elbow = np.concatenate([bend, -bend])
        shoulder = np.tile(np.arctan2(wrist[found, 1], wrist[found, 0]), 2) - elbow / 2
        hand = np.tile(heading[found], 2) - shoulder - elbow
        return (np.column_stack([shoulder, elbow, hand]) + np.pi) % (2 * np.pi) - np.pi

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
        _check_rows(configurations)
        angles = np.cumsum(configurations, axis=1)
        links = LINK_LENGTH * np.stack([np.cos(angles), np.sin(angles)], axis=2)
        return np.concatenate([np.zeros((len(links), 1, 2)), np.cumsum(links, axis=1)], axis=1)

    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether a configuration is one of the goal's: Goal_B."""
        _check_rows(reduced, goal)
        distances = np.linalg.norm(reduced[:, None] - goal[None], axis=2)
        return (distances < GOAL_DISTANCE).any(axis=1)

    def succeeded(self, state: Any, goal: ArrayLike, tolerance: float) -> bool:
        """Say whether a state is less than ``tolerance`` (β, rad) from one of the goal's: Goal_X.

        Angles are compared as they are: a turn too many is a failure.
        """
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

    def _simulation(self) -> _Simulation:
        if not hasattr(self, "_started"):
            self._started = _Simulation()
        return self._started


class _Simulation:
    """MuJoCo's model of the arm and the memory that it steps in."""

    def __init__(self) -> None:
        import mujoco

        self._step = mujoco.mj_step
        self._reset = mujoco.mj_resetData
        self._bad = [
            int(warning)
            for warning in (
                mujoco.mjtWarning.mjWARN_BADQPOS,
                mujoco.mjtWarning.mjWARN_BADQVEL,
                mujoco.mjtWarning.mjWARN_BADQACC,
            )
        ]
        self._model = mujoco.MjModel.from_xml_path(str(MODEL_FILE))
        self._data = mujoco.MjData(self._model)

    def settle(self, start: Array, target: Array) -> Array:
        """Return where the arm comes to rest when ``target`` is commanded at ``start``."""
        data = self._data
        self._reset(self._model, data)
        data.qpos[:] = start
        data.ctrl[:] = target
        while data.time < LONGEST_SETTLING:
            self._step(self._model, data, nstep=STEPS_PER_CHECK)
            if np.abs(data.qvel).max() < REST_SPEED:
                break
        if any(data.warning[warning].number for warning in self._bad):
            raise SimulationDivergedError(
                f"MuJoCo diverged when {target.tolist()} was commanded at {start.tolist()}."
            )
        return np.array(data.qpos)


def _check_rows(*arrays: Array) -> None:
    for array in arrays:
        if getattr(array, "ndim", 0) != 2 or array.shape[1] != 3:
            raise ValueError(
                "Configurations must be rows of three joint angles, an array of shape (n, 3), "
                f"got {np.shape(array)}."
            )
