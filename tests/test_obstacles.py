import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from systems.rope.obstacles import packing
from systems.rope.obstacles.packing import pack_obstacles
from systems.rope.obstacles.shapes import Box, Capsule, Cylinder
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.obstacles.signed_distance_kernels import distance_and_gradient

coordinate = st.floats(-1.0, 1.0)
point = st.tuples(coordinate, coordinate, coordinate)
size = st.floats(0.05, 0.5)
boxes = st.builds(Box, point, st.tuples(size, size, size))
cylinders = st.builds(Cylinder, point, size, size, st.sampled_from((0, 1, 2)))
capsules = st.builds(
    lambda start, way, radius: Capsule(start, tuple(np.add(start, way)), radius),
    point,
    st.tuples(size, coordinate, coordinate),
    size,
)
obstacle = st.one_of(boxes, cylinders, capsules)


def with_gradient(p, packed):
    distance, *gradient = distance_and_gradient(*map(float, p), packed)
    return distance, np.array(gradient)


def box_reference(p, box):
    q = np.abs(np.subtract(p, box.center)) - box.half_extents
    return np.linalg.norm(np.maximum(q, 0.0)) if (q > 0.0).any() else q.max()


def cylinder_reference(p, cylinder):
    offset = np.subtract(p, cylinder.center)
    q = np.array(
        [
            np.linalg.norm(np.delete(offset, cylinder.axis)) - cylinder.radius,
            abs(offset[cylinder.axis]) - cylinder.half_length,
        ]
    )
    return np.linalg.norm(np.maximum(q, 0.0)) if (q > 0.0).any() else q.max()


def capsule_reference(p, capsule):
    start, axis = np.array(capsule.start), np.subtract(capsule.end, capsule.start)
    along = np.clip(np.dot(p - start, axis) / np.dot(axis, axis), 0.0, 1.0)
    return np.linalg.norm(p - start - along * axis) - capsule.radius


def reference(p, obstacles):
    by_kind = {Box: box_reference, Cylinder: cylinder_reference, Capsule: capsule_reference}
    return min(by_kind[type(each)](np.array(p), each) for each in obstacles)


@given(st.lists(obstacle, min_size=1, max_size=6), st.lists(point, min_size=1, max_size=8))
@settings(deadline=None)
def test_the_distance_is_the_smallest_of_the_obstacles_distances(obstacles, points):
    distances = signed_distance(np.array(points), pack_obstacles(obstacles))
    np.testing.assert_allclose(distances, [reference(p, obstacles) for p in points], atol=1e-9)


@given(obstacle, point)
@settings(deadline=None)
def test_the_gradient_leads_to_the_surface(obstacle, p):
    packed = pack_obstacles([obstacle])
    distance, gradient = with_gradient(p, packed)
    assert np.linalg.norm(gradient) == pytest.approx(1.0)
    if distance > 0.0:
        on_surface = np.array(p) - distance * gradient
        assert signed_distance(on_surface, packed) == pytest.approx(0.0, abs=1e-9)


@given(st.lists(obstacle, min_size=1, max_size=6), point)
@settings(deadline=None)
def test_following_the_gradient_increases_the_distance_as_far_as_one_goes(obstacles, p):
    packed = pack_obstacles(obstacles)
    distance, gradient = with_gradient(p, packed)
    moved = signed_distance(np.array(p) + 1e-7 * gradient, packed)
    # Where two surfaces are equally near, the distance to one of them grows and the other may not.
    nearest = sorted(reference(p, [each]) for each in obstacles)
    if len(nearest) == 1 or nearest[1] - nearest[0] > 1e-6:
        assert moved - distance == pytest.approx(1e-7, rel=1e-2)


@given(st.lists(obstacle, min_size=1, max_size=6), point, st.tuples(size, coordinate, size))
@settings(deadline=None, derandomize=True)
def test_distances_change_by_no_more_than_the_point_moves(obstacles, p, way):
    packed = pack_obstacles(obstacles)
    here, there = signed_distance(np.array([p, np.add(p, way)]), packed)
    assert abs(there - here) <= np.linalg.norm(way) + 1e-9


