"""The rope in MuJoCo: a one-dimensional flex whose two end vertices are the grippers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from systems.errors import SimulationDivergedError
from systems.mujoco_warnings import log_warnings
from systems.rope.obstacles.mjcf import geom_xml, meshes_xml, numbers_xml
from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import ROPE_RADIUS
from systems.rope.simulation.state import RopeState

# These values make the rope move quasi-statically: it follows its grippers and comes to rest,
# without jitter when it is taut and without lag when it is dragged over an edge. Units are SI.
TIME_STEP = 0.005
GRAVITY = 4.0
NODE_MASS = 0.01
FRICTION = 0.5
# Share of the velocities that is kept after each group of steps, so that slack comes down without
# swinging.
VELOCITY_KEPT = 0.95
CONTACT = 'solref="0.01 1" solimp="0.95 0.99 0.001"'
STRETCH = 'solref="0.01 1" solimp="0.9 0.95 0.001"'


class MujocoRope:
    """A rope of ``n_nodes`` point masses, joined by capsules of ``spacing`` metres at rest.

    Both end nodes are mocap bodies, whose positions are set, so the grippers are exactly where they
    are told to be. A simulation that goes on from a loaded state is bit for bit the same as the one
    that the state was saved from, in any instance.

    Parameters
    ----------
    obstacles : sequence of obstacles
    n_nodes : int
    spacing : float
        Metres.
    """

    def __init__(self, obstacles: Sequence[Obstacle], n_nodes: int, spacing: float) -> None:
        import mujoco

        log_warnings()
        self._mujoco = mujoco
        self._rest = np.zeros((n_nodes, 3))
        self._rest[:, 0] = spacing * np.arange(n_nodes)
        self._model = mujoco.MjModel.from_xml_string(_describe(obstacles, self._rest))
        self._data = mujoco.MjData(self._model)
        self._content = mujoco.mjtState.mjSTATE_INTEGRATION

    def load(self, state: RopeState) -> None:
        """Take over a state; one without ``simulation`` starts at rest."""
        mujoco, model, data = self._mujoco, self._model, self._data
        mujoco.mj_resetData(model, data)
        if state.simulation is None:
            data.mocap_pos[:] = state.grippers
            data.qpos[:] = (state.nodes - self._rest)[1:-1].ravel()
            return
        size = mujoco.mj_stateSize(model, self._content)
        if state.simulation.shape != (size,):
            raise ValueError(
                "state must come from a rope of this length in this scene with the engine "
                f"'mujoco', got a simulation of shape {state.simulation.shape}; pass "
                "simulation=None to start from its nodes at rest."
            )
        mujoco.mj_setState(model, data, state.simulation, self._content)

    def save(self) -> RopeState:
        """Return the present state."""
        simulation = np.empty(self._mujoco.mj_stateSize(self._model, self._content))
        self._mujoco.mj_getState(self._model, self._data, simulation, self._content)
        return RopeState(self._data.mocap_pos.copy(), self.centre_line(), simulation)

    def centre_line(self) -> Array:
        """Return the rope's nodes, of shape (n_nodes, 3)."""
        nodes = self._rest.copy()
        nodes[1:-1] += self._data.qpos.reshape(-1, 3)
        nodes[[0, -1]] = self._data.mocap_pos
        return nodes

    def move_grippers(self, grippers: Array) -> None:
        """Put the grippers, of shape (2, 3), where they are to be."""
        self._data.mocap_pos[:] = grippers

    def step(self, n_steps: int) -> None:
        """Advance by some time steps, then take energy out of the rope.

        Raises
        ------
        SimulationDivergedError
            If MuJoCo warned of a bad position, velocity or acceleration, or ran out of memory.
        """
        data = self._data
        self._mujoco.mj_step(self._model, data, n_steps)
        data.qvel *= VELOCITY_KEPT
        if data.warning.number.any():
            warnings = [
                self._mujoco.mjtWarning(index).name for index in np.flatnonzero(data.warning.number)
            ]
            raise SimulationDivergedError(f"MuJoCo stopped simulating the rope: {warnings}.")


def _describe(obstacles: Sequence[Obstacle], rest: Array) -> str:
    names = [f"n{index}" for index in range(len(rest))]
    edges = " ".join(f"{index} {index + 1}" for index in range(len(rest) - 1))
    bodies = [_body(name, place) for name, place in zip(names, rest, strict=True)]
    for end in (0, -1):
        bodies[end] = f'<body name="{names[end]}" pos="{numbers_xml(rest[end])}" mocap="true"/>'
    return f"""
    <mujoco>
      <option timestep="{TIME_STEP}" gravity="0 0 {-GRAVITY}"><flag autoreset="disable"/></option>
      <default><geom contype="1" conaffinity="2" friction="{FRICTION}" {CONTACT}/></default>
      <asset>{meshes_xml(obstacles)}</asset>
      <worldbody>{"".join(map(geom_xml, obstacles))}{"".join(bodies)}</worldbody>
      <deformable>
        <flex name="rope" dim="1" radius="{ROPE_RADIUS}" body="{" ".join(names)}" element="{edges}">
          <contact contype="2" conaffinity="0" selfcollide="none" condim="3"
                   friction="{FRICTION}" {CONTACT}/>
        </flex>
      </deformable>
      <equality><flex flex="rope" {STRETCH}/></equality>
    </mujoco>"""


def _body(name: str, place: Array) -> str:
    joints = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    inertia = f'<inertial pos="0 0 0" mass="{NODE_MASS}" diaginertia="1e-6 1e-6 1e-6"/>'
    return f'<body name="{name}" pos="{numbers_xml(place)}">{inertia}{joints}</body>'
