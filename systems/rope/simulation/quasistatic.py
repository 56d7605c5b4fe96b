"""The true execution Γ of the rope: what its two physics engines have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from systems.errors import SimulationDivergedError
from systems.rope.kernels import length_between
from systems.rope.obstacles.shapes import Array, Obstacle
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import GRIPPER_RADIUS, Scene
from systems.rope.simulation.mujoco_engine import MujocoRope
from systems.rope.simulation.pybullet_engine import PybulletRope
from systems.rope.simulation.state import RopeState
from systems.rope.simulation.stop_reason import RopeStopReason
from systems.system import Rollout, StopReason
from systems.validation import as_finite_array

# The grippers move in strides that the rope can follow, and rest after every command. Near the
# largest stretch the strides shorten, so that the execution ends on the boundary.
LONGEST_STRIDE = 0.005
SHORTEST_STRIDE = 0.001
STEPS_PER_STRIDE = 2
RESTING_STEPS = 4
SETTLING_STEPS = 800
LENGTH_MARGIN = 0.01
CONTACT_SPACING = 0.001
CONTACT_BISECTIONS = 20
DIVERGED_LENGTH = 1.5


class RopeEngine(Protocol):
    """What Γ needs of a physics engine."""

    def load(self, state: RopeState) -> None:
        """Take over a state; one without ``simulation`` starts at rest."""

    def save(self) -> RopeState:
        """Return the present state."""

    def move_grippers(self, grippers: Array) -> None:
        """Put the grippers, of shape (2, 3), where they are to be."""

    def step(self, n_steps: int) -> None:
        """Advance by some time steps."""


ENGINES: dict[str, Callable[[Sequence[Obstacle], int, float], RopeEngine]] = {
    "mujoco": MujocoRope,
    "pybullet": PybulletRope,
}


class RopeRollout:
    """Γ: moves the grippers of a rope, quasi-statically, until something forbids it.

    An execution ends on the boundary, never past it: before a gripper, a sphere of 23 mm, would
    enter an obstacle, and before the rope would be longer than λ times its length at rest. The
    same state and commands give the same result. The engine starts at the first execution and
    does not pickle along.

    Parameters
    ----------
    scene : Scene
    engine : {"mujoco", "pybullet"}
        With "mujoco", going on from a state that an execution returned gives bit by bit what
        going on without a stop would have given; with "pybullet", within a millimetre.

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
        return {name: value for name, value in vars(self).items() if name != "_started"}

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
            If the simulator diverged.
        """
        laid = as_finite_array(nodes, "nodes", (self.scene.n_nodes, 3))
        engine = self._engine()
        engine.load(RopeState(laid[[0, -1]], laid))
        for _ in range(SETTLING_STEPS // STEPS_PER_STRIDE):
            engine.step(STEPS_PER_STRIDE)
        state = engine.save()
        self._checked_length(state)
        return state

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
            ``stop_reason`` is COMPLETED, GRIPPER_CONTACT or OVERSTRETCHED.

        Raises
        ------
        ValueError
            If the state is not one of this scene and engine, or something is not finite.
        SimulationDivergedError
            If the simulator diverged.
        """
        moves = as_finite_array(commands, "commands", (None, 6)).reshape(-1, 2, 3)
        self._check_state(state)
        states = [state]
        if len(moves):
            self._engine().load(state)
        for move in moves:
            reached, stop_reason = self._carry_out(states[-1], move)
            states.append(reached)
            if stop_reason is not StopReason.COMPLETED:
                return Rollout(states, len(states) - 2, stop_reason)
        return Rollout(states, len(moves), StopReason.COMPLETED)

    def _carry_out(self, before: RopeState, move: Array) -> tuple[RopeState, Enum]:
        share = self._share_without_contact(before.grippers, move)
        legal, arrived = self._move(before, share * move)
        if not arrived:
            return legal, RopeStopReason.OVERSTRETCHED
        self._engine().step(RESTING_STEPS)
        rested = self._engine().save()
        if self._checked_length(rested) > self.scene.max_band_length:
            return legal, RopeStopReason.OVERSTRETCHED
        return rested, StopReason.COMPLETED if share == 1.0 else RopeStopReason.GRIPPER_CONTACT

    def _move(self, before: RopeState, move: Array) -> tuple[RopeState, bool]:
        """Return the last known legal state, and whether the grippers arrived."""
        engine, limit = self._engine(), self.scene.max_band_length
        legal, length = before, self._checked_length(before)
        travelled, total = 0.0, _longest(move)
        while travelled < total:
            stride = min(max((limit - length) / 4, SHORTEST_STRIDE), LONGEST_STRIDE)
            travelled = min(travelled + stride, total)
            engine.move_grippers(before.grippers + (travelled / total) * move)
            engine.step(STEPS_PER_STRIDE)
            # The rope cannot have grown by more than its ends moved: measure it only near λ.
            length += 2 * stride
            if length > limit - LENGTH_MARGIN:
                state = engine.save()
                length = self._checked_length(state)
                if length > limit:
                    return legal, False
                legal = state
        return legal, True

    def _share_without_contact(self, grippers: Array, move: Array) -> float:
        """Return the largest share of a move that keeps both grippers out of the obstacles."""
        longest = _longest(move)
        if self._clearance(grippers) >= longest:
            return 1.0
        shares = np.linspace(0.0, 1.0, 1 + int(np.ceil(longest / CONTACT_SPACING)))
        free = [self._clearance(grippers + share * move) >= 0.0 for share in shares]
        if all(free):
            return 1.0
        first = free.index(False)
        low, high = shares[max(first - 1, 0)], shares[first]
        for _ in range(CONTACT_BISECTIONS):
            middle = 0.5 * (low + high)
            touches = self._clearance(grippers + middle * move) < 0.0
            low, high = (low, middle) if touches else (middle, high)
        return float(low)

    def _clearance(self, grippers: Array) -> float:
        return float(signed_distance(grippers, self.scene.packed).min()) - GRIPPER_RADIUS

    def _checked_length(self, state: RopeState) -> float:
        length = rope_length(state)
        if not length <= DIVERGED_LENGTH * self.scene.max_band_length:
            raise SimulationDivergedError(
                f"The engine {self.engine!r} diverged: it made the rope {length:g} m long, at most "
                f"{self.scene.max_band_length:g} m are allowed."
            )
        return length

    def _check_state(self, state: RopeState) -> None:
        as_finite_array(state.grippers, "state.grippers", (2, 3))
        as_finite_array(state.nodes, "state.nodes", (self.scene.n_nodes, 3))
        if state.simulation is not None and not np.isfinite(state.simulation).all():
            raise ValueError("state.simulation must be finite, got NaN or infinity in it.")
        if self._clearance(state.grippers) < 0.0:
            raise ValueError(
                f"state must keep the grippers {GRIPPER_RADIUS} m away from the obstacles, got "
                f"them at {state.grippers.tolist()}."
            )
        if not rope_length(state) <= self.scene.max_band_length:
            raise ValueError(
                f"state must hold a rope of at most {self.scene.max_band_length:g} m, got "
                f"{rope_length(state):g} m."
            )

    def _engine(self) -> RopeEngine:
        if "_started" not in vars(self):
            spacing = self.scene.rope_length / (self.scene.n_nodes - 1)
            self._started = ENGINES[self.engine](self.scene.obstacles, self.scene.n_nodes, spacing)
        return self._started


def rope_length(state: RopeState) -> float:
    """Return the length of a rope from gripper A along its nodes to gripper B, in metres."""
    return float(length_between(state.grippers, state.nodes))


def _longest(move: Array) -> float:
    return float(np.sqrt((move * move).sum(axis=1).max()))
