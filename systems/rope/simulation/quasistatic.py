"""The true execution Γ of the rope: quasi-static, whatever the physics engine."""

from __future__ import annotations

import threading
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from systems.errors import SimulationDivergedError
from systems.rope.obstacles.shapes import Array
from systems.rope.rope_length import length_between
from systems.rope.scene import GRIPPER_RADIUS, Scene
from systems.rope.simulation.depth_kernels import depth_in_obstacles
from systems.rope.simulation.engines import ENGINES, RopeEngine
from systems.rope.simulation.gripper_contact import (
    gripper_clearance,
    longest_displacement,
    share_within_bounds,
    share_without_contact,
)
from systems.rope.simulation.state import RopeState, checked_rope
from systems.rope.simulation.stop_reason import RopeStopReason
from systems.rope.strides import LONGEST_STRIDE, RESTING_STEPS, STEPS_PER_STRIDE
from systems.system import Rollout, StopReason
from systems.validation import as_finite_array, check_within_bounds

# Near the largest allowed stretch the grippers' strides shorten, so that the execution ends close
# to it. Metres.
SHORTEST_STRIDE = 0.001
# Metres: a rope that is shorter than the limit by at least this much is not measured.
LENGTH_MARGIN = 0.01
# Metres by which a gripper may be out of bounds at the edge of the world.
ROUNDING = 1e-9
# Time steps until a rope that is laid somewhere has come to rest.
SETTLING_STEPS = 800
# Metres that the rope's surface may be deep in an obstacle in a state that is returned: 1 mm less
# what is overlooked between the places where it is measured.
LARGEST_DEPTH = 0.00098
# Strides' worth of time steps in which a rope that is deeper must come out.
MOST_RESTS = 100
# A rope longer than the limit by this factor shows that the simulation has diverged.
DIVERGED_LENGTH = 1.5


