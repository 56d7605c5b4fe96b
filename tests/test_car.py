"""The car: its scenes, its model, its execution, and what it shows an estimator."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from systems import (
    Car,
    CarScene,
    Circle,
    ConvexPolygon,
    StopReason,
    check_system,
    random_car_scene,
)

NOTHING_NEAR = CarScene((), (-50.0, -50.0, 50.0, 50.0))
CONTACT = 1e-3
ROUNDING = 1e-9
seeds = st.integers(0, 2**32 - 1)


def free_states(car, rng, n):
    """States at any speed and steering angle, as many as are free of ``n`` drawn."""
    poses = rng.uniform(*car.bounds, size=(n, 3))
    motion = np.column_stack([rng.uniform(-2.5, 2.5, n), rng.uniform(-0.55, 0.55, n)])
    return np.hstack([poses, motion])[car.clearance(poses) > CONTACT]


def random_commands(rng, n):
    return rng.normal(size=(n, 3)) * rng.choice([0.1, 0.5, 1.0], size=(n, 1))


@pytest.mark.parametrize("scene", ["open_lot", "slalom", "narrow_gate"])
def test_shipped_scenes_keep_the_contract(scene):
    check_system(Car(scene))


@settings(max_examples=5, deadline=None, derandomize=True)
@given(seeds)
def test_random_scenes_keep_the_contract(seed):
    check_system(Car(random_car_scene(seed)), random_state=seed)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seeds)
def test_execution_never_leaves_the_free_space(seed):
    rng = np.random.default_rng(seed)
    car = Car(random_car_scene(rng))
    states = free_states(car, rng, 600)
    ends, completed = car.execute(states, random_commands(rng, len(states)))
    room = car.clearance(ends[:, :3])
    assert (room >= CONTACT - ROUNDING).all()
    assert (room[~completed] <= CONTACT + 1e-6).all()


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seeds)
def test_rollouts_stay_free_and_end_on_the_boundary(seed):
    rng = np.random.default_rng(seed)
    car = Car(random_car_scene(rng))
    start = free_states(car, rng, 50)[0]
    rollout = car.rollout(start, random_commands(rng, 40))
    room = car.clearance(rollout.states[:, :3])
    assert (room >= CONTACT - ROUNDING).all()
    if rollout.stop_reason is StopReason.CONSTRAINT:
        assert len(rollout.states) == rollout.n_completed + 2
        assert room[-1] <= CONTACT + 1e-6
    else:
        assert len(rollout.states) == 41


@settings(max_examples=50, deadline=None, derandomize=True)
@given(seeds)
def test_a_rollout_is_its_commands_one_by_one(seed):
    rng = np.random.default_rng(seed)
    car = Car(random_car_scene(rng))
    start = free_states(car, rng, 50)[0]
    commands = random_commands(rng, 10)
    rollout = car.rollout(start, commands)
    for i in range(len(rollout.states) - 1):
        following, completed = car.execute(rollout.states[i : i + 1], commands[i : i + 1])
        np.testing.assert_array_equal(following[0], rollout.states[i + 1])
        assert completed[0] == (i < rollout.n_completed)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    turn=st.floats(-0.9, 0.9),
    share=st.floats(0.5, 1.0),
    backwards=st.booleans(),
    speed=st.floats(0.0, 1.0),
    heading=st.floats(-3.1, 3.1),
)
def test_it_reaches_what_it_can_drive_to_when_nothing_is_near(
    turn, share, backwards, speed, heading
):
    """Ends of circles that the wheels can follow, at any heading, forwards and backwards."""
    radius = max(0.65, 0.6 / max(abs(turn), 1e-3))
    length = min(0.95, share * abs(turn) * radius + 0.3) if abs(turn) > 0.3 else share * 0.9
    length = max(length, abs(turn) * 0.65)
    direction = -1.0 if backwards else 1.0
    bend = direction * turn
    chord = length * np.sinc(bend / 2 / np.pi) * direction
    way = heading + bend / 2
    command = np.array([chord * np.cos(way), chord * np.sin(way), bend])
    car = Car(NOTHING_NEAR)
    state = np.array([0.0, 0.0, heading, direction * speed, 0.0])
    end, completed = car.execute(state[None], command[None])
    assert completed[0]
    assert car.distance(end[:, :3], (state[:3] + command)[None])[0] < 0.1


def test_speed_carries_over_and_decides():
    """The same pose and command pass slowly and hit fast (the paper's Fig. 4)."""
    car = Car(CarScene((Circle(1.6, 0.2, 0.5),), (-2.0, -3.0, 4.0, 3.0)))
    pose, command = [0.3, 0.0, 0.0], np.array([[0.75, -0.35, -0.85]])
    assert car.propagate(np.array([pose]), command)[1][0]
    _, completed = car.execute([[*pose, v, 0.0] for v in (0.3, 2.0)], np.tile(command, (2, 1)))
    assert completed.tolist() == [True, False]
    straight = np.array([[0.5, 0.0, 0.0]])
    slow, fast = car.execute([[-1, 2, 0, 0.2, 0], [-1, 2, 0, 2.5, 0]], np.tile(straight, (2, 1)))[0]
    assert slow[3] < fast[3]


def test_standing_still_is_braking():
    car = Car(NOTHING_NEAR)
    end, completed = car.execute([[0, 0, 0, 2.0, 0]], np.zeros((1, 3)))
    assert completed[0]
    assert end[0, 3] == 0
    assert end[0, 0] == pytest.approx(2.0**2 / (2 * 2.0), abs=0.02)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seeds)
