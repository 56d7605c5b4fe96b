"""How the true car drives: its limits, its controller and where its commands end."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from systems import Car, CarScene, Circle, random_car_scene

TIME_STEP = 0.01
WHEELBASE = 0.3
ROUNDING = 1e-9
seeds = st.integers(0, 2**32 - 1)
OPEN = Car(CarScene((), (-50.0, -50.0, 50.0, 50.0)))
X, Y, HEADING, SPEED, STEERING = range(5)


def drive(state, command):
    """The states of one command every 0.01 s, without the last, shorter step."""
    return OPEN.trace(state, [command])[:-1]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seeds)
def test_the_car_keeps_its_limits(seed):
    rng = np.random.default_rng(seed)
    start = [0, 0, rng.uniform(-3, 3), rng.uniform(-2, 2), rng.uniform(-0.55, 0.55)]
    before, after = (lambda states: (states[:-1], states[1:]))(drive(start, rng.normal(size=3)))
    speed, change = before[:, SPEED], after - before
    assert (np.abs(change[:, SPEED]) <= 2.0 * TIME_STEP + ROUNDING).all()
    assert (np.abs(change[:, STEERING]) <= 6.0 * TIME_STEP + ROUNDING).all()
    assert (np.abs(after[:, STEERING]) <= 0.55 + ROUNDING).all()
    way = 0.5 * (before[:, SPEED] + after[:, SPEED]) * TIME_STEP
    turned = (change[:, HEADING] + np.pi) % (2 * np.pi) - np.pi
    grip = 2.0 / np.maximum(speed**2, 1e-6)
    tightest = np.minimum(np.tan(0.55) / WHEELBASE, grip)
    assert (np.abs(turned) <= np.abs(way) * tightest + ROUNDING).all()
    middle = before[:, HEADING] + 0.5 * turned
    np.testing.assert_allclose(change[:, X], way * np.cos(middle), atol=ROUNDING)
    np.testing.assert_allclose(change[:, Y], way * np.sin(middle), atol=ROUNDING)
    within_grip = np.abs(np.tan(after[:, STEERING]) / WHEELBASE) <= tightest
    turn_of_wheels = way * np.tan(after[:, STEERING]) / WHEELBASE
    np.testing.assert_allclose(turned[within_grip], turn_of_wheels[within_grip], atol=ROUNDING)


@pytest.mark.parametrize("direction", [1, -1])
def test_it_cruises_and_slows_down_before_the_target(direction):
    speeds = direction * drive(np.zeros(5), [direction * 3.0, 0, 0])[:, SPEED]
    assert speeds.max() == pytest.approx(1.2)
    assert speeds[-1] == pytest.approx(0.3, abs=0.1)
    assert (np.diff(speeds[speeds.argmax() :]) <= ROUNDING).all()


def test_a_fast_car_is_still_fast_at_a_near_target():
    end = OPEN.execute([[0, 0, 0, 2.0, 0]], [[0.3, 0, 0]])[0][0]
    assert end[SPEED] == pytest.approx(np.sqrt(2.0**2 - 2 * 2.0 * 0.3), abs=0.02)


@pytest.mark.parametrize("speed", [0.2, 1.0, 2.0])
@pytest.mark.parametrize("command", [(0.5, 0.1, 0.3), (-0.4, 0.0, -0.2), (0.3, -0.3, -1.0)])
def test_a_command_ends_where_the_car_passes_the_target(command, speed):
    direction = np.sign(command[0])
    end = OPEN.execute([[0, 0, 0, direction * speed, 0]], [command])[0][0]
    along = np.dot(end[:2], command[:2]) / np.linalg.norm(command[:2])
    assert along == pytest.approx(np.linalg.norm(command[:2]), abs=1e-3)


def test_a_command_lasts_four_seconds_at_most():
    trace = OPEN.trace(np.zeros(5), [[20.0, 0, 0]])
    assert len(trace) == 1 + 400
    assert OPEN.execute([np.zeros(5)], [[20.0, 0, 0]])[1][0]


@pytest.mark.parametrize(
    ("command", "forwards"),
    [
        ((0.5, 0, 0), True),
        ((-0.5, 0, 0), False),
        ((0.1, 0.5, 0.0), True),
        ((-0.1, 0.5, 1.0), True),  # ahead of where the heading is halfway through the turn
        ((0.1, 0.5, -1.0), False),
    ],
)
def test_the_displacement_says_forwards_or_backwards(command, forwards):
    assert (drive(np.zeros(5), command)[5, SPEED] > 0) == forwards


def test_a_car_that_goes_the_wrong_way_first_stops_with_its_wheels_straight():
    states = drive([0, 0, 0, -1.0, 0.4], [0.5, 0.3, 0.5])
    backwards = states[states[:, SPEED] < 0]
    np.testing.assert_allclose(np.diff(backwards[:, SPEED]), 2.0 * TIME_STEP)
    assert abs(backwards[-1, STEERING]) < ROUNDING


def test_braking_takes_the_shortest_way_and_keeps_the_wheels_straight():
    end, completed = OPEN.execute([[0, 0, 0, 1.5, 0.3]], [[0, 0, 1.0]])
    assert completed[0]
    assert end[0, SPEED] == 0
    assert end[0, STEERING] == pytest.approx(0)


@pytest.mark.parametrize("speed", [0.5, 1.2, 2.0])
def test_it_stops_a_millimetre_before_what_it_hits(speed):
    car = Car(CarScene((Circle(1.5, 0.0, 0.4),), (-3.0, -3.0, 3.0, 3.0)))
    end, completed = car.execute([[0, 0, 0, speed, 0]], [[1.0, 0, 0]])
    assert not completed[0]
    assert end[0, X] == pytest.approx(1.5 - 0.4 - 0.3 - 0.15 - 1e-3, abs=1e-6)
    assert end[0, SPEED] > 0.3


def test_turning_wheels_can_be_seen_in_the_heading():
    """A left turn forwards raises the heading, and lowers it in reverse."""
    left = OPEN.execute([[0, 0, 0, 0.5, 0]], [[0.5, 0.1, 0.4]])[0][0]
    assert left[HEADING] == pytest.approx(0.4, abs=0.1)
    assert left[STEERING] > 0
    right = OPEN.execute([[0, 0, 0, -0.5, 0]], [[-0.5, 0.1, -0.4]])[0][0]
    assert right[HEADING] == pytest.approx(-0.4, abs=0.1)


def plain_wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def plain_step(state, speed, curvature, duration):
    """One short time of the true car, from its limits."""
    x, y, heading, v, steering = state
    limit = min(np.tan(0.55) / WHEELBASE, 2.0 / max(v**2, 1e-6))
    wanted = np.arctan(WHEELBASE * np.clip(curvature, -limit, limit))
    steering += np.clip(wanted - steering, -6.0 * duration, 6.0 * duration)
    faster = np.clip(speed - v, -2.0 * duration, 2.0 * duration)
    way = (v + faster / 2) * duration
    turn = way * np.clip(np.tan(steering) / WHEELBASE, -limit, limit)
    along = heading + turn / 2
    moved = [x + way * np.cos(along), y + way * np.sin(along)]
    return np.array([*moved, plain_wrap(heading + turn), v + faster, steering])


def plain_controls(state, target, forwards):
    """The arc to the target in the wanted heading, as if the car had turned round in reverse."""
    x, y, heading, v, _ = state
    sign = 1 if forwards else -1
    if v * sign < 0:
        return sign * 1.2, 0.0
    travel, arrival = (heading, target[2]) if forwards else (heading + np.pi, target[2] + np.pi)
    away = target[:2] - [x, y]
    bearing, distance = np.arctan2(away[1], away[0]), np.linalg.norm(away)
    bend = np.clip(plain_wrap(arrival - bearing), -1.2, 1.2)
    error = plain_wrap(bearing - bend - travel)
    curvature = (2 * np.sin(bend) + 2.5 * error) / max(0.25, distance)
    tight = np.clip(abs(curvature), 1e-6, np.tan(0.55) / WHEELBASE)
    speed = min(1.2, np.sqrt(0.3**2 + 2 * 2.0 * distance), np.sqrt(2.0 / tight))
    return sign * speed, sign * curvature


def plain_execution(car, start, command):
    """Γ with the clearance looked at after every step; returns the last state and if it arrived."""
    target, state = start[:3] + command, start
    braking = np.linalg.norm(command[:2]) < 1e-3
    middle = start[2] + command[2] / 2
    forwards = command[0] * np.cos(middle) + command[1] * np.sin(middle) >= 0
    for _ in range(400):
        if braking and state[SPEED] == 0:
            break
        controls = (0.0, 0.0) if braking else plain_controls(state, target, forwards)
        moved, duration = plain_step(state, *controls, TIME_STEP), TIME_STEP
        before, left = (np.dot(command[:2], target[:2] - s[:2]) for s in (state, moved))
        arrives = not braking and left <= 0
        if arrives:
            duration *= before / (before - left)
            moved = plain_step(state, *controls, duration)
        if car.clearance(moved[None, :3])[0] < 1e-3:
            return last_free(car, state, controls, duration), False
        state = moved
        if arrives:
            break
    return state, True


def last_free(car, state, controls, duration):
    low, high = 0.0, duration
    for _ in range(40):
        half = (low + high) / 2
        moved = plain_step(state, *controls, half)
        low, high = (half, high) if car.clearance(moved[None, :3])[0] >= 1e-3 else (low, half)
    return plain_step(state, *controls, low)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seeds)
def test_execution_agrees_with_a_plain_one(seed):
    rng = np.random.default_rng(seed)
    car = Car(random_car_scene(rng))
    poses = rng.uniform(*car.bounds, size=(60, 3))
    poses = poses[car.clearance(poses) > 1e-3][:4]
    starts = np.column_stack([poses, rng.uniform(-2, 2, 4), rng.uniform(-0.55, 0.55, 4)])
    commands = rng.normal(size=(4, 3)) * [[0.0], [0.2], [0.5], [1.0]]
    ends, completed = car.execute(starts, commands)
    for start, command, end, done in zip(starts, commands, ends, completed, strict=True):
        expected, arrived = plain_execution(car, start, command)
        assert done == arrived
        np.testing.assert_allclose(end, expected, atol=1e-6)
