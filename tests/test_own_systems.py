"""The systems in examples/own_systems keep the contract, and their models err where they say."""

import pickle
from itertools import pairwise

import numpy as np
import pytest

from examples.own_systems import suspended_load, tractor_trailer
from systems import StopReason, check_system

SYSTEMS = [tractor_trailer.TractorTrailer, suspended_load.SuspendedLoad]


def went_well(system, start, points):
    """Whether the plan along the points goes well, when the reduced model allows all of it."""
    reduced = [system.reduce(start)]
    for point in points:
        command = system.steer(reduced[-1][None], np.array([point]))
        following, valid = system.propagate(reduced[-1][None], command)
        assert valid.all()
        np.testing.assert_allclose(following[0, : system.configuration_dim], point)
        reduced.append(following[0])
    rollout = system.rollout(start, np.array(points))
    executed = np.array([system.reduce(state) for state in rollout.states])
    return (
        rollout.stop_reason is StopReason.COMPLETED
        and system.close(np.array(reduced), executed).all()
    )


def line(start, end, n):
    return np.linspace(start, end, n + 1)[1:]


@pytest.mark.parametrize("make", SYSTEMS)
def test_they_keep_the_contract(make):
    check_system(make())


@pytest.mark.parametrize("make", SYSTEMS)
def test_pickles_carry_no_simulator_and_executions_repeat_from_any_state(make):
    system = make()
    problem = system.sample_problem(0)
    targets = np.tile(problem.goal, (3, 1))
    reduced = system.reduce(problem.start)[None, : system.configuration_dim]
    commands = reduced + np.arange(1, 4)[:, None] / 10 * (targets - reduced)
    states = np.array(system.rollout(problem.start, commands).states)
    copy = pickle.loads(pickle.dumps(system))
    assert not vars(copy)
    np.testing.assert_array_equal(copy.rollout(states[1], commands[1:]).states, states[1:])


def tractor_at(x, y):
    """Start facing along x, with the trailer straight behind."""
    return np.array([x, y, tractor_trailer.WHEEL_RADIUS, 1, 0, 0, 0, *[0] * 16])


def test_the_tractor_goes_straight_but_its_trailer_blocks_sharp_turns():
    system, start = tractor_trailer.TractorTrailer(), tractor_at(2.0, 0.5)
    assert went_well(system, start, line([2.0, 0.5], [4.0, 0.5], 6))
    assert not went_well(system, start, [[2.4, 0.5], [2.3, 0.88], [2.2, 1.26]])


def test_the_trailer_cuts_a_corner_and_runs_into_the_pillar_that_the_tractor_passed():
    system = tractor_trailer.TractorTrailer()
    straight = line([2.7, 3.26], [3.5, 3.26], 3)
    corner = np.concatenate([straight, [[3.82, 3.46], [4.0, 3.8], [3.97, 4.18]]])
    assert not went_well(system, tractor_at(2.7, 3.26), corner)
    rollout = system.rollout(tractor_at(2.7, 3.26), corner)
    assert rollout.stop_reason is StopReason.CONSTRAINT
    assert tractor_trailer.free_space(rollout.states[-1][:2]) > tractor_trailer.TRACTOR_RADIUS
    assert went_well(system, tractor_at(2.7, 3.2), corner - [0.0, 0.06])


def load_at(x, y, z):
    return np.array([x, y, 0, 0, suspended_load.TROLLEY_HEIGHT - z, 0, 0, 0, 0, 0])


def test_the_load_follows_on_a_short_cable_and_swings_on_a_long_one():
    system = suspended_load.SuspendedLoad()
    high = line([0.6, 3.0, 3.4], [7.2, 3.0, 3.4], 11)
    assert went_well(system, load_at(0.6, 3.0, 3.4), high)
    low = line([0.5, 3.0, 0.5], [2.0, 3.0, 0.5], 3)
    assert not went_well(system, load_at(0.5, 3.0, 0.5), low)


def test_lifting_first_takes_the_load_anywhere():
    system = suspended_load.SuspendedLoad()
    for seed in range(5):
        problem = system.sample_problem(seed)
        start, goal = system.reduce(problem.start), problem.goal[0]
        corners = np.array([start, [*start[:2], 3.4], [*goal[:2], 3.4], goal])
        ways = [line(a, b, 12) for a, b in pairwise(corners)]
        assert went_well(system, problem.start, np.concatenate(ways))


def test_the_load_swings_towards_a_stack_and_stops_before_touching_it():
    system, start = suspended_load.SuspendedLoad(), load_at(3.0, 1.6, 0.5)
    assert not went_well(system, start, [[3.0, 1.9, 0.5], [3.0, 2.15, 0.5]])
    rollout = system.rollout(start, np.array([[3.0, 1.9, 0.5], [3.0, 2.15, 0.5]]))
    assert rollout.stop_reason is StopReason.CONSTRAINT
    ends = np.array([system.reduce(state) for state in rollout.states])
    assert (suspended_load.free_space(ends) > suspended_load.LOAD_RADIUS).all()