def test_model_agrees_with_looking_at_many_places_along_the_way(seed):
    rng = np.random.default_rng(seed)
    car = Car(random_car_scene(rng))
    poses = free_states(car, rng, 60)[:, :3]
    moves = random_commands(rng, len(poses))
    ends, valid = car.propagate(poses, moves)
    along = np.linspace(0, 1, 400)[:, None, None]
    sampled = (poses + along * moves).reshape(-1, 3)
    least = car.clearance(sampled).reshape(400, -1).min(axis=0)
    assert (least[valid] >= 0.5 * CONTACT).all()
    assert (least[~valid] <= CONTACT + 0.01).all()
    np.testing.assert_allclose(np.cos(ends[:, 2]), np.cos(poses[:, 2] + moves[:, 2]), atol=1e-12)
    assert ((ends[:, 2] >= -np.pi) & (ends[:, 2] < np.pi)).all()


def reference_clearance(scene, pose, n=400):
    """Sample the middle line of the footprint; distance to a polygon by its sides."""
    along = np.linspace(0, 0.3, n)[:, None]
    spine = pose[:2] + along * [np.cos(pose[2]), np.sin(pose[2])]
    x_min, y_min, x_max, y_max = scene.bounds
    distances = [spine - [x_min, y_min], [x_max, y_max] - spine]
    nearest = min(d.min() for d in distances)
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Circle):
            gap = np.linalg.norm(spine - [obstacle.x, obstacle.y], axis=1) - obstacle.radius
        else:
            gap = polygon_gap(spine, np.array(obstacle.corners))
        nearest = min(nearest, gap.min())
    return nearest - 0.15


def polygon_gap(points, corners):
    sides = np.roll(corners, -1, axis=0) - corners
    offset = points[:, None] - corners
    share = np.clip((offset * sides).sum(-1) / (sides**2).sum(-1), 0, 1)
    gap = np.linalg.norm(offset - share[..., None] * sides, axis=-1).min(axis=1)
    outside = (offset[..., 0] * sides[:, 1] - offset[..., 1] * sides[:, 0] > 0).any(axis=1)
    return np.where(outside, gap, -gap)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seeds)
def test_clearance_is_that_of_a_slow_reference(seed):
    rng = np.random.default_rng(seed)
    scene = random_car_scene(rng)
    car = Car(scene)
    poses = rng.uniform(*car.bounds, size=(20, 3))
    for pose, room in zip(poses, car.clearance(poses), strict=True):
        slow = reference_clearance(scene, pose)
        if slow > -0.15:
            assert room == pytest.approx(slow, abs=2e-3)
        else:
            assert room < 0


