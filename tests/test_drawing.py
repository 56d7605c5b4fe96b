"""Shapes that systems are drawn with."""

import mujoco
import numpy as np
import pytest

from examples.own_systems import suspended_load, tractor_trailer
from systems import (
    BoxShape,
    CylinderShape,
    MeshShape,
    SphereShape,
    TubeShape,
    load_scene,
    mujoco_shapes,
)
from systems.rope.drawing import drawn_scene
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import Scene

MODEL = """
<mujoco>
  <asset><mesh name="tetra" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
  <worldbody>
    <geom type="plane" size="0 2 1" pos="0 0 -1"/>
    <geom type="sphere" size="0.1" group="3"/>
    <body pos="1 0 0">
      <joint type="hinge" axis="0 0 1"/>
      <geom type="box" size="0.1 0.2 0.3" pos="1 0 0" rgba="1 0 0 0.5"/>
      <geom type="capsule" size="0.05 0.5" euler="90 0 0"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom type="mesh" mesh="tetra"/>
      <geom type="cylinder" size="0.1 0.2"/>
    </body>
  </worldbody>
</mujoco>"""


def test_mujoco_geoms_are_where_the_joints_put_them():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    data.qpos[0] = np.pi / 2
    box, capsule, ellipsoid, mesh, cylinder = mujoco_shapes(model, data, moving=True)
    np.testing.assert_allclose(box.position, [1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(box.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    assert box.color == (1, 0, 0, 0.5)
    np.testing.assert_allclose(np.abs(capsule.points - [1, 0, 0]), [[0.5, 0, 0]] * 2, atol=1e-12)
    np.testing.assert_allclose(np.abs(ellipsoid.vertices).max(axis=0), [0.1, 0.2, 0.3], rtol=0.01)
    assert isinstance(mesh, MeshShape)
    corners = mesh.vertices @ mesh.rotation.T + mesh.position
    assert np.linalg.norm(corners - [1, 0, 1], axis=1).min() < 1e-6
    assert isinstance(cylinder, CylinderShape)
    (plane,) = mujoco_shapes(model, data, moving=False)
    np.testing.assert_allclose(plane.position[2] + plane.half_extents[2], -1)
    np.testing.assert_allclose(plane.half_extents[:2], [5, 2])


@pytest.mark.parametrize("module", [suspended_load, tractor_trailer])
def test_own_systems_are_drawn_alike_in_starts_and_in_their_reduced_states(module):
    (system,) = (
        value()
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == module.__name__
    )
    start = system.sample_problem(0).start
    planned, true = system.draw(system.reduce(start)), system.draw_state(start)
    assert len(planned) == len(true) > 0
    for one, other in zip(planned, true, strict=True):
        place = "points" if isinstance(one, TubeShape) else "position"
        np.testing.assert_allclose(getattr(one, place), getattr(other, place), atol=1e-9)
    assert len(system.draw_scene()) > 5


def test_a_prism_is_closed_and_turned_outwards():
    square = [[0, 0], [2, 0], [2, 1], [0, 1]]
    prism = MeshShape.prism(square, 0.0, 3.0)
    corners = prism.vertices[prism.faces]
    volume = np.linalg.det(corners).sum() / 6
    np.testing.assert_allclose(volume, 6.0)


def test_rope_obstacles_are_drawn_where_they_are():
    for name in ("complex_hook", "engine_assembly"):
        scene = load_scene(name)
        assert isinstance(scene, Scene)
        for shape in drawn_scene(scene):
            inside = shape.points.mean(axis=0) if isinstance(shape, TubeShape) else shape.position
            assert signed_distance(inside, scene.packed) < 0
            if isinstance(shape, CylinderShape):
                end = shape.position + shape.rotation @ [0, 0, shape.half_length + 1e-3]
                near = shape.position + shape.rotation @ [0, 0, 0.98 * shape.half_length]
                assert signed_distance(near, scene.packed) < 0
                assert signed_distance(end, scene.packed) > -0.2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SphereShape([0, 0], 1.0), r"SphereShape\.position"),
        (lambda: SphereShape([0, 0, np.nan], 1.0), r"SphereShape\.position"),
        (lambda: SphereShape([0, 0, 0], 0.0), r"SphereShape\.radius must be positive"),
        (lambda: SphereShape([0, 0, 0], 1.0, (1, 0, 0)), r"SphereShape\.color"),
        (lambda: SphereShape([0, 0, 0], 1.0, (255, 0, 0, 1)), r"SphereShape\.color"),
        (lambda: BoxShape([0, 0, 0], [1, 1, 0]), r"BoxShape\.half_extents"),
        (lambda: BoxShape([0, 0, 0], [1, 1, 1], 2 * np.eye(3)), r"BoxShape\.rotation"),
        (lambda: BoxShape([0, 0, 0], [1, 1, 1], -np.eye(3)), r"BoxShape\.rotation"),
        (lambda: CylinderShape([0, 0, 0], 1.0, -1.0), r"CylinderShape\.half_length"),
        (lambda: TubeShape([[0, 0, 0]], 1.0), r"TubeShape\.points must be two or more"),
        (lambda: MeshShape(np.eye(3), [[0, 1, 3]]), r"MeshShape\.faces"),
        (lambda: MeshShape(np.eye(3), [[0.0, 1, 2]]), r"MeshShape\.faces"),
        (lambda: MeshShape.prism([[0, 0], [1, 0]], 0, 1), "three corners"),
    ],
)
def test_unfit_shapes_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_shapes_keep_copies():
    points = np.zeros((2, 3))
    tube = TubeShape(points, 0.1)
    points[0] = 9
    assert (tube.points == 0).all()
