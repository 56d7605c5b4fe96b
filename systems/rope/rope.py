"""The rope: two grippers move its ends among obstacles that it may catch on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.rope.band.band import WORKSPACE_SHAPE, bands_close, reduce_rope, reduced_dim
from systems.rope.features.registry import FEATURES
from systems.rope.kernels import all_finite, fill_margins, propagate_rope_rows, steer_rows
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import load_scene
from systems.rope.scene import (
    GRIPPER_CLEARANCE,
    NODE_SPACING,
    ROPE_RADIUS,
    STEP_SIZE,
    Scene,
    hanging_rope,
)
from systems.rope.simulation.quasistatic import ENGINES, RopeRollout, rope_length
from systems.rope.simulation.state import RopeState
from systems.rope.slack.pbd_ropes import pbd_dim, pbd_ropes_at_rest, propagate_pbd_ropes
from systems.system import Array, Problem, Rollout, System
from systems.validation import RandomState, as_finite_array, as_generator

GOAL_DISTANCE = 0.025
# Starts are no nearer to the goal than this share of the scene's own way: from behind all
# obstacles there is nothing to learn.
LEAST_WAY = 0.75

_MOST_DRAWS = 1000


class Rope(System):
    """A rope held by two grippers; its reduced state is the rope pulled taut.

    True states are :class:`systems.rope.simulation.state.RopeState`. A reduced state is the
    positions of grippers A and B, which are its configuration, and then the points of the
    elastic band from A to B (see :mod:`systems.rope.band.band`); with ``features="clearance"``
    guesses at the rope itself follow (see :mod:`systems.rope.slack.pbd_ropes`). Commands are
    displacements of A and B, together no more than ``step_size``. All are metres in the world
    frame, z up.

    Parameters
    ----------
    scene : str or Scene, default="simple_hook"
        One of the paper's scenes by name (``systems.rope.paper_scenes.SCENE_NAMES``), or your own.
    engine : {"mujoco", "pybullet"}, default="mujoco"
        Simulates the rope in :meth:`rollout`; started when it is first needed.
    features : {"voxels", "clearance", "vector"}, default="voxels"
        What :meth:`features` gives: bit-packed voxel grids, for the "voxnet" backend of the
        classifier; or, for any estimator, what hangs below the band in 496 numbers, or thirteen
        numbers. With "clearance" reduced states carry PBD ropes, which :meth:`propagate` moves
        and does not allow to be overstretched.

    Attributes
    ----------
    max_pbd_rope_length : float
        Longest that a PBD rope may become in a successor, metres: as long as the band may. Only
        with ``features="clearance"``.

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
    feature_kind = "voxels"

    def __init__(
        self,
        scene: str | Scene = "simple_hook",
        engine: str = "mujoco",
        features: str = "voxels",
    ) -> None:
        if isinstance(scene, str):
            scene = load_scene(scene)
        if not isinstance(scene, Scene):
            raise ValueError(f"scene must be a Scene or the name of one, got {scene!r}.")
        if engine not in ENGINES:
            raise ValueError(f"engine must be one of {', '.join(ENGINES)}, got {engine!r}.")
        if features not in FEATURES:
            raise ValueError(f"features must be one of {', '.join(FEATURES)}, got {features!r}.")
        # Collected data know their rope by its hash, which the default must leave as it was.
        if features != self.feature_kind:
            self.feature_kind = features
        self.scene = scene
        self.engine = engine
        self._band_dim = self.reduced_dim = reduced_dim(scene)
        if features == "clearance":
            self.reduced_dim += pbd_dim(scene)
            self.max_pbd_rope_length = scene.max_band_length
        self.bounds = np.tile(scene.bounds, 2)
        self._packed = scene.packed
        self._execution = RopeRollout(scene, engine)

    def reduce(self, state: RopeState) -> Array:
        """Pull the rope taut: r. PBD ropes are then where the rope is, and at rest.

        Raises
        ------
        SimulationDivergedError
            If the rope passes through an obstacle.
        """
        _check_state(state)
        band = reduce_rope(state.nodes, state.grippers, self.scene)
        if not self._has_pbd_ropes:
            return band
        return np.concatenate([band, pbd_ropes_at_rest(state.nodes)])

    def propagate(self, reduced: Array, command: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Move the ends of bands and of PBD ropes, and let the bands contract: g.

        A successor keeps the grippers 0.03 m away from the obstacles, the world's bounds and one
        another; grippers that are nearer may not come nearer still. Neither its band nor one of
        its PBD ropes is overstretched. What costs least is checked first.
        """
        rows = self._as_rows(reduced, "reduced", self.reduced_dim)
        moves = self._as_rows(command, "command", 6, len(rows))
        bands = self._bands(rows)
        next_bands, valid = np.empty_like(bands), np.empty(len(rows), dtype=np.bool_)
        propagate_rope_rows(
            bands,
            moves,
            self.bounds,
            self._packed,
            GRIPPER_CLEARANCE,
            self.scene.max_band_length,
            np.empty(WORKSPACE_SHAPE),
            next_bands,
            valid,
        )
        if not self._has_pbd_ropes:
            return next_bands, valid
        loose = np.ascontiguousarray(rows[:, self._band_dim :])
        next_pbd, valid = propagate_pbd_ropes(
            loose, bands[:, :6], moves, valid, self.scene, self.max_pbd_rope_length
        )
        return np.where(valid[:, None], np.hstack([next_bands, next_pbd]), rows), valid

    def bands(self, reduced: Array) -> Array:
        """Return reduced states without the PBD ropes, for :mod:`systems.rope.band.band`."""
        return self._bands(self._as_rows(reduced, "reduced", self.reduced_dim))

    def steer(self, reduced: Array, configuration: Array) -> Array:
        """Return the displacement of at most one step, in R^6, towards gripper positions."""
        rows = self._as_rows(reduced, "reduced", self.reduced_dim)
        targets = self._as_rows(configuration, "configuration", 6, len(rows))
        command = np.empty_like(targets)
        steer_rows(rows, targets, self.step_size, command)
        return command

    def rollout(self, state: RopeState, commands: ArrayLike) -> Rollout:
        """Carry out displacements in turn, quasi-statically: Γ.

        Stops before a gripper, a sphere of 23 mm, would enter an obstacle, and before the rope
        would be longer than ``scene.max_band_length``.

        Raises
        ------
        ValueError
            If the state is not one of this scene and engine, or something is not finite.
        SimulationDivergedError
            If the simulator diverged.
        """
        _check_state(state)
        return self._execution.execute(state, commands)

    def close(self, predicted: Array, executed: Array) -> NDArray[np.bool_]:
        """Say whether bands are near one another and of one homotopy class: Close."""
        predicted = self._as_rows(predicted, "predicted", self.reduced_dim)
        executed = self._as_rows(executed, "executed", self.reduced_dim, len(predicted))
        return bands_close(self._bands(predicted), self._bands(executed), self.scene)

    def features(self, reduced: Array, next_reduced: Array) -> NDArray[Any]:
        """Describe transitions to an estimator.

        Returns
        -------
        X : ndarray of shape (n, n_features)
            With "voxels", uint8 of 12288 features: see
            :func:`systems.rope.features.voxels.voxel_features`. With "clearance", float32 of 496:
            see :func:`systems.rope.features.clearance.clearance_features`. With "vector", float64
            of 13: see
            :func:`systems.rope.features.registry.vector_features`.
        """
        return FEATURES[self.feature_kind](reduced, next_reduced, self.scene)

    def scene_problem(self) -> Problem:
        """Return the scene's own start, at rest, and its goal."""
        return Problem(self._execution.settle(self.scene.start_rope()), self._goal())

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Draw a start at which the rope hangs at rest; the goal is the scene's.

        Gripper A is uniform in the clear part of the world and gripper B in what the rope at
        rest reaches of it, as long as the rope between them hangs free of obstacles, the goal
        is at least three quarters as far away as from the scene's start, and each gripper is on
        its own side: nearer to where it starts in the scene than to where the other one does.
        With both on one side, ropes rarely get caught.
        """
        rng = as_generator(random_state)
        for _ in range(_MOST_DRAWS):
            nodes = self._draw_hanging_rope(rng)
            if nodes is not None:
                state = self._execution.settle(nodes)
                if rope_length(state) <= self.scene.max_band_length:
                    return Problem(state, self._goal())
        raise ValueError(
            f"scene {self.scene.name!r} has no room for a hanging rope: none of {_MOST_DRAWS} "
            "starts was free of obstacles. Give a larger world or a shorter rope."
        )

    def sample_configurations(self, rng: np.random.Generator, n: int) -> Array:
        """Draw gripper positions in clear space, no farther apart than the rope may stretch."""
        return self._draw_grippers(rng, n, self.scene.max_band_length)

    def goal_reached(self, reduced: Array, goal: Array) -> NDArray[np.bool_]:
        """Say, row by row, whether the grippers are within 0.025 m, in R^6, of a goal: Goal_B."""
        way = reduced[:, None, :6] - goal[None]
        return (np.linalg.norm(way, axis=2) <= GOAL_DISTANCE).any(axis=1)

    def succeeded(self, state: RopeState, goal: ArrayLike, tolerance: float) -> bool:
        """Say whether the grippers are within ``tolerance``, metres in R^6, of a goal: Goal_X."""
        _check_state(state)
        goals = as_finite_array(goal, "goal", (None, 6))
        return bool((np.linalg.norm(goals - state.grippers.ravel(), axis=1) <= tolerance).any())

    @property
    def _has_pbd_ropes(self) -> bool:
        return self.reduced_dim > self._band_dim

    def _bands(self, rows: Array) -> Array:
        return np.ascontiguousarray(rows[:, : self._band_dim])

    def _goal(self) -> Array:
        return self.scene.goal.reshape(1, 6).copy()

    def _gripper_margin(self, configurations: Array) -> Array:
        """How far grippers are from obstacles, bounds and one another, whichever is least."""
        margins = np.empty(len(configurations))
        fill_margins(configurations, self.bounds, self._packed, margins)
        return margins

    def _as_rows(self, rows: Array, name: str, width: int, n_rows: int | None = None) -> Array:
        """Check rows as fast as planners need it."""
        fits = getattr(rows, "ndim", 0) == 2 and rows.shape[1] == width
        if not fits or rows.dtype != np.float64 or n_rows not in (None, len(rows)):
            rows = as_finite_array(rows, name, (n_rows, width))
        if not all_finite(rows):
            raise ValueError(f"{name} must be finite, got NaN or infinity.")
        return rows

    def _draw_grippers(self, rng: np.random.Generator, n: int, reach: float) -> Array:
        low = self.scene.bounds[0] + GRIPPER_CLEARANCE
        high = self.scene.bounds[1] - GRIPPER_CLEARANCE
        drawn = np.empty((0, 6))
        while len(drawn) < n:
            first = rng.uniform(low, high, size=(2 * n, 3))
            second = rng.uniform(np.maximum(low, first - reach), np.minimum(high, first + reach))
            pairs = np.hstack([first, second])
            near = np.linalg.norm(second - first, axis=1) <= reach
            good = near & (self._gripper_margin(pairs) >= GRIPPER_CLEARANCE)
            drawn = np.concatenate([drawn, pairs[good]])
        return drawn[:n]

    def _draw_hanging_rope(self, rng: np.random.Generator) -> Array | None:
        length = self.scene.rope_length
        grippers = self._draw_grippers(rng, 1, length).reshape(2, 3)
        start, goal = self.scene.start, self.scene.goal
        if np.linalg.norm(goal - grippers) < LEAST_WAY * np.linalg.norm(goal - start):
            return None
        own = np.linalg.norm(grippers - start, axis=1)
        if (own > np.linalg.norm(grippers - start[::-1], axis=1)).any():
            return None
        finely = 1 + 4 * round(length / NODE_SPACING)
        rope = hanging_rope(grippers, length, finely)
        if signed_distance(rope, self._packed).min() < ROPE_RADIUS:
            return None
        return hanging_rope(grippers, length, self.scene.n_nodes)


def _check_state(state: Any) -> None:
    if not isinstance(state, RopeState):
        raise ValueError(f"state must be a RopeState, got {state!r}.")
