"""The rope: two grippers move its ends among obstacles that it may catch on."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.drawing.shapes import Shape
from systems.goal_region import GoalRegion
from systems.rope.band.band import bands_close, reduce_rope, reduced_dim
from systems.rope.band.propagation_kernels import propagate_bands
from systems.rope.draped_start import stays_draped
from systems.rope.drawing import drawn_band, drawn_rope, drawn_scene
from systems.rope.features.registry import FEATURE_NAMES, FEATURES
from systems.rope.gripper_goal import GripperGoal
from systems.rope.gripper_goal_region import GripperGoalRegion
from systems.rope.gripper_kernels import allowed_moves, steer_grippers
from systems.rope.paper_scenes import SCENE_NAMES, load_scene
from systems.rope.sampling import draw_grippers, draw_hanging_rope
from systems.rope.scene import STEP_SIZE, Scene
from systems.rope.simulation.engines import ENGINES
from systems.rope.simulation.quasistatic import RopeRollout, rope_length
from systems.rope.simulation.state import RopeState, checked_rope
from systems.rope.slack.pbd_kernels import propagate_pbd_ropes
from systems.rope.slack.pbd_ropes import (
    pbd_dim,
    pbd_model,
    pbd_ropes_at_rest,
    varied_pbd_model,
)
from systems.system import Array, Problem, Rollout, System
from systems.validation import (
    RandomState,
    as_finite_array,
    as_generator,
    check_choice,
    check_number,
    is_finite,
)

GOAL_DISTANCE = 0.025

_MOST_DRAWS = 1000


class Rope(System):
    """A rope held by two grippers; its reduced state is the rope pulled taut.

    True states are :class:`systems.RopeState`. A reduced state is the positions of grippers A and
    B, which are its configuration, and then the points of the elastic band from A to B (see
    :mod:`systems.rope.band.band`). With ``features="clearance"`` it goes on with *PBD ropes*,
    cheap estimates of where the rope itself hangs, by position-based dynamics (see
    :mod:`systems.rope.slack.pbd_ropes`). Commands are displacements of A and B, together, in R^6,
    no more than ``step_size``. All lengths are metres in the world frame, z up.

    Parameters
    ----------
    scene : str or Scene, default="simple_hook"
        One of the paper's scenes by name (``systems.rope.paper_scenes.SCENE_NAMES``), or your own.
    engine : {"mujoco", "pybullet"}, default="mujoco"
        Simulates the rope in :meth:`rollout`; started when it is first needed.
    features : {"voxels", "clearance", "vector"}, default="voxels"
        What :meth:`features` returns. "voxels" are bit-packed voxel grids, for the "voxnet"
        backend of the classifier; the others suit any estimator: "clearance" describes the
        obstacles below the band in 496 numbers, "vector" is thirteen numbers. With "clearance"
        reduced states include PBD ropes, which :meth:`propagate` moves, and which must not be
        overstretched.

    Attributes
    ----------
    feature_kind : str
        As given by ``features``.
    max_pbd_rope_length : float
        Longest that a PBD rope may become in a successor, metres: as long as the band may.

    Raises
    ------
    ValueError
        If there is no such scene or engine, or no such features.

    References
    ----------
    McConachie et al. 2020, "Application to rope manipulation".
    """

    configuration_dim = 6
    step_size = STEP_SIZE
    independent_parts = (slice(0, 3), slice(3, 6))
    view_from = (-0.5, -0.9, 0.55)

    def __init__(
        self,
        scene: str | Scene = "simple_hook",
        engine: str = "mujoco",
        features: str = "voxels",
    ) -> None:
        if isinstance(scene, str):
            check_choice(scene, "scene", SCENE_NAMES)
            scene = load_scene(scene)
        if not isinstance(scene, Scene):
            raise ValueError(f"scene must be a Scene or the name of one, got {scene!r}.")
        check_choice(engine, "engine", ENGINES)
        check_choice(features, "features", FEATURES)
        self.scene = scene
        self.engine = engine
        self.feature_kind = features
        self.bounds = np.tile(scene.bounds, 2)
        self.max_pbd_rope_length = scene.max_band_length
        self._band_dim = reduced_dim(scene)
        self._pbd_dim = pbd_dim(scene) if features == "clearance" else 0
        self.reduced_dim = self._band_dim + self._pbd_dim
        self._pbd_model = pbd_model(scene)
        self._execution = RopeRollout(scene, engine)

    def __repr__(self) -> str:
        scene, kind = self.scene.name, self.feature_kind
        return f"Rope({scene!r}, engine={self.engine!r}, features={kind!r})"

    @property
    def feature_names_out(self) -> tuple[str, ...] | None:  # type: ignore[override]
        """What the columns of :meth:`features` are called; None for "voxels"."""
        return FEATURE_NAMES[self.feature_kind]

    def reduce(self, state: RopeState) -> Array:
        """Pull the rope taut: r. PBD ropes begin where the rope is, at rest.

        Raises
        ------
        ValueError
            If the state's nodes can't be this scene's rope, from gripper A to gripper B.
        SimulationDivergedError
            If the rope passes through an obstacle.
        """
        _check_state(state)
        state = checked_rope(state, self.scene)
        band = reduce_rope(state.nodes, state.grippers, self.scene)
        if not self._pbd_dim:
            return band
        return np.concatenate([band, pbd_ropes_at_rest(state.nodes)])

    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Move the grippers, let the bands contract and the PBD ropes follow: g.

        A successor keeps the grippers at least 0.03 m away from the obstacles, the bounds and one
        another; grippers that were nearer before may not come nearer still. Neither the band nor
        a PBD rope may be overstretched. What is cheapest is checked first.
        """
        rows, moves = _as_row_pair(
            reduced, command, ("reduced", "command"), (self.reduced_dim, self.configuration_dim)
        )
        packed = self.scene.packed
        allowed = allowed_moves(rows, moves, self.bounds, packed)
        max_length = self.scene.max_band_length
        bands, valid = propagate_bands(self._bands(rows), moves, allowed, packed, max_length)
        if not self._pbd_dim:
            return bands, valid
        ropes = np.ascontiguousarray(rows[:, self._band_dim :])
        ropes, valid = propagate_pbd_ropes(
            ropes, rows, moves, valid, self._pbd_model, self.max_pbd_rope_length
        )
        return np.where(valid[:, None], np.hstack([bands, ropes]), rows), valid

    def vary(self, rng: np.random.Generator) -> Rope | None:
        """Draw a rope whose PBD ropes rub more or less; None if there are no PBD ropes."""
        if not self._pbd_dim:
            return None
        variant = copy.copy(self)
        variant._pbd_model = varied_pbd_model(self.scene, rng)
        return variant

    def bands(self, reduced: Array) -> Array:
        """Return reduced states without the PBD ropes, for :mod:`systems.rope.band.band`."""
        return self._bands(_as_rows(reduced, "reduced", self.reduced_dim))

    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return the displacement of at most one step, in R^6, towards gripper positions."""
        rows, targets = _as_row_pair(
            reduced,
            configuration,
            ("reduced", "configuration"),
            (self.reduced_dim, self.configuration_dim),
        )
        command: Array = steer_grippers(rows, targets, self.step_size)
        return command

    def rollout(self, state: RopeState, commands: ArrayLike) -> Rollout:
        """Carry out displacements in turn, quasi-statically: Γ.

        It stops before a gripper, a sphere with a radius of 23 mm, would enter an obstacle, before
        its centre would leave the scene's bounds, and before the rope would be longer than
        ``scene.max_band_length``. Contacts give way a little: in the states that are returned the
        rope's surface, 10 mm from its centre line, is up to 1 mm deep in obstacles.

        Raises
        ------
        ValueError
            If the state is not one of this scene and engine, or something is not finite.
        SimulationDivergedError
            If the simulator diverged, or the rope did not come out of an obstacle.
        """
        _check_state(state)
        return self._execution.execute(state, commands)

    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say whether bands are near one another and of one homotopy class: Close."""
        rows, others = _as_row_pair(
            predicted, executed, ("predicted", "executed"), (self.reduced_dim, self.reduced_dim)
        )
        return bands_close(self._bands(rows), self._bands(others), self.scene)

    def features(self, reduced: Array, next_reduced: Array) -> NDArray[Any]:
        """Describe transitions to an estimator.

        Returns
        -------
        X : ndarray of shape (n, n_features)
            With "voxels", uint8 of 12288 features: see
            :func:`systems.rope.features.voxels.voxel_features`. With "clearance", float32 of 496:
            see :func:`systems.rope.features.clearance.clearance_features`. With "vector", float64
            of 13: see :func:`systems.rope.features.vector.vector_features`.
        """
        return FEATURES[self.feature_kind](reduced, next_reduced, self.scene)

    def draw(self, reduced: Array) -> list[Shape]:
        """Return the band and the grippers at its ends."""
        return drawn_band(np.reshape(reduced[6 : self._band_dim], (-1, 3)))

    def draw_state(self, state: RopeState) -> list[Shape]:
        """Return the true rope and its grippers."""
        return drawn_rope(state.nodes, state.grippers)

    def draw_scene(self) -> list[Shape]:
        """Return the obstacles."""
        return drawn_scene(self.scene)

    def traced_points(self, configurations: Array) -> Array:
        """Return the positions of both grippers."""
        return np.reshape(configurations, (-1, 2, 3))

    def scene_problem(self) -> Problem:
        """Return the scene's own start, at rest, and its goal.

        Raises
        ------
        ValueError
            If the rope does not stay where ``Scene.start_via`` lays it: if it comes to rest 0.05 m
            or more from one of the points, or on another side of an obstacle.
        """
        nodes = self.scene.start_rope()
        state = self._execution.settle(nodes)
        if not stays_draped(nodes, state, self.scene):
            raise ValueError(
                "start_via must be points that the rope stays at: in scene "
                f"{self.scene.name!r} it slides or falls off as it comes to rest. Give points at "
                "which it is held, or move the grippers of start."
            )
        return Problem(state, self._goal())

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a start at which the rope hangs at rest; the goal is the scene's.

        Gripper A is uniform in the clear part of the world, and gripper B in what the rope at rest
        reaches of it. The rope between them hangs free of obstacles, over the points of
        ``Scene.start_via`` if there are any, the goal is at least three
        quarters as far away as from the scene's own start, and each gripper is nearer to where it
        starts in the scene than to where the other one does: with both on one side of the
        obstacles, ropes rarely get caught.
        """
        rng = as_generator(random_state)
        for _ in range(_MOST_DRAWS):
            nodes = draw_hanging_rope(self.scene, rng)
            if nodes is not None:
                state = self._execution.settle(nodes)
                fits = rope_length(state) <= self.scene.max_band_length
                if fits and stays_draped(nodes, state, self.scene):
                    return Problem(state, self._goal())
        raise ValueError(
            f"scene {self.scene.name!r} has no room for a hanging rope: none of {_MOST_DRAWS} "
            "starts was free of obstacles. Give a larger world or a shorter rope."
        )

    def sample_configurations(self, rng: np.random.Generator, n: int) -> Array:
        """Draw gripper positions in clear space, no farther apart than the rope may stretch."""
        return draw_grippers(self.scene, rng, n, self.scene.max_band_length)

    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether the grippers are within 0.025 m, in R^6, of a goal: Goal_B."""
        rows, goals = _as_rows(reduced, "reduced", self.reduced_dim), _as_rows(goal, "goal", 6)
        way = rows[:, None, :6] - goals[None]
        return (np.linalg.norm(way, axis=2) <= GOAL_DISTANCE).any(axis=1)

    def succeeded(self, state: RopeState, goal: ArrayLike, tolerance: float) -> bool:
        """Say whether the grippers are within ``tolerance``, metres in R^6, of a goal: Goal_X."""
        _check_state(state)
        check_number(tolerance, "tolerance", 0, np.inf)
        goals = as_finite_array(goal, "goal", (None, 6))
        grippers = as_finite_array(state.grippers, "state.grippers", (2, 3)).ravel()
        return bool((np.linalg.norm(goals - grippers, axis=1) <= tolerance).any())

    def _bands(self, rows: Array) -> Array:
        return np.ascontiguousarray(rows[:, : self._band_dim])

    def _goal(self) -> Array | GoalRegion:
        goal = self.scene.goal
        if isinstance(goal, GripperGoal):
            return GripperGoalRegion(goal, self.scene)
        return goal.reshape(-1, 6).copy() if isinstance(goal, np.ndarray) else goal


def _check_state(state: Any) -> None:
    if not isinstance(state, RopeState):
        raise ValueError(f"state must be a RopeState, got {state!r}.")


def _as_rows(rows: Any, name: str, width: int) -> Array:
    """Return finite float64 rows; those that are so already are returned as they are."""
    fits = getattr(rows, "ndim", 0) == 2 and rows.shape[1] == width
    # Planners ask for a few rows, thousands of times a second.
    if fits and rows.dtype == np.float64 and is_finite(rows):
        checked: Array = rows
        return checked
    return as_finite_array(rows, name, (None, width))


def _as_row_pair(
    first: ArrayLike, second: ArrayLike, names: tuple[str, str], widths: tuple[int, int]
) -> tuple[Array, Array]:
    """Return two arrays of finite float64 rows that belong together."""
    rows, others = _as_rows(first, names[0], widths[0]), _as_rows(second, names[1], widths[1])
    if len(rows) != len(others):
        raise ValueError(
            f"{names[1]} must have as many rows as {names[0]}, {len(rows)}, got {len(others)}."
        )
    return rows, others