@given(st.lists(obstacle, min_size=2, max_size=6), st.lists(point, min_size=1, max_size=8))
@settings(deadline=None, derandomize=True)
def test_distances_are_to_the_union_in_whatever_order_it_is_given(obstacles, points):
    points = np.array(points)
    distances = signed_distance(points, pack_obstacles(obstacles))
    np.testing.assert_array_equal(
        signed_distance(points, pack_obstacles(obstacles[::-1])), distances
    )
    without = signed_distance(points, pack_obstacles(obstacles[1:]))
    alone = signed_distance(points, pack_obstacles(obstacles[:1]))
    np.testing.assert_allclose(distances, np.minimum(without, alone), atol=1e-9)


@given(obstacle, point)
@settings(deadline=None, derandomize=True)
def test_inside_an_obstacle_the_gradient_leads_out_the_shortest_way(each, p):
    packed = pack_obstacles([each])
    distance, gradient = with_gradient(p, packed)
    if distance < -1e-6:
        surface = np.array(p) - distance * gradient
        assert signed_distance(surface, packed) == pytest.approx(0.0, abs=1e-9)
        beyond = np.array(p) - (distance - 0.01) * gradient
        assert signed_distance(beyond, packed) > 0.0


def test_packed_obstacles_have_boxes_first_and_named_columns():
    capsule = Capsule((0.1, 0.2, 0.3), (0.4, 0.6, 0.8), 0.05)
    cylinder = Cylinder((1.0, 2.0, 3.0), 0.1, 0.2, axis=1)
    box = Box((-1.0, -2.0, -3.0), (0.1, 0.2, 0.3))
    packed = pack_obstacles([capsule, cylinder, box])
    np.testing.assert_array_equal(packed[:, packing.KIND], [packing.BOX, packing.CYLINDER, 2.0])
    np.testing.assert_array_equal(packed[0, [packing.X, packing.Y, packing.Z]], box.center)
    half = [packing.HALF_X, packing.HALF_Y, packing.HALF_Z]
    np.testing.assert_array_equal(packed[0, half], box.half_extents)
    np.testing.assert_array_equal(packed[1, [packing.AXIS, packing.HALF_LENGTH]], [1, 0.2])
    core = [packing.CORE_X, packing.CORE_Y, packing.CORE_Z]
    np.testing.assert_allclose(packed[2, core], [0.3, 0.4, 0.5])
    np.testing.assert_array_equal(packed[1:, packing.RADIUS], [0.1, 0.05])


def test_points_keep_their_shape():
    packed = pack_obstacles([Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))])
    assert signed_distance(np.full((2, 3, 3), 3.0), packed).shape == (2, 3)
    assert signed_distance(np.array([3.0, 0.0, 0.0]), packed) == pytest.approx(2.0)
    assert signed_distance(np.array([0.5, 0.0, 0.0]), packed) == pytest.approx(-0.5)


def test_without_obstacles_everything_is_far_away():
    distance, gradient = with_gradient(np.zeros(3), pack_obstacles([]))
    assert distance >= 1e9
    assert signed_distance(np.zeros((1, 3)), pack_obstacles([]))[0] == distance
    assert (gradient == 0.0).all()


@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.3)])
def test_gradients_are_finite_where_directions_are_ambiguous(p):
    for each in (
        Box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1)),
        Cylinder((0.0, 0.0, 0.0), 0.1, 0.1, 2),
        Cylinder((0.0, 0.0, 0.0), 0.1, 0.1, 0),
        Capsule((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.1),
        Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), 0.1),
    ):
        _, gradient = with_gradient(p, pack_obstacles([each]))
        assert np.linalg.norm(gradient) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Box((0, 0, 0), (1, 0, 1)), "half_extents must be positive"),
        (lambda: Box((0, np.nan, 0), (1, 1, 1)), "Box.center must be finite"),
        (lambda: Box((0, 0), (1, 1, 1)), r"Box.center must have the shape \(3\)"),
        (lambda: Cylinder((0, 0, 0), -1.0, 1.0), "radius must be positive"),
        (lambda: Cylinder((0, 0, 0), 1.0, np.nan), "half_length must be positive"),
        (lambda: Cylinder((0, 0, 0), 1.0, 1.0, 3), r"axis must be 0 \(x\), 1 \(y\) or 2 \(z\)"),
        (lambda: Capsule((0, 0, 0), (0, 0, 0), 1.0), "must differ"),
        (lambda: Capsule((0, 0, 0), (1, 0, 0), np.inf), "radius must be positive and finite"),
        (lambda: pack_obstacles(["box"]), r"obstacles\[0\] must be a Box"),
    ],
)
def test_degenerate_obstacles_are_refused(build, words):
    with pytest.raises(ValueError, match=words):
        build()
