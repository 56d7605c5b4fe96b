"""What it takes a robot's actuators to hold it still."""

from __future__ import annotations

import os
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.features.mujoco_models import absolute, thread_model
from systems.validation import as_finite_array

Array = NDArray[np.float64]


def holding_load(model_file: str | os.PathLike[str], positions: ArrayLike) -> Array:
    """Return the forces that hold a robot still, as shares of what its actuators can give.

    By inverse dynamics at rest: gravity and springs count, contacts and joint limits do not. Beyond
    1 or -1 an actuator is too weak, and the robot will not stay where it is.

    Parameters
    ----------
    model_file : str or path
        MJCF or URDF, read when it is first needed, in each thread.
    positions : array-like of shape (n, nq)
        MuJoCo's ``qpos``: joint angles (radians) and places (metres), in the model's order.

    Returns
    -------
    load : ndarray of shape (n, n_limited)
        For each hinge and slide joint with a limited force or torque, in the model's order: of the
        joint (``actuatorfrcrange``, in URDF ``effort``), or of the actuators that act on it
        (``forcerange`` times gear), whichever is less. The sign is that of the force needed.

    Raises
    ------
    ValueError
        If the positions have another shape or are not finite, or no joint's force is limited.
    """
    import mujoco

    file = absolute(model_file)
    model, data = thread_model(file)[:2]
    rows = as_finite_array(positions, "positions", (None, model.nq))
    limited, low, high = _limits(file)
    if not len(limited):
        raise ValueError(
            f"model_file must limit the force of a joint (actuatorfrcrange) or of an actuator "
            f"that acts on one (forcerange); {file} limits none."
        )
    needed = np.empty((len(rows), model.nv))
    for i, row in enumerate(rows):
        data.qpos[:] = row
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        needed[i] = data.qfrc_bias - data.qfrc_passive
    needed = needed[:, limited]
    return needed / np.where(needed < 0, -low, high)


@cache
def _limits(model_file: str) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the degrees of freedom with a limit, and the least and greatest force on each."""
    import mujoco

    model = thread_model(model_file).model
    low, high = np.zeros(model.nv), np.zeros(model.nv)
    driven = np.zeros(model.nv, dtype=np.bool_)
    single = np.isin(model.jnt_type, [mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE])
    for i in np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT):
        joint = model.actuator_trnid[i, 0]
        if not single[joint]:
            continue
        dof = model.jnt_dofadr[joint]
        driven[dof] = True
        ends = np.array([-np.inf, np.inf])
        if model.actuator_forcelimited[i]:
            ends = np.sort(model.actuator_forcerange[i] * model.actuator_gear[i, 0])
        low[dof], high[dof] = low[dof] + ends[0], high[dof] + ends[1]
    low[~driven], high[~driven] = -np.inf, np.inf
    for joint in np.flatnonzero(model.jnt_actfrclimited & single):
        dof, ends = model.jnt_dofadr[joint], model.jnt_actfrcrange[joint]
        low[dof], high[dof] = max(low[dof], ends[0]), min(high[dof], ends[1])
    limited = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    return limited, low[limited], high[limited]