@pytest.mark.parametrize("width", [0.01, 0.1])
@pytest.mark.parametrize("heading", [0.0, 0.5, np.pi])
def test_a_thin_post_between_the_axles_is_contact(width, heading):
    half = 0.5 * width
    post = ((-half, -half), (half, -half), (half, half), (-half, half))
    car = Car(CarScene((ConvexPolygon(post),), (-5.0, -5.0, 5.0, 5.0)))
    rear = -0.15 * np.array([np.cos(heading), np.sin(heading)])
    astride = np.array([[*rear, heading]])
    assert car.clearance(astride)[0] == pytest.approx(-0.15)
    assert not car.propagate(astride, np.zeros((1, 3)))[1][0]


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seeds, st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_features_do_not_depend_on_where_the_car_is(seed, dx, dy, turn):
    """The whole world moved and turned gives the same rows."""
    rng = np.random.default_rng(seed)
    corners = np.array([[0.9, -0.3], [1.5, -0.2], [1.2, 0.6]])
    circle = rng.uniform(-1.5, 1.5, 2)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def rows(shift, matrix, angle):
        moved = corners @ matrix.T + shift
        x, y = matrix @ circle + shift
        scene = CarScene(
            (Circle(x, y, 0.3), ConvexPolygon(tuple(map(tuple, moved)))),
            (-50.0, -50.0, 50.0, 50.0),
        )
        end = np.array([0.6, 0.2, 0.4])
        poses = [np.array([[*(matrix @ p[:2] + shift), p[2] + angle]]) for p in (np.zeros(3), end)]
        return Car(scene).features(*poses)

    still = rows(np.zeros(2), np.eye(2), 0.0)
    np.testing.assert_allclose(rows(np.array([dx, dy]), rotation, turn), still, atol=1e-9)


def test_distances_take_the_short_way_round():
    car = Car(NOTHING_NEAR)
    one, other = np.array([[0, 0, 3.1]]), np.array([[0, 0, -3.1]])
    assert car.distance(one, other)[0] == pytest.approx(2 * np.pi - 6.2)
    assert car.close(one, other)[0]
    np.testing.assert_allclose(car.steer(one, other), [[0, 0, 2 * np.pi - 6.2]])
    assert car.succeeded([0, 0, 3.1, 0, 0], other, 0.1)


def test_the_pose_of_a_state_has_its_heading_in_range():
    car = Car(NOTHING_NEAR)
    state = np.array([1.0, 2.0, 4.0, 0.5, 0.1])
    np.testing.assert_allclose(car.reduce(state), [1, 2, 4 - 2 * np.pi])
    assert state[2] == 4.0
    np.testing.assert_array_equal(car.reduce([1, 2, 3, 0, 0]), [1, 2, 3])


def test_steering_is_one_step_at_most_towards_the_pose():
    car = Car(NOTHING_NEAR)
    near, far = np.array([[0.3, 0.4, -0.5]]), np.array([[3.0, 4.0, 0.0]])
    np.testing.assert_array_equal(car.steer(np.zeros((1, 3)), near), near)
    np.testing.assert_allclose(car.steer(np.zeros((1, 3)), far), far / 5)


def test_close_and_goals_are_within_a_quarter_of_the_cars_length():
    car = Car(NOTHING_NEAR)
    poses = np.array([[0.149, 0, 0], [0.151, 0, 0], [0, 0.1, 0.12], [0, 0, -0.149]])
    expected = [True, False, False, True]
    assert car.close(poses, np.zeros((4, 3))).tolist() == expected
    assert car.goal_reached(poses, np.array([[9.0, 9, 0], [0, 0, 0]])).tolist() == expected
    assert car.succeeded([0.3, 0, 0, 1, 0], np.zeros((1, 3)), 0.31)
    assert not car.succeeded([0.3, 0, 0, 1, 0], np.zeros((1, 3)), 0.29)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seeds)
