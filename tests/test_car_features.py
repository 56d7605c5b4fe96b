"""What an estimator sees of the car's transitions, against plain versions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from systems import Car, CarScene, Circle, ConvexPolygon, random_car_scene

seeds = st.integers(0, 2**32 - 1)
AHEAD, ASIDE = (-1.05, -0.45, 0.15, 0.75, 1.35), (-1.0, -0.5, 0.0, 0.5, 1.0)
PARTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25)


def point_distance(scene, point):
    """Signed distance of a point from the nearest obstacle or wall."""
    x_min, y_min, x_max, y_max = scene.bounds
    x, y = point
    nearest = min(x - x_min, x_max - x, y - y_min, y_max - y)
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Circle):
            distance = np.hypot(x - obstacle.x, y - obstacle.y) - obstacle.radius
        else:
            distance = polygon_distance(np.array(obstacle.corners), point)
        nearest = min(nearest, distance)
    return nearest


def polygon_distance(corners, point):
    nearest, depths = np.inf, []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side = b - a
        share = np.clip(np.dot(point - a, side) / np.dot(side, side), 0, 1)
        nearest = min(nearest, np.linalg.norm(point - a - share * side))
        depths.append((side[0] * (point - a)[1] - side[1] * (point - a)[0]) / np.linalg.norm(side))
    return -min(depths) if min(depths) > 0 else nearest


def rotated(vector, angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]]) @ vector


def on_arc(pose, chord, turn, part):
    """The pose after a part of an arc, from the arc's centre."""
    if abs(turn) < 1e-9:
        return np.array([*(pose[:2] + rotated([part * chord, 0], pose[2])), pose[2]])
    radius = chord / (2 * np.sin(turn / 2))
    angle = part * turn
    moved = rotated([radius * np.sin(angle), radius * (1 - np.cos(angle))], pose[2])
    return np.array([*(pose[:2] + moved), pose[2] + angle])


def plain_features(car, pose, end):
    ahead, left = rotated(end[:2] - pose[:2], -pose[2])
    turn = (end[2] - pose[2] + np.pi) % (2 * np.pi) - np.pi
    length = np.hypot(ahead, left)
    chord = length if ahead >= 0 else -length
    arc = np.array([on_arc(pose, chord, turn, part) for part in PARTS])
    clearances = np.clip(car.clearance(np.vstack([end, arc])) / 0.3, -1, 1)
    sensed = [
        np.clip(point_distance(car.scene, pose[:2] + rotated([a, b], pose[2])), -1, 1)
        for a in AHEAD
        for b in ASIDE
    ]
    slip = np.sin(np.arctan2(left, ahead) - turn / 2)
    curvature = np.clip(turn / length, -4, 4) / 4
    return np.array([ahead, left, turn, slip, curvature, *clearances, *sensed])


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seeds)
def test_features_agree_with_plain_ones(seed):
    rng = np.random.default_rng(seed)
    car = Car(random_car_scene(rng))
    poses = rng.uniform(*car.bounds, size=(8, 3))
    ends = poses + rng.normal(size=(8, 3)) * rng.choice([0.05, 0.5, 2.0], size=(8, 1))
    rows = car.features(poses, ends)
    for pose, end, row in zip(poses, ends, rows, strict=True):
        np.testing.assert_allclose(row, plain_features(car, pose, end), atol=1e-9)


@pytest.mark.parametrize("way", [(0.5, 0.0, 0.0), (-0.5, 0.0, 0.0), (0.4, 0.1, 0.0)])
def test_straight_motions_have_no_curvature(way):
    car, pose = Car("open_lot"), np.array([1.0, 1.0, 0.0])
    row = car.features(pose[None], (pose + way)[None])[0]
    np.testing.assert_allclose(row, plain_features(car, pose, pose + way), atol=1e-9)
    assert row[4] == 0


def test_standing_still_has_finite_features():
    car, pose = Car("open_lot"), np.array([[1.0, 1.0, 0.5]])
    row = car.features(pose, pose)[0]
    assert row[:5].tolist() == [0] * 5
    assert np.isfinite(row).all()


def test_sliding_sideways_slips_fully_and_arcs_do_not():
    car, pose = Car("open_lot"), np.array([[4.0, 2.0, 0.0]])
    sideways, arc = (
        car.features(pose, pose + np.array(way))[0, 3] for way in ([0, 0.3, 0], [0.3, 0.0, 0.0])
    )
    assert (sideways, arc) == (1.0, 0.0)
    quarter = car.features(pose, pose + np.array([0.5, 0.5, np.pi / 2]))[0, 3]
    assert quarter == pytest.approx(0)


def test_obstacles_are_where_they_look_to_be():
    """A wall to the left is seen in the left column, and a polygon's inside is negative."""
    scene = CarScene(
        (ConvexPolygon(((2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (2.0, 2.0))),), (-9.0, -9.0, 9.0, 9.0)
    )
    sensed = Car(scene).features(np.array([[1.0, 0, 0]]), np.array([[1.2, 0, 0]]))[0, 12:]
    ahead = sensed.reshape(5, 5)
    np.testing.assert_allclose(ahead[:, 2], [1.0, 1.0, 0.85, 0.25, -0.35])
