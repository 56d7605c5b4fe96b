"""MuJoCo models to ask about distances and forces, one for each thread and file."""

from __future__ import annotations

import os
import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.features.primitive_kernels import PRIMITIVES
from systems.mujoco_warnings import log_warnings

PROBE_RADIUS = 1e-3
OBSTACLE_GROUP = 0
_PROBE = "probe of systems.features"
_of_thread = threading.local()


class ModelMemory(NamedTuple):
    """A model, memory to compute in, and what distances are measured between.

    Attributes
    ----------
    model : mujoco.MjModel
        Its obstacles are in the group ``OBSTACLE_GROUP``, all else is in another.
    data : mujoco.MjData
    probe : int
        The geom of a small sphere, of ``PROBE_RADIUS`` metres.
    primitives : tuple of ndarray
        Of the obstacles that are planes, spheres, capsules, cylinders or boxes: what
        :func:`systems.features.primitive_kernels.nearest_primitive` takes beside the points.
        Obstacles are the geoms that are fixed to the world, without those to ignore.
    others : list of int
        Obstacles of other kinds, such as meshes.
    centres : ndarray of shape (n_others, 3)
        Centres of spheres around the others.
    radii : ndarray of shape (n_others,)
        Their radii.
    """

    model: Any
    data: Any
    probe: int
    primitives: tuple[NDArray[Any], ...]
    others: list[int]
    centres: NDArray[np.float64]
    radii: NDArray[np.float64]


def absolute(model_file: Any) -> str:
    """Return a model file's absolute path, or raise ``ValueError`` if a value can't be one."""
    if not isinstance(model_file, str | os.PathLike) or not os.fspath(model_file):
        raise ValueError(f"model_file must be a string or path-like, got {model_file!r}.")
    return os.path.abspath(os.fsdecode(model_file))


def thread_model(file: str, ignore: tuple[str, ...] = ()) -> ModelMemory:
    """Return the model of a file, read when this thread first asks for it.

    Parameters
    ----------
    file : str
        An absolute path.
    ignore : tuple of str, default=()
        Names of geoms that are no obstacles.

    Raises
    ------
    ValueError
        If MuJoCo can't read the file, or knows no geom of an ignored name.
    """
    known = _of_thread.__dict__.setdefault("models", {})
    key = file, ignore
    if key not in known:
        known[key] = _read(file, ignore)
    return known[key]


def _read(path: str, ignore: tuple[str, ...]) -> ModelMemory:
    # Imported where it is used: a system whose features are never asked for need not wait for it.
    import mujoco

    # Early versions fill the specification, later ones return a new one.
    log_warnings()
    spec = mujoco.MjSpec()
    try:
        spec = spec.from_file(path) or spec
    except ValueError as error:
        raise ValueError(f"model_file must be one that MuJoCo can read: {error}") from error
    probe = spec.worldbody.add_geom()
    probe.name, probe.type = _PROBE, mujoco.mjtGeom.mjGEOM_SPHERE
    # The model may have defaults of its own.
    probe.size, probe.pos = [PROBE_RADIUS, 0, 0], [0, 0, 0]
    probe.fromto, probe.meshname = np.full(6, np.nan), ""
    model = spec.compile()
    # Of forces, only gravity and springs are asked for; contacts take time to find.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    obstacles = _obstacles(model, ignore)
    _show_to_rays(model, obstacles)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    is_primitive = np.isin(model.geom_type, PRIMITIVES)
    simple = [i for i in obstacles if is_primitive[i]]
    primitives = (
        model.geom_type[simple].astype(np.int64),
        data.geom_xpos[simple],
        data.geom_xmat[simple].reshape(-1, 3, 3),
        model.geom_size[simple],
    )
    others = [i for i in obstacles if not is_primitive[i]]
    return ModelMemory(
        model=model,
        data=data,
        probe=model.geom(_PROBE).id,
        primitives=primitives,
        others=others,
        centres=data.geom_xpos[others],
        radii=model.geom_rbound[others],
    )


def _obstacles(model: Any, ignore: tuple[str, ...]) -> list[int]:
    names = [model.geom(i).name for i in range(model.ngeom)]
    unknown = set(ignore) - set(names)
    if unknown:
        known = [name for name in names if name not in ("", _PROBE)]
        raise ValueError(
            f"ignore must name geoms of the model, which are {known}, got {sorted(unknown)}."
        )
    fixed = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
    return [int(i) for i in fixed if names[i] not in (*ignore, _PROBE)]


def _show_to_rays(model: Any, obstacles: list[int]) -> None:
    """Let rays find all obstacles, which they only do if these are visible."""
    model.geom_group[:] = OBSTACLE_GROUP + 1
    model.geom_group[obstacles] = OBSTACLE_GROUP
    model.geom_rgba[:, 3] = 1
    model.geom_matid[:] = -1