class RopeRollout:
    """Γ: moves the grippers of a rope, quasi-statically, until a constraint forbids it.

    An execution stops on the boundary of a constraint and never violates it: before a gripper, a
    sphere with a radius of 23 mm, would enter an obstacle, before its centre would leave the
    scene's bounds, and before the rope would be longer than λ times its length at rest. The same
    state and commands give the same result. Each thread has a physics engine of its own, which
    starts at its first execution, and is left out when a rollout is pickled.

    Contacts of the rope give way. While it is dragged taut over an edge, its surface is up to 5 mm
    deep in the obstacle for some hundredths of a second. It gets the time to come out: in every
    state that is returned it is at most 1 mm deep. :mod:`benchmarks.rope.penetration` measures it.

    Parameters
    ----------
    scene : Scene
    engine : {"mujoco", "pybullet"}
        With "mujoco", an execution that goes on from a returned state is bit for bit the same as
        one without the stop; with "pybullet", to within a millimetre.

    References
    ----------
    McConachie et al. 2020, "Application to rope manipulation".
    """

    def __init__(self, scene: Scene, engine: str = "mujoco") -> None:
        if engine not in ENGINES:
            raise ValueError(f"engine must be one of {', '.join(ENGINES)}, got {engine!r}.")
        self.scene = scene
        self.engine = engine

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_of_thread"}

    def settle(self, nodes: ArrayLike) -> RopeState:
        """Let a rope come to rest from where it is laid, its ends held by the grippers.

        Parameters
        ----------
        nodes : array-like of shape (n_nodes, 3)

        Returns
        -------
        state : RopeState

        Raises
        ------
        ValueError
            If ``nodes`` is not of this scene's rope, or not finite.
        SimulationDivergedError
            If the simulator diverged, or the rope did not come out of an obstacle.
        """
        laid = as_finite_array(nodes, "nodes", (self.scene.n_nodes, 3))
        engine = self._engine()
        engine.load(RopeState(laid[[0, -1]], laid))
        for _ in range(SETTLING_STEPS // STEPS_PER_STRIDE - 1):
            engine.step(STEPS_PER_STRIDE)
        return self._rested(STEPS_PER_STRIDE)[0]

    def execute(self, state: RopeState, commands: ArrayLike) -> Rollout:
        """Carry out commands in turn.

        Parameters
        ----------
        state : RopeState
        commands : array-like of shape (T, 6)
            Displacements of gripper A and gripper B in metres.

        Returns
        -------
        rollout : Rollout
            ``stop_reason`` is ``StopReason.COMPLETED`` or a
            :class:`~systems.rope.simulation.stop_reason.RopeStopReason`.

        Raises
        ------
        ValueError
            If the state is not one of this scene and engine, or something is not finite.
        SimulationDivergedError
            If the simulator diverged, or the rope did not come out of an obstacle.
        """
        moves = as_finite_array(commands, "commands", (None, 6)).reshape(-1, 2, 3)
        start = self._checked_state(state)
        states = [state]
        if len(moves):
            self._engine().load(start)
        for move in moves:
            start, stop_reason = self._carry_out(start, move)
            states.append(start)
            if stop_reason is not StopReason.COMPLETED:
                return Rollout(states, len(states) - 2, stop_reason)
        return Rollout(states, len(moves), StopReason.COMPLETED)

    def _carry_out(self, before: RopeState, move: Array) -> tuple[RopeState, Enum]:
        inside = share_within_bounds(before.grippers, move, self.scene.bounds)
        move = inside * move
        share = share_without_contact(before.grippers, move, self.scene.packed)
        legal, arrived = self._move(before, share * move)
        if not arrived:
            return legal, RopeStopReason.OVERSTRETCHED
        rested, allowed = self._rested(RESTING_STEPS)
        if not allowed:
            return legal, RopeStopReason.OVERSTRETCHED
        if share < 1.0:
            return rested, RopeStopReason.GRIPPER_CONTACT
        return rested, StopReason.COMPLETED if inside == 1.0 else RopeStopReason.EDGE_OF_WORLD

    def _move(self, before: RopeState, move: Array) -> tuple[RopeState, bool]:
        """Return the last state that was measured and legal, and whether the grippers arrived."""
        engine, limit = self._engine(), self.scene.max_band_length
        legal, length = before, self._checked_length(before)
        travelled, total = 0.0, longest_displacement(move)
        while travelled < total:
            stride = min(max((limit - length) / 4, SHORTEST_STRIDE), LONGEST_STRIDE)
            travelled = min(travelled + stride, total)
            engine.move_grippers(before.grippers + (travelled / total) * move)
            # The rope can't have grown by more than its ends moved, so it needs measuring only near
            # the limit.
            length += 2 * stride
            if length <= limit - LENGTH_MARGIN:
                engine.step(STEPS_PER_STRIDE)
                continue
            state, allowed = self._rested(STEPS_PER_STRIDE)
            if not allowed:
                return legal, False
            legal, length = state, rope_length(state)
        return legal, True

    def _rested(self, n_steps: int) -> tuple[RopeState, bool]:
        """Let the rope follow its grippers, and say whether it may be so.

        A taut rope that snaps over an edge is deep in it for some hundredths of a second, and gets
        that time. One that is pulled around a cylinder until it trembles may not come out of it: it
        is overstretched.
        """
        engine, limit = self._engine(), self.scene.max_band_length
        for _ in range(1 + MOST_RESTS):
            engine.step(n_steps)
            state = engine.save()
            length = self._checked_length(state)
            if length > limit or self._depth() <= LARGEST_DEPTH:
                return state, length <= limit
            n_steps = STEPS_PER_STRIDE
        if length > limit - LENGTH_MARGIN:
            return state, False
        raise SimulationDivergedError(
            f"The engine {self.engine!r} diverged: it left the rope's surface "
            f"{1e3 * self._depth():.1f} mm deep in an obstacle, at most 1 mm is allowed."
        )

    def _depth(self) -> float:
        return float(depth_in_obstacles(self._engine().centre_line(), self.scene.packed))

    def _checked_length(self, state: RopeState) -> float:
        length = rope_length(state)
        if not length <= DIVERGED_LENGTH * self.scene.max_band_length:
            raise SimulationDivergedError(
                f"The engine {self.engine!r} diverged: it made the rope {length:g} m long, at most "
                f"{self.scene.max_band_length:g} m are allowed."
            )
        return length

    def _checked_state(self, state: RopeState) -> RopeState:
        state = checked_rope(state, self.scene)
        if state.simulation is not None and not np.isfinite(state.simulation).all():
            raise ValueError("state.simulation must be finite, got NaN or infinity in it.")
        if gripper_clearance(state.grippers, self.scene.packed) < 0.0:
            raise ValueError(
                f"state must keep the grippers {GRIPPER_RADIUS} m away from the obstacles, got "
                f"them at {state.grippers.tolist()}."
            )
        edge = np.array([[-ROUNDING], [ROUNDING]])
        check_within_bounds(state.grippers, self.scene.bounds + edge, "state.grippers")
        if not rope_length(state) <= self.scene.max_band_length:
            raise ValueError(
                f"state must hold a rope of at most {self.scene.max_band_length:g} m, got "
                f"{rope_length(state):g} m."
            )
        return state

    def _engine(self) -> RopeEngine:
        of_thread = vars(self).setdefault("_of_thread", threading.local())
        if not hasattr(of_thread, "engine"):
            scene = self.scene
            start_engine = ENGINES[self.engine]
            of_thread.engine = start_engine(scene.obstacles, scene.n_nodes, scene.link_length)
        engine: RopeEngine = of_thread.engine
        return engine


def rope_length(state: RopeState) -> float:
    """Return the length of a rope from gripper A along its nodes to gripper B, in metres."""
    return float(length_between(state.grippers, state.nodes))
