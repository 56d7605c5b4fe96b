"""Shapes of the geoms of a MuJoCo model."""

from __future__ import annotations

from typing import Any

import numpy as np

from systems.drawing.rings import ring_faces
from systems.drawing.shapes import (
    BoxShape,
    Color,
    CylinderShape,
    MeshShape,
    Shape,
    SphereShape,
    TubeShape,
)

# MuJoCo's own viewer shows these groups; those above often hold geoms for collisions only.
_SHOWN_GROUPS = (0, 1, 2)
_PLANE_THICKNESS = 0.01
_ENDLESS_PLANE = 5.0


def mujoco_shapes(model: Any, data: Any, *, moving: bool) -> list[Shape]:
    """Return the geoms of a MuJoCo model as shapes, for :meth:`System.draw` and its like.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
        Its ``qpos`` says where bodies are; what follows from it is computed here.
    moving : bool
        True gives the geoms of bodies that can move, for ``draw`` and ``draw_state``; False those
        that are fixed to the world, for ``draw_scene``.

    Returns
    -------
    shapes : list of shapes
        Planes are thin boxes, those without end 10 m wide. Ellipsoids and meshes are meshes; other
        kinds, such as height fields, are left out, and so are geoms of group 3 and above.
    """
    import mujoco

    mujoco.mj_kinematics(model, data)
    moves = model.body_weldid[model.geom_bodyid] != 0
    chosen = np.flatnonzero((moves == moving) & np.isin(model.geom_group, _SHOWN_GROUPS))
    shapes = [_shape(model, data, int(geom)) for geom in chosen]
    return [shape for shape in shapes if shape is not None]


def _shape(model: Any, data: Any, geom: int) -> Shape | None:
    from mujoco import mjtGeom

    kind, size = model.geom_type[geom], model.geom_size[geom]
    position = data.geom_xpos[geom].copy()
    rotation = data.geom_xmat[geom].reshape(3, 3).copy()
    color = _color(model, geom)
    if kind == mjtGeom.mjGEOM_SPHERE:
        return SphereShape(position, float(size[0]), color)
    if kind == mjtGeom.mjGEOM_CAPSULE:
        half = size[1] * rotation[:, 2]
        return TubeShape(np.stack([position - half, position + half]), float(size[0]), color)
    if kind == mjtGeom.mjGEOM_CYLINDER:
        return CylinderShape(position, float(size[0]), float(size[1]), rotation, color)
    if kind == mjtGeom.mjGEOM_BOX:
        return BoxShape(position, size.copy(), rotation, color)
    if kind == mjtGeom.mjGEOM_PLANE:
        x, y = np.where(size[:2] > 0, size[:2], _ENDLESS_PLANE)
        half_extents = np.array([x, y, _PLANE_THICKNESS / 2])
        return BoxShape(position - half_extents[2] * rotation[:, 2], half_extents, rotation, color)
    if kind == mjtGeom.mjGEOM_ELLIPSOID:
        vertices, faces = _unit_ball()
        return MeshShape(vertices * size, faces, position, rotation, color)
    if kind == mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        first_face, n_faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        faces = model.mesh_face[first_face : first_face + n_faces]
        vertices = model.mesh_vert[first : first + count]
        return MeshShape(vertices, faces, position, rotation, color)
    return None


def _color(model: Any, geom: int) -> Color:
    material = model.geom_matid[geom]
    red, green, blue, opacity = (
        model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    ).tolist()
    return red, green, blue, opacity


def _unit_ball(n_around: int = 24, n_up: int = 12) -> tuple[np.ndarray, np.ndarray]:
    up = np.linspace(-np.pi / 2, np.pi / 2, n_up + 1)
    around = np.linspace(0, 2 * np.pi, n_around, endpoint=False)
    rings = np.stack(
        [
            np.outer(np.cos(up), np.cos(around)),
            np.outer(np.cos(up), np.sin(around)),
            np.repeat(np.sin(up)[:, None], n_around, axis=1),
        ],
        axis=2,
    )
    return rings.reshape(-1, 3), ring_faces(n_up + 1, n_around)
