import itertools
import pickle
from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given, settings
from scipy.optimize import minimize
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from systems import Box, Capsule, ConvexPolyhedron, Cylinder, Sphere
from systems.rope.obstacles import packing
from systems.rope.obstacles.packing import pack_obstacles
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
spheres = st.builds(Sphere, point, size)
rotations = st.integers(0, 10**6).map(lambda seed: Rotation.random(random_state=seed).as_matrix())
rotated_boxes = st.builds(
    lambda center, half_extents, rotation: Box(center, half_extents, rotation=rotation),
    point,
    st.tuples(size, size, size),
    rotations,
)
slanted_cylinders = st.builds(Cylinder, point, size, size, st.tuples(size, coordinate, coordinate))
polyhedra = st.builds(
    lambda center, seed, n: ConvexPolyhedron(
        center + np.random.default_rng(seed).normal(scale=0.3, size=(n, 3))
    ),
    point,
    st.integers(0, 10**6),
    st.integers(4, 12),
)
obstacle = st.one_of(
    boxes, cylinders, capsules, spheres, rotated_boxes, slanted_cylinders, polyhedra
)


QUARTER_TURN = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
OCTAHEDRON = 0.1 * np.concatenate([np.eye(3), -np.eye(3)])
FLAT = np.random.default_rng(0).random((20, 3)) * (1.0, 1.0, 1e-5)
ON_A_BALL = np.random.default_rng(0).normal(size=(501, 3))
ON_A_BALL /= np.linalg.norm(ON_A_BALL, axis=1, keepdims=True)


def with_gradient(p, packed):
    distance, *gradient = distance_and_gradient(*map(float, p), packed)
    return distance, np.array(gradient)


def box_reference(p, box):
    turn = Rotation.from_matrix(box.rotation)
    q = np.abs(turn.inv().apply(np.subtract(p, box.center))) - box.half_extents
    return np.linalg.norm(np.maximum(q, 0.0)) if (q > 0.0).any() else q.max()


def cylinder_reference(p, cylinder):
    offset = np.subtract(p, cylinder.center)
    axis = np.eye(3)[cylinder.axis] if isinstance(cylinder.axis, int) else cylinder.axis
    q = np.array(
        [
            np.linalg.norm(np.cross(offset, axis)) - cylinder.radius,
            abs(np.dot(offset, axis)) - cylinder.half_length,
        ]
    )
    return np.linalg.norm(np.maximum(q, 0.0)) if (q > 0.0).any() else q.max()


def capsule_reference(p, capsule):
    start, axis = np.array(capsule.start), np.subtract(capsule.end, capsule.start)
    along = np.clip(np.dot(p - start, axis) / np.dot(axis, axis), 0.0, 1.0)
    return np.linalg.norm(p - start - along * axis) - capsule.radius


def sphere_reference(p, sphere):
    return np.linalg.norm(np.subtract(p, sphere.center)) - sphere.radius


def polyhedron_reference(p, polyhedron):
    """By the foot of the point on each corner, edge and face: on all that their corners span."""
    hull = ConvexHull(polyhedron.corners)
    height = (hull.equations[:, :3] @ p + hull.equations[:, 3]).max()
    return height if height <= 0 else min(distance_to_triangle(p, hull, f) for f in hull.simplices)


def distance_to_triangle(p, hull, face):
    found = []
    for n in (1, 2, 3):
        for corners in itertools.combinations(face, n):
            first, others = hull.points[corners[0]], hull.points[list(corners[1:])]
            sides = (others - first).T
            shares = np.linalg.lstsq(sides, p - first)[0] if n > 1 else np.zeros(0)
            if (shares >= 0).all() and shares.sum() <= 1:
                found.append(np.linalg.norm(p - first - sides @ shares))
    return min(found)


def support(obstacle, ways):
    """How far an obstacle reaches from the origin in each of some directions."""
    if isinstance(obstacle, Sphere):
        return ways @ np.array(obstacle.center) + obstacle.radius
    if isinstance(obstacle, ConvexPolyhedron):
        return (ways @ np.array(obstacle.corners).T).max(axis=1)
    if isinstance(obstacle, Capsule):
        return (ways @ np.array([obstacle.start, obstacle.end]).T).max(axis=1) + obstacle.radius
    at = ways @ np.array(obstacle.center)
    if isinstance(obstacle, Box):
        return at + np.abs(ways @ np.array(obstacle.rotation)) @ np.array(obstacle.half_extents)
    along = ways @ obstacle.direction
    across = np.sqrt(np.maximum(0.0, 1.0 - along**2))
    return at + np.abs(along) * obstacle.half_length + across * obstacle.radius


