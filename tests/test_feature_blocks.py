"""Building blocks for features: directions, body frames, distances and the default features."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation
from toy_systems import Odometer, Turntable

from systems import (
    MujocoObstacles,
    System,
    check_system,
    directions,
    from_body_frame,
    motion_in_body_frame,
    ray_distances,
    shortest_way,
    to_body_frame,
)

plain = settings(derandomize=True, deadline=None, max_examples=50)


def finite(*shape, size=5.0):
    return arrays(float, shape, elements=st.floats(-size, size, allow_subnormal=False))


# Angles


@plain
@given(finite(4, 2), st.integers(-3, 3))
def test_directions_do_not_depend_on_whole_turns(angles, turns):
    np.testing.assert_allclose(
        directions(angles), directions(angles + turns * 2 * np.pi), atol=1e-12
    )
    assert directions(angles).shape == (4, 4)
    np.testing.assert_allclose(
        directions(angles), np.hstack([np.sin(angles), np.cos(angles)]), atol=0
    )


# Body frames


@plain
@given(finite(3, 3), finite(4, 2))
def test_planar_places_are_ahead_and_to_the_left(poses, places):
    points = from_body_frame(poses, places)
    for i, (x, y, heading) in enumerate(poses):
        as_complex = (x + 1j * y) + np.exp(1j * heading) * (places @ [1, 1j])
        np.testing.assert_allclose(points[i] @ [1, 1j], as_complex, atol=1e-9)
    np.testing.assert_allclose(to_body_frame(poses, points), np.tile(places, (3, 1, 1)), atol=1e-9)
    np.testing.assert_allclose(
        to_body_frame(poses, points[:, 1]), np.tile(places[1], (3, 1)), atol=1e-9
    )


def spatial(rng, n):
    """Make poses in space, whose quaternions are not normalized."""
    return np.hstack([rng.normal(size=(n, 3)), 3 * rng.normal(size=(n, 4))])


def test_spatial_places_are_turned_as_mujoco_turns_them(rng):
    import mujoco

    poses, places = spatial(rng, 6), rng.normal(size=(4, 3))
    points = from_body_frame(poses, places)
    for pose, own in zip(poses, points, strict=True):
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, pose[3:] / np.linalg.norm(pose[3:]))
        np.testing.assert_allclose(own, pose[:3] + places @ matrix.reshape(3, 3).T, atol=1e-9)
    np.testing.assert_allclose(to_body_frame(poses, points), np.tile(places, (6, 1, 1)), atol=1e-9)


def test_motions_look_the_same_wherever_the_body_is(rng):
    poses, places = rng.uniform(-3, 3, size=(2, 20, 3))
    moved = to_body_frame(poses, places[:, :2])
    motion = motion_in_body_frame(poses, places)
    np.testing.assert_allclose(motion[:, :2], moved)
    turn = shortest_way(poses, places, (2,))[:, 2]
    np.testing.assert_allclose(np.arctan2(motion[:, 2], motion[:, 3]), turn)
    shift = np.array([2.0, -1.0, 0.7])
    there = [
        np.c_[from_body_frame(shift[None], p[:, :2])[0], p[:, 2] + 0.7] for p in (poses, places)
    ]
    np.testing.assert_allclose(motion_in_body_frame(*there), motion, atol=1e-12)


def test_spatial_motions_are_seen_from_the_body(rng):
    poses, places = spatial(rng, 20), spatial(rng, 20)
    motion = motion_in_body_frame(poses, places)
    np.testing.assert_allclose(motion[:, :3], to_body_frame(poses, places[:, :3]))
    first, second = (Rotation.from_quat(p[:, [4, 5, 6, 3]]) for p in (poses, places))
    back = first * Rotation.from_rotvec(motion[:, 3:])
    np.testing.assert_allclose((back.inv() * second).magnitude(), 0, atol=1e-7)


def test_no_rows_and_unfit_rows_of_poses():
    for width, d, n in ((3, 2, 4), (7, 3, 6)):
        none = np.zeros((0, width))
        assert from_body_frame(none, np.zeros((5, d))).shape == (0, 5, d)
        assert motion_in_body_frame(none, none).shape == (0, n)
    with pytest.raises(ValueError, match="poses must have the shape"):
        from_body_frame(np.zeros((2, 4)), np.zeros((1, 3)))
    with pytest.raises(ValueError, match="places must have the shape"):
        from_body_frame(np.zeros((2, 3)), np.zeros((1, 3)))
    with pytest.raises(ValueError, match="points must have the shape"):
        to_body_frame(np.zeros((2, 3)), np.zeros((3, 2)))
    with pytest.raises(ValueError, match="next_poses must have the shape"):
        motion_in_body_frame(np.zeros((2, 3)), np.zeros((3, 3)))


# Distances

SCENE = """
<mujoco>
  <default><geom type="capsule" size="0.1 0.1"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <geom name="box" type="box" pos="2 0 1" size="0.5 0.4 0.3" euler="0 0 90"/>
    <body pos="0 2 1"><geom name="ball" type="sphere" size="0.5" rgba="1 1 1 0" contype="0"/></body>
    <body pos="0 0 1"><freejoint/><geom name="robot" type="sphere" size="0.3"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "scene.xml"
    file.write_text(SCENE)
    return file


