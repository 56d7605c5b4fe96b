"""Outlines for pictures are where the geometry that collides is."""

import numpy as np
import pytest

from systems import Car, CarScene, Circle, ConvexPolygon

POSES = [[2.0, 3.0, 0.0], [1.0, -0.5, 2.3], [0.0, 0.0, -np.pi]]


def enclosed_area(outline):
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("pose", POSES)
def test_the_cars_outline_is_all_that_is_near_its_axles(pose):
    outline = Car().outline(pose)
    heading = np.array([np.cos(pose[2]), np.sin(pose[2])])
    rear = np.array(pose[:2])
    along = np.clip((outline - rear) @ heading, 0.0, 0.3)
    distances = np.linalg.norm(outline - rear - along[:, None] * heading, axis=1)
    np.testing.assert_allclose(distances, 0.15)
    np.testing.assert_allclose(outline[0], outline[-1])
    expected = np.pi * 0.15**2 + 0.3 * 0.3
    assert enclosed_area(outline) == pytest.approx(expected, rel=0.01), "and counter-clockwise"


def test_the_outline_of_a_state_is_that_of_its_pose():
    pose = POSES[1]
    np.testing.assert_array_equal(Car().outline([*pose, 1.0, 0.3]), Car().outline(pose))


def test_a_car_that_touches_the_wall_touches_it_with_its_outline():
    car = Car(CarScene((), (0.0, 0.0, 4.0, 4.0)))
    pose = np.array([1.0, 2.0, 2.8])
    gap = car.clearance(pose[None])[0]
    outline = car.outline(pose)
    to_walls = np.concatenate([outline, 4.0 - outline]).min()
    assert gap == pytest.approx(to_walls, abs=1e-3)


def test_obstacles_have_outlines():
    circle = Circle(1.0, 2.0, 0.5)
    np.testing.assert_allclose(np.linalg.norm(circle.outline - [1.0, 2.0], axis=1), 0.5)
    assert enclosed_area(circle.outline) == pytest.approx(np.pi * 0.25, rel=0.01)
    corners = ((0.0, 0.0), (2.0, 0.0), (0.0, 1.0))
    np.testing.assert_array_equal(ConvexPolygon(corners).outline, corners)