def reference(p, obstacles):
    by_kind = {
        Box: box_reference,
        Cylinder: cylinder_reference,
        Capsule: capsule_reference,
        Sphere: sphere_reference,
        ConvexPolyhedron: polyhedron_reference,
    }
    return min(by_kind[type(each)](np.array(p), each) for each in obstacles)


@given(st.lists(obstacle, min_size=1, max_size=6), st.lists(point, min_size=1, max_size=8))
@settings(deadline=None, derandomize=True)
def test_the_distance_is_the_smallest_of_the_obstacles_distances(obstacles, points):
    distances = signed_distance(np.array(points), pack_obstacles(obstacles))
    np.testing.assert_allclose(distances, [reference(p, obstacles) for p in points], atol=1e-9)


@given(obstacle, st.tuples(*[st.floats(-1.5, 1.5)] * 3))
@settings(deadline=None, derandomize=True, max_examples=30)
def test_the_distance_is_to_the_farthest_plane_that_parts_a_point_from_the_obstacle(each, p):
    """Of a convex body, that is true outside and inside: a way to find it that knows no shapes."""

    def beyond(angles):
        a, b = angles.T
        ways = np.column_stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
        return ways @ np.array(p) - support(each, ways)

    grid = np.meshgrid(np.linspace(0.0, np.pi, 60), np.linspace(0.0, 2 * np.pi, 120))
    starts = np.column_stack([angles.ravel() for angles in grid])
    best = starts[np.argsort(-beyond(starts))[:3]]
    found = [
        minimize(
            lambda at: -beyond(at[None])[0], start, method="Nelder-Mead", options={"xatol": 1e-9}
        ).fun
        for start in best
    ]
    distance = signed_distance(np.array(p), pack_obstacles([each]))
    assert distance == pytest.approx(-min(found), abs=1e-4)
    # No plane parts it by more than the distance, whatever the search has found.
    assert -min(found) <= distance + 1e-7
    assert beyond(starts).max() <= distance + 1e-7


@given(obstacle, point)
@settings(deadline=None, derandomize=True)
def test_the_gradient_leads_to_the_surface(obstacle, p):
    packed = pack_obstacles([obstacle])
    distance, gradient = with_gradient(p, packed)
    assert np.linalg.norm(gradient) == pytest.approx(1.0)
    if distance > 0.0:
        on_surface = np.array(p) - distance * gradient
        assert signed_distance(on_surface, packed) == pytest.approx(0.0, abs=1e-9)


@given(st.lists(obstacle, min_size=1, max_size=6), point)
@example([Capsule((-0.03125, 0.0, 0.0), (0.01875, 0.0, 0.0), 0.5)], (0.0, 0.0, 0.0))
@settings(deadline=None, derandomize=True)
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
        Sphere((0.0, 0.0, 0.0), 0.1),
        Cylinder((0.0, 0.0, 0.0), 0.1, 0.1, (1.0, 1.0, 0.0)),
        Cylinder((0.0, 0.0, 0.0), 0.1, 0.1, (0.0, 0.0, -1.0)),
        Box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), rotation=QUARTER_TURN),
        ConvexPolyhedron(OCTAHEDRON),
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
        (lambda: Cylinder((0, 0, 0), 1.0, 1.0, (0, 0, 0)), "axis must be a direction, whose"),
        (lambda: Cylinder((0, 0, 0), 1.0, 1.0, (1, 0)), r"Cylinder.axis must have the shape \(3\)"),
        (lambda: Cylinder((0, 0, 0), 1.0, 1.0, (1, 0, np.nan)), "Cylinder.axis must be finite"),
        (lambda: Sphere((0, 0, 0), 0.0), "Sphere.radius must be positive"),
        (lambda: Sphere((0, 0, np.inf), 1.0), "Sphere.center must be finite"),
        (lambda: Box((0, 0, 0), (1, 1, 1), rotation=2 * np.eye(3)), "must be a rotation matrix"),
        (lambda: Box((0, 0, 0), (1, 1, 1), rotation=-np.eye(3)), "must be a rotation.*right-hand"),
        (lambda: Box((0, 0, 0), (1, 1, 1), rotation=np.ones((3, 3))), "must be a rotation matrix"),
        (lambda: Box((0, 0, 0), (1, 1, 1), rotation=(1, 0, 0)), r"rotation must have the shape"),
        (lambda: ConvexPolyhedron([]), "ConvexPolyhedron.corners must have the shape"),
        (lambda: ConvexPolyhedron(np.zeros((0, 3))), "corners must be at least four points"),
        (lambda: ConvexPolyhedron(np.eye(3)), "at least four points.* got 3 points"),
        (lambda: ConvexPolyhedron(np.zeros((9, 3))), "at least four points that are not in one pl"),
        (lambda: ConvexPolyhedron(FLAT), "not in one plane.*a width of"),
        (lambda: ConvexPolyhedron(1e8 * OCTAHEDRON), "at most 1e.06 m from the origin"),
        (lambda: ConvexPolyhedron(ON_A_BALL), "hull of at most 500 corners, got 501"),
        (lambda: Capsule((0, 0, 0), (0, 0, 0), 1.0), "must differ"),
        (lambda: Capsule((0, 0, 0), (1, 0, 0), np.inf), "radius must be positive and finite"),
        (lambda: pack_obstacles(["box"]), r"obstacles\[0\] must be a Box, Cyl"),
    ],
)
def test_degenerate_obstacles_are_refused(build, words):
    with pytest.raises(ValueError, match=words):
        build()