def true_distance(points):
    """Signed distance from the box, which is turned by a right angle, and the ball."""
    beyond = np.abs(points - [2, 0, 1]) - [0.4, 0.5, 0.3]
    box = np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0)
    return np.minimum(box, np.linalg.norm(points - [0, 2, 1], axis=-1) - 0.5)


def test_distances_from_a_model_are_those_of_its_fixed_geoms(scene, rng):
    points = rng.uniform([-1, -1, 0], [3, 3, 2], size=(40, 5, 3))
    without_floor = MujocoObstacles(scene, ignore=["floor"])
    np.testing.assert_allclose(without_floor(points), true_distance(points), atol=1e-9)
    assert (without_floor(points) < 0).any(), "some points are inside"
    with_floor = np.minimum(true_distance(points), points[..., 2])
    np.testing.assert_allclose(MujocoObstacles(scene)(points), with_floor, atol=1e-9)
    copy = pickle.loads(pickle.dumps(without_floor))
    np.testing.assert_array_equal(copy(points), without_floor(points))
    assert without_floor(points[:0]).shape == (0, 5)


KINDS = """
<mujoco>
  <asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1  1 1 0.5"/></asset>
  <worldbody>
    <geom type="plane" size="5 5 1" pos="0 0 -2" euler="10 20 0"/>
    <geom type="sphere" size="0.4" pos="1 1 1"/>
    <geom type="capsule" size="0.2 0.5" pos="-1 1 0" euler="30 40 50"/>
    <geom type="cylinder" size="0.3 0.6" pos="1 -1 0" euler="50 -20 10"/>
    <geom type="box" size="0.3 0.5 0.7" pos="-1 -1 1" euler="15 75 -35"/>
    <geom type="ellipsoid" size="0.3 0.5 0.7" pos="0 0 2" euler="15 75 -35"/>
    <geom type="mesh" mesh="wedge" pos="2 0 2" euler="10 10 10"/>
    <body mocap="true" name="probe"><geom name="probe" type="sphere" size="0.001"/></body>
  </worldbody>
</mujoco>
"""


def test_all_kinds_of_geom_are_measured_as_by_mujoco(tmp_path, rng):
    import mujoco

    file = tmp_path / "kinds.xml"
    file.write_text(KINDS)
    points = rng.uniform(-2, 3, size=(300, 3))
    found = MujocoObstacles(file, ignore=["probe"])(points)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    probe = model.geom("probe").id
    expected = []
    for point in points:
        data.mocap_pos[0] = point
        mujoco.mj_kinematics(model, data)
        gaps = [
            mujoco.mj_geomDistance(model, data, probe, geom, 100, None)
            for geom in range(model.ngeom)
            if geom != probe
        ]
        expected.append(min(gaps) + 0.001)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    assert (found < -0.01).any()


def test_planar_points_are_measured_at_a_height(scene, rng):
    points = rng.uniform(-1, 3, size=(30, 2))
    low = MujocoObstacles(scene, ignore=["floor"], height=0.4)
    np.testing.assert_allclose(low(points), true_distance(np.c_[points, np.full(30, 0.4)]))