def test_random_scenes_are_lots_with_five_to_ten_obstacles(seed):
    scene = random_car_scene(seed)
    assert scene == random_car_scene(np.random.default_rng(seed))
    assert scene.bounds == (0, 0, 8, 8)
    assert 5 <= len(scene.obstacles) <= 10
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Circle):
            assert 0.2 <= obstacle.radius <= 0.7
        else:
            sides = np.diff(obstacle.corners, axis=0)
            length, width = np.linalg.norm(sides[:2], axis=1)
            assert 0.3 <= min(length, width) <= max(length, width) <= 2.0
            assert np.dot(sides[0], sides[1]) == pytest.approx(0, abs=1e-9)


def test_problems_start_free_with_time_to_stop():
    car = Car("slalom")
    for seed in range(50):
        problem = car.sample_problem(seed)
        assert car.clearance(problem.goal)[0] > 0.05
        assert car.clearance(problem.start[None, :3])[0] > 0.05
        assert 0 <= problem.start[3] <= 2
        assert car.execute(problem.start[None], np.zeros((1, 3)))[1][0]


def test_the_same_seed_gives_the_same_run():
    car, again = Car(random_car_scene(3)), pickle.loads(pickle.dumps(Car(random_car_scene(3))))
    one, other = car.sample_problem(5), again.sample_problem(5)
    commands = random_commands(np.random.default_rng(0), 30)
    np.testing.assert_array_equal(one.start, other.start)
    np.testing.assert_array_equal(one.goal, other.goal)
    np.testing.assert_array_equal(
        car.rollout(one.start, commands).states, again.rollout(other.start, commands).states
    )


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="scene must be one of open_lot, slalom, narrow_gate"):
        Car("lot")
    with pytest.raises(ValueError, match="scene must be"):
        Car(3)
    for radius in (-1, 0, np.nan, np.inf, None, True):
        with pytest.raises(ValueError, match=f"radius must be a positive number, got {radius}"):
            Circle(0, 0, radius)
    star = [(np.cos(a), np.sin(a)) for a in 0.8 * np.pi * np.arange(5)]
    dented = ((0, 0), (1, 0), (0.2, 0.2), (0, 1))
    for corners in (((0, 0), (0, 1), (1, 0)), ((0, 0), (1, 0)), star, dented):
        with pytest.raises(ValueError, match="counter-clockwise"):
            ConvexPolygon(corners)
    with pytest.raises(ValueError, match="bounds"):
        CarScene((), (1, 0, 0, 1))
    with pytest.raises(ValueError, match="obstacles"):
        CarScene(((0, 0, 1),))
    car = Car()
    with pytest.raises(ValueError, match="must not touch anything"):
        car.rollout([2.6, 5.4, 0, 0, 0], np.zeros((1, 3)))
    with pytest.raises(ValueError, match="state"):
        car.rollout([0, 0, 0], np.zeros((1, 3)))
    with pytest.raises(ValueError, match="commands"):
        car.rollout([1, 1, 0, 0, 0], np.zeros((1, 2)))
    for method in (car.propagate, car.steer, car.close, car.distance, car.features):
        with pytest.raises(ValueError, match=r"poses .* of shape \(n, 3\), got the shape \(3,\)"):
            method(np.zeros((1, 3)), np.zeros(3))
    with pytest.raises(ValueError, match="poses"):
        car.clearance([[0, 0]])
    assert car.clearance([[0, 0, 0]]).shape == (1,), "lists of whole numbers will do"
    with pytest.raises(ValueError, match="states must have the shape"):
        car.execute([1, 1, 0, 0, 0], np.zeros((1, 3)))
    with pytest.raises(ValueError, match=r"commands must have the shape \(1, 3\)"):
        car.execute([[1, 1, 0, 0, 0]], np.zeros((2, 3)))


def test_a_trace_passes_through_the_rollout():
    car = Car("open_lot")
    start = car.sample_problem(1).start
    commands = random_commands(np.random.default_rng(2), 15)
    rollout, trace = car.rollout(start, commands), car.trace(start, commands)
    np.testing.assert_array_equal(trace[0], start)
    np.testing.assert_array_equal(trace[-1], rollout.states[-1])
    assert all((trace == state).all(axis=1).any() for state in rollout.states)