def test_equal_shapes_that_are_said_in_two_ways_have_the_same_distance(rng):
    points = rng.uniform(-1.0, 1.0, size=(300, 3))
    center, half = (0.1, 0.2, -0.1), np.array([0.1, 0.3, 0.2])
    corners = np.array(list(itertools.product((-1, 1), repeat=3))) * half
    turn = Rotation.from_euler("xyz", (10, 20, 30), degrees=True)
    for one, other in (
        (Box(center, half), ConvexPolyhedron(center + corners)),
        (Box(center, half), Box(center, half[[1, 0, 2]], rotation=QUARTER_TURN)),
        (
            Box(center, half, rotation=turn.as_matrix()),
            ConvexPolyhedron(center + turn.apply(corners)),
        ),
        (Cylinder(center, 0.1, 0.3, 0), Cylinder(center, 0.1, 0.3, (-2.0, 0.0, 0.0))),
        (Cylinder(center, 0.1, 0.3, 2), Cylinder(center, 0.1, 0.3, (0.0, 0.0, 1e-200))),
        (Sphere(center, 0.2), Capsule(center, np.add(center, (0.0, 0.0, 1e-6)), 0.2)),
    ):
        np.testing.assert_allclose(
            signed_distance(points, pack_obstacles([one])),
            signed_distance(points, pack_obstacles([other])),
            atol=2e-6 if isinstance(one, Sphere) else 1e-12,
        )


def test_shapes_keep_what_they_are_given_and_stay_the_same_when_they_are_made_again():
    turn = Rotation.from_euler("x", 30, degrees=True).as_matrix()
    box = Box((0, 0, 0), (1, 2, 3), "ramp", turn)
    np.testing.assert_array_equal(box.rotation, turn)
    assert replace(box) == box
    rounded = Box((0, 0, 0), (1, 2, 3), rotation=turn.round(7))
    np.testing.assert_allclose(rounded.rotation, turn, atol=1e-6)
    product = np.transpose(rounded.rotation) @ rounded.rotation
    np.testing.assert_allclose(product, np.eye(3), atol=1e-15)
    assert not Box((0, 0, 0), (1, 2, 3), rotation=np.eye(3)).is_rotated
    pole = Cylinder((0, 0, 0), 1.0, 2.0, [0.0, 3.0, 4.0])
    assert pole.axis == (0.0, 0.6, 0.8)
    assert replace(pole) == pole
    assert Cylinder((0, 0, 0), 1.0, 2.0, np.int64(1)).axis == 1
    inside = np.concatenate([OCTAHEDRON, 0.3 * OCTAHEDRON])
    wedge = ConvexPolyhedron(inside)
    np.testing.assert_array_equal(wedge.corners, OCTAHEDRON)
    assert replace(wedge) == wedge == pickle.loads(pickle.dumps(wedge))


def test_a_far_away_polyhedron_of_many_corners_is_exact(rng):
    far = np.array([100.0, 0.0, 0.0])
    ball = ConvexPolyhedron(far + ON_A_BALL[:500])
    points = far + rng.normal(size=(200, 3)) * 3
    distances = signed_distance(points, pack_obstacles([ball]))
    expected = np.linalg.norm(points - far, axis=1) - 1.0
    assert (distances >= expected - 1e-9).all()
    assert (distances <= expected + 0.03).all()