def test_where_nothing_stands_distances_are_infinite(scene):
    empty = MujocoObstacles(scene, ignore=["floor", "box", "ball"])
    assert np.isposinf(empty([[0.0, 0.0, 1.0]])).all()
    assert ray_distances(empty, [[0.0, 0.0, 1.0]], [[0, 0, -1.0]], reach=3.0) == 3.0


@pytest.mark.parametrize(
    ("arguments", "point", "message"),
    [
        ({"ignore": ["tree"]}, [0, 0, 0], r"which are \['floor', 'box', 'ball', 'robot'\], got"),
        ({}, [0, 0], "points must have the shape .*x, y and z"),
        ({"height": 1.0}, [0, 0, 0], "since a height is given"),
    ],
)
def test_unfit_questions_to_a_model_are_named(scene, arguments, point, message):
    with pytest.raises(ValueError, match=message):
        MujocoObstacles(scene, **arguments)([np.array(point, float)])


def test_rays_through_a_model_and_through_a_function_are_the_same(scene, rng):
    origins = rng.uniform([-1, -1, 0], [3, 3, 2], size=(200, 3))
    rays = rng.normal(size=(200, 3))
    found = ray_distances(MujocoObstacles(scene, ignore=["floor"]), origins, rays, reach=2.5)
    inside = true_distance(origins) < 0
    assert inside.any()
    assert (found[inside] == 0).all()
    ends = origins + found[:, None] * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    hit = (found < 2.5) & ~inside
    assert hit.sum() > 10
    np.testing.assert_allclose(true_distance(ends[hit]), 0, atol=1e-9)
    traced = ray_distances(true_distance, origins, rays, reach=2.5)
    np.testing.assert_allclose(traced, found, atol=5e-3)


def test_rays_are_broadcast_over_origins_and_end_at_their_reach():
    def wall(points):
        return 2 - points[..., 0]

    origins = np.array([[[0.0, 0.0]], [[1.0, 3.0]]])
    rays = np.array([[5.0, 0.0], [3.0, 3.0], [-1.0, 0.0]])
    found = ray_distances(wall, origins, rays, reach=2.5)
    expected = [[2, 2.5, 2.5], [1, np.sqrt(2), 2.5]]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert ray_distances(wall, origins[:0], rays[:1], reach=1.0).shape == (0, 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"reach": 0.0}, "reach must be a positive number"),
        ({"rays": [[0.0, 0.0]]}, "rays must be directions"),
        ({"obstacles": lambda points: points}, "one distance per point"),
    ],
)
def test_unfit_rays_are_named(arguments, message):
    good = {"obstacles": lambda points: points[:, 0], "origins": [[1.0, 0.0]], "reach": 1.0}
    with pytest.raises(ValueError, match=message):
        ray_distances(**{**good, "rays": [[1.0, 0.0]], **arguments})


# Default features


class PlainTurntable(Turntable):
    features = System.features


class PlainOdometer(Odometer):
    features = System.features


@pytest.mark.parametrize("make", [PlainTurntable, PlainOdometer])
def test_a_system_without_features_keeps_the_contract(make):
    check_system(make())


def test_default_features_are_places_directions_and_motions_in_steps():
    table = PlainTurntable()
    before = np.array([[3.0, 0.5], [0.0, -1.0]])
    after = np.array([[-3.2, 0.5], [0.05, -0.95]])
    expected = [
        [0.5, np.sin(3.0), np.cos(3.0), (2 * np.pi - 6.2) / 0.1, 0.0],
        [-1.0, 0.0, 1.0, 0.5, 0.5],
    ]
    np.testing.assert_allclose(table.features(before, after), expected, atol=1e-9)
    assert table.features(before[:0], after[:0]).shape == (0, 5)


def test_default_features_keep_what_is_beyond_the_configuration():
    before, after = np.array([[0.5, 1.0, 7.0]]), np.array([[0.5, 0.9, 7.1]])
    expected = [[0.5, 1.0, 7.0, 0.0, -1.0, 1.0]]
    np.testing.assert_allclose(PlainOdometer().features(before, after), expected)


def test_a_file_that_mujoco_cannot_read_leaves_no_log_behind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("absent.xml", "absent"):
        with pytest.raises(ValueError, match="model_file must be one that MuJoCo can read"):
            MujocoObstacles(name)([[0.0, 0.0, 0.0]])
    assert not list(tmp_path.iterdir())
