"""The arm's true execution: its MuJoCo model, and how it settles at a commanded configuration."""

from __future__ import annotations

import threading
from pathlib import Path

import mujoco
import numpy as np

from systems.errors import SimulationDivergedError
from systems.mujoco_warnings import log_warnings
from systems.system import Array

MODEL_FILE = Path(__file__).with_name("planar_arm.xml")
REST_SPEED = 1e-3
# The model's time step is 0.02 s, so the speed is checked every 0.1 s.
STEPS_PER_CHECK = 5
LONGEST_SETTLING = 10.0
DIVERGENCE = tuple(
    int(warning)
    for warning in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
)
_of_thread = threading.local()


class ArmSimulation:
    """MuJoCo's model of the arm, and the memory that it simulates in."""

    def __init__(self) -> None:
        log_warnings()
        self._model = mujoco.MjModel.from_xml_path(str(MODEL_FILE))
        self._data = mujoco.MjData(self._model)

    def settle(self, start: Array, target: Array) -> Array:
        """Return where the arm comes to rest if a configuration is commanded.

        Parameters
        ----------
        start : ndarray of shape (3,)
            The configuration that the arm rests in.
        target : ndarray of shape (3,)
            The commanded configuration.

        Returns
        -------
        settled : ndarray of shape (3,)
            The configuration in which all joints are slower than 1e-3 rad/s, or that after 10 s.

        Raises
        ------
        SimulationDivergedError
            If MuJoCo reports a bad position, velocity or acceleration.
        """
        data = self._data
        mujoco.mj_resetData(self._model, data)
        data.qpos[:] = start
        data.ctrl[:] = target
        while data.time < LONGEST_SETTLING:
            mujoco.mj_step(self._model, data, nstep=STEPS_PER_CHECK)
            if np.abs(data.qvel).max() < REST_SPEED:
                break
        if any(data.warning[warning].number for warning in DIVERGENCE):
            raise SimulationDivergedError(
                f"MuJoCo diverged when {target.tolist()} was commanded at {start.tolist()}."
            )
        return np.array(data.qpos)


def thread_simulation() -> ArmSimulation:
    """Return the simulation of the calling thread, which no other thread may use."""
    if not hasattr(_of_thread, "simulation"):
        _of_thread.simulation = ArmSimulation()
    return _of_thread.simulation
