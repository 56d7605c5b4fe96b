"""Ropes lowered onto every kind of obstacle, in both engines, do what the reduced model says."""

import itertools

import numpy as np
import pytest
from rope_states import pbd_nodes
from scipy.spatial.transform import Rotation

from systems import (
    Box,
    BoxShape,
    ConvexPolyhedron,
    Cylinder,
    CylinderShape,
    Rope,
    RopeStopReason,
    Scene,
    Sphere,
    SphereShape,
)
from systems.rope.band.band import reduced_dim
from systems.rope.drawing import drawn_scene
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import GRIPPER_RADIUS, ROPE_RADIUS

TILTED = Rotation.from_euler("xyz", (25, 10, 20), degrees=True).as_matrix()
ROOF = [(x, y, z) for x in (-0.3, 0.3) for y, z in ((-0.08, -0.08), (0.08, -0.08), (0.02, 0.05))]
SHAPES = {
    "sphere": Sphere((0.0, 0.0, 0.0), 0.1),
    "rotated box": Box((0.0, 0.0, 0.0), (0.3, 0.05, 0.04), rotation=TILTED),
    "slanted cylinder": Cylinder((0.0, 0.0, 0.0), 0.04, 0.4, axis=(1.0, 0.3, 0.15)),
    "polyhedron": ConvexPolyhedron(ROOF),
}
BOUNDS = [[-1.0] * 3, [1.0] * 3]
START, GOAL = [[0.0, 0.2, 0.4], [0.0, -0.2, 0.4]], [[0.5, 0.2, 0.4], [0.5, -0.2, 0.4]]
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
DOWN = np.tile([0.0, 0.0, -0.0177], 2)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_rope_lowered_onto_a_shape_is_held_as_the_model_predicts(shape, engine):
    scene = Scene([SHAPES[shape]], BOUNDS, 0.6, START, GOAL)
    rope = Rope(scene, engine=engine, features="clearance")
    start = rope.scene_problem().start
    executed = rope.rollout(start, np.tile(DOWN, (60, 1)))
    # It hangs over the shape until it is too short to go on.
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    assert executed.n_completed > 25
    distances = [signed_distance(state.nodes, scene.packed).min() for state in executed.states]
    assert min(distances) > 0.8 * ROPE_RADIUS
    assert distances[-1] < 1.4 * ROPE_RADIUS

    row, rows = rope.reduce(start)[None], []
    for _ in range(60):
        row, valid = rope.propagate(row, DOWN[None])
        if not valid[0]:
            break
        rows.append(row[0])
    assert len(rows) == pytest.approx(executed.n_completed, abs=2)
    n, width = min(len(rows), executed.n_completed), reduced_dim(scene)
    states = executed.states[1 : n + 1]
    close = rope.close(np.array(rows[:n]), np.array([rope.reduce(state) for state in states]))
    # In PyBullet the rope slowly slides down a slope, where friction holds it in MuJoCo and in g.
    assert close.mean() == 1.0 if engine == "mujoco" else close.mean() > 0.6
    if engine == "mujoco":
        for predicted, state in zip(rows, states, strict=False):
            nodes = pbd_nodes(predicted[width:], predicted[:6])
            assert np.linalg.norm(nodes - state.nodes, axis=2).mean() < 0.015


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
@pytest.mark.parametrize("shape", SHAPES)
def test_grippers_stop_at_the_surface_of_a_shape_in_both_engines_and_in_the_model(shape, engine):
    above = [[0.0, 0.0, 0.4], [0.0, 0.3, 0.4]]
    scene = Scene([SHAPES[shape]], BOUNDS, 0.6, above, GOAL)
    rope = Rope(scene, engine=engine, features="vector")
    start = rope.scene_problem().start
    executed = rope.rollout(start, np.tile(DOWN, (60, 1)))
    assert executed.stop_reason is RopeStopReason.GRIPPER_CONTACT
    nearest = signed_distance(executed.states[-1].grippers, scene.packed).min()
    assert 0.0 <= nearest - GRIPPER_RADIUS < 1e-6
    # The model keeps another 7 mm away.
    row, n_steps = rope.reduce(start)[None], 0
    while n_steps < 60:
        row, valid = rope.propagate(row, DOWN[None])
        if not valid[0]:
            break
        n_steps += 1
    assert n_steps == pytest.approx(executed.n_completed, abs=1)


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_are_drawn_where_they_are(shape):
    scene = Scene([SHAPES[shape]], BOUNDS, 0.6, START, GOAL)
    (drawn,) = drawn_scene(scene)
    if isinstance(drawn, SphereShape):
        points = drawn.position + drawn.radius * np.eye(3)
    elif isinstance(drawn, BoxShape):
        points = drawn.position + drawn.half_extents * CORNERS @ drawn.rotation.T
    elif isinstance(drawn, CylinderShape):
        rim = np.array([[drawn.radius, 0.0, z * drawn.half_length] for z in (-1, 1)])
        points = drawn.position + rim @ drawn.rotation.T
    else:
        points = drawn.vertices
        corners = drawn.vertices[drawn.faces]
        first, second, third = corners.swapaxes(0, 1)
        outward = np.cross(second - first, third - first)
        assert (np.einsum("nk,nk->n", outward, first - points.mean(axis=0)) > 0).all()
        # Every side is between two faces, so the surface is closed.
        assert np.abs(outward.sum(axis=0)).max() < 1e-12
    np.testing.assert_allclose(signed_distance(points, scene.packed), 0.0, atol=1e-9)
