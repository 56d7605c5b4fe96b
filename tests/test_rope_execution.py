"""Γ's own rules, with a physics engine whose rope does as it is told."""

import pickle
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from systems import Box, Cylinder, RopeState, RopeStopReason, Scene, StopReason
from systems.errors import SimulationDivergedError
from systems.rope.obstacles.packing import pack_obstacles
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import GRIPPER_RADIUS
from systems.rope.simulation.engines import ENGINES
from systems.rope.simulation.gripper_contact import share_without_contact
from systems.rope.simulation.quasistatic import RopeRollout, rope_length

LENGTH, LIMIT = 0.6, 0.69
START = np.array([[-0.5, 0.3, 0.0], [-0.5, -0.3, 0.0]])
APART = np.array([[0.0, 0.01, 0.0], [0.0, -0.01, 0.0]])


@dataclass
class ObedientRope:
    """A rope as long as the grippers are apart, or longer by what a test makes it grow."""

    obstacles: object
    n_nodes: int
    spacing: float
    growth_at_rest: float = 0.0
    growth_per_stride: float = 0.0
    extra: float = 0.0
    sunk: float = 0.0
    rises_per_step: float = 0.0
    strides: list = field(default_factory=list)
    steps: list = field(default_factory=list)

    def load(self, state):
        self.grippers = state.grippers.copy()

    def save(self):
        shares = np.linspace(0.0, 1.0, self.n_nodes)[:, None]
        nodes = self.grippers[0] + shares * (self.grippers[1] - self.grippers[0])
        apart = np.linalg.norm(self.grippers[1] - self.grippers[0])
        nodes[self.n_nodes // 2, 2] -= self.extra and 0.5 * np.sqrt(
            (self.extra + 2 * apart / (self.n_nodes - 1)) ** 2
            - (2 * apart / (self.n_nodes - 1)) ** 2
        )
        return RopeState(self.grippers.copy(), nodes)

    def centre_line(self):
        line = self.save().nodes
        line[1:-1, 2] -= max(0.0, self.sunk)
        return line

    def move_grippers(self, grippers):
        self.strides.append(np.linalg.norm(grippers - self.grippers, axis=1).max())
        self.grippers = grippers.copy()
        self.extra += self.growth_per_stride

    def step(self, n_steps):
        self.steps.append(n_steps)
        self.sunk -= n_steps * self.rises_per_step
        if n_steps == 4:
            self.extra += self.growth_at_rest


@pytest.fixture
def rope(monkeypatch):
    """A rollout with an obedient rope, and that rope."""
    scene = Scene([], [[-1.0] * 3, [1.0] * 3], LENGTH, START, START + np.array([1.0, 0.0, 0.0]))
    obedient = ObedientRope(scene.obstacles, scene.n_nodes, scene.link_length)
    monkeypatch.setitem(ENGINES, "mujoco", lambda *arguments: obedient)
    return RopeRollout(scene, "mujoco"), obedient


def state_of(rollout, grippers=START):
    shares = np.linspace(0.0, 1.0, rollout.scene.n_nodes)[:, None]
    return RopeState(grippers, grippers[0] + shares * (grippers[1] - grippers[0]))


def test_grippers_move_in_strides_of_five_millimetres_and_the_rope_gets_time_to_follow(rope):
    rollout, obedient = rope
    command = np.tile([0.012, 0.0, 0.0], 2)
    executed = rollout.execute(state_of(rollout), [command, command])
    assert executed.stop_reason is StopReason.COMPLETED
    np.testing.assert_allclose(obedient.strides, [0.005, 0.005, 0.002] * 2)
    assert obedient.steps == [2, 2, 2, 4] * 2
    np.testing.assert_allclose(executed.states[-1].grippers, START + np.array([0.024, 0.0, 0.0]))


def test_near_the_limit_strides_are_at_most_a_quarter_of_what_is_left_or_a_millimetre(rope):
    rollout, obedient = rope
    executed = rollout.execute(state_of(rollout), [APART.ravel()] * 10)
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    assert executed.n_completed == 4
    length = LENGTH
    for stride in obedient.strides:
        assert stride <= np.clip((LIMIT - length) / 4, 0.001, 0.005) + 1e-9
        length += 2 * stride
    assert len(set(np.round(obedient.strides, 6))) > 4, "some are between the shortest and longest"
    assert LIMIT - 0.003 < rope_length(executed.states[-1]) <= LIMIT


def test_a_rope_that_is_pulled_too_long_is_returned_as_it_last_was_within_the_limit(rope):
    rollout, obedient = rope
    obedient.growth_per_stride = 0.004
    executed = rollout.execute(state_of(rollout), [APART.ravel()] * 10)
    lengths = [rope_length(state) for state in executed.states]
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    assert rope_length(obedient.save()) > LIMIT, "the engine's rope is past the limit"
    assert max(lengths) <= LIMIT
    assert len(executed.states) == executed.n_completed + 2


def test_a_rope_that_grows_too_long_at_rest_is_returned_as_it_was_before(rope):
    rollout, obedient = rope
    obedient.growth_at_rest = 0.02
    still = np.zeros(6)
    executed = rollout.execute(state_of(rollout), [still] * 10)
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    assert executed.n_completed == 4
    assert rope_length(obedient.save()) > LIMIT
    expected = LENGTH + 0.02 * np.array([0, 1, 2, 3, 4, 4])
    np.testing.assert_allclose([rope_length(state) for state in executed.states], expected)


def test_a_rope_of_half_more_than_the_limit_shows_that_the_engine_diverged(rope):
    rollout, obedient = rope
    for growth, error in ((0.34, None), (0.5, SimulationDivergedError)):
        obedient.extra, obedient.growth_at_rest = 0.0, growth
        if error is None:
            executed = rollout.execute(state_of(rollout), np.zeros((1, 6)))
            assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
        else:
            with pytest.raises(error, match=r"made the rope 1\.1 m long, at most 0\.69 m"):
                rollout.execute(state_of(rollout), np.zeros((1, 6)))


@pytest.fixture
def over_floor(monkeypatch):
    """A rollout whose rope is 2 cm above a floor, and that rope."""
    floor = Box((0.0, 0.0, -0.08), (1.0, 1.0, 0.05))
    scene = Scene([floor], [[-1.0] * 3, [1.0] * 3], LENGTH, START, START + np.array([0.9, 0, 0]))
    obedient = ObedientRope(scene.obstacles, scene.n_nodes, scene.link_length)
    monkeypatch.setitem(ENGINES, "mujoco", lambda *arguments: obedient)
    return RopeRollout(scene, "mujoco"), obedient


def test_a_rope_that_is_deep_in_an_obstacle_rests_until_it_is_out(over_floor):
    rollout, obedient = over_floor
    obedient.sunk, obedient.rises_per_step = 0.024, 0.00035
    executed = rollout.execute(state_of(rollout), [np.zeros(6)] * 2)
    assert executed.stop_reason is StopReason.COMPLETED
    # It is 4 mm deep at first, 2.6 after the usual rest, and 0.5 after ten time steps.
    assert obedient.steps == [4, 2, 2, 2, 4]


def test_a_rope_that_stays_deep_in_an_obstacle_shows_that_the_engine_diverged(over_floor):
    rollout, obedient = over_floor
    obedient.sunk = 0.024
    deep = r"surface 4\.0 mm deep in an obstacle, at most 1 mm is allowed"
    with pytest.raises(SimulationDivergedError, match=deep):
        rollout.execute(state_of(rollout), [np.zeros(6)])
    assert sum(obedient.steps) < 1000
    with pytest.raises(SimulationDivergedError, match=deep):
        rollout.settle(state_of(rollout).nodes)


def test_near_the_limit_every_stride_waits_for_the_rope_to_come_out(over_floor):
    rollout, obedient = over_floor
    start = rollout.execute(state_of(rollout), [APART.ravel()] * 10).states[-2]
    obedient.steps.clear()
    obedient.strides.clear()
    obedient.sunk, obedient.rises_per_step = 0.024, 0.0003
    executed = rollout.execute(start, [APART.ravel()])
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    assert LIMIT - 0.003 < rope_length(executed.states[-1]) <= LIMIT
    # At 0.3 mm in a time step, 12 are needed for 3 mm: five more groups of two than one.
    assert len(obedient.steps) == len(obedient.strides) + 5


def test_a_taut_rope_that_stays_deep_in_an_obstacle_is_overstretched(over_floor):
    rollout, obedient = over_floor
    start = rollout.execute(state_of(rollout), [APART.ravel()] * 10).states[-2]
    obedient.sunk = 0.024
    executed = rollout.execute(start, [0.1 * APART.ravel()])
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    np.testing.assert_array_equal(executed.states[-1].nodes, start.nodes)


def test_a_rope_that_is_too_long_needs_not_come_out(over_floor):
    rollout, obedient = over_floor
    obedient.sunk, obedient.growth_at_rest = 0.024, 0.1
    start = state_of(rollout)
    executed = rollout.execute(start, [np.zeros(6)])
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    np.testing.assert_array_equal(executed.states[-1].nodes, start.nodes)
    assert obedient.steps == [4]


def test_a_rope_settles_between_grippers_that_stand_still(rope):
    rollout, obedient = rope
    state = rollout.settle(state_of(rollout).nodes)
    assert sum(obedient.steps) == 800
    assert obedient.strides == []
    np.testing.assert_array_equal(state.grippers, START)


def test_a_command_that_is_shortened_by_a_contact_ends_the_rollout(rope):
    rollout, _ = rope
    post = Box((-0.4, 0.3, 0.0), (0.02, 0.02, 0.5))
    scene = rollout.scene
    blocked = RopeRollout(Scene([post], scene.bounds, LENGTH, scene.start, scene.goal + 0.1))
    forward = np.tile([0.02, 0.0, 0.0], 2)
    executed = blocked.execute(state_of(blocked), [forward] * 5)
    assert executed.stop_reason is RopeStopReason.GRIPPER_CONTACT
    # The gripper's sphere of 23 mm touches the post's side at x = -0.42.
    assert executed.n_completed == 2
    np.testing.assert_allclose(executed.states[-1].grippers[:, 0], -0.443, atol=1e-6)
    assert [len(reason.value.split()) > 5 for reason in RopeStopReason] == [True] * 3


def test_the_grippers_stop_at_the_edge_of_the_world(rope):
    rollout, _ = rope
    start = state_of(rollout)
    executed = rollout.execute(start, [np.tile([-0.2, 0.0, 0.0], 2)] * 5)
    assert executed.stop_reason is RopeStopReason.EDGE_OF_WORLD
    assert executed.n_completed == 2
    np.testing.assert_allclose(executed.states[-1].grippers[:, 0], -1.0, atol=1e-12)
    # From there it may go on: not farther out, but back.
    edge = executed.states[-1]
    stuck = rollout.execute(edge, [np.tile([-1e300, 0.0, 0.0], 2)])
    assert stuck.stop_reason is RopeStopReason.EDGE_OF_WORLD
    np.testing.assert_allclose(stuck.states[-1].grippers, edge.grippers, atol=1e-9)
    back = rollout.execute(edge, [np.tile([0.2, 0.0, 0.0], 2)])
    assert back.stop_reason is StopReason.COMPLETED
    outside = state_of(rollout, START - np.array([0.6, 0.0, 0.0]))
    with pytest.raises(ValueError, match=r"state\.grippers must lie within the bounds"):
        rollout.execute(outside, [np.zeros(6)])


def test_each_thread_has_an_engine_of_its_own(rope, monkeypatch):
    rollout, _ = rope
    started = []

    def start_engine(*arguments):
        started.append(ObedientRope(*arguments))
        return started[-1]

    monkeypatch.setitem(ENGINES, "mujoco", start_engine)
    all_there = threading.Barrier(4)

    def run(forward):
        all_there.wait(timeout=60)
        return rollout.execute(state_of(rollout), [np.tile([forward, 0.0, 0.0], 2)] * 20)

    with ThreadPoolExecutor(4) as pool:
        done = list(pool.map(run, [0.01, 0.02, 0.03, 0.04]))
    assert len(started) == 4
    ends = [one.states[-1].grippers[0, 0] for one in done]
    np.testing.assert_allclose(ends, [-0.3, -0.1, 0.1, 0.3], atol=1e-9)
    assert pickle.loads(pickle.dumps(rollout)).execute(state_of(rollout), np.empty((0, 6)))


coordinate = st.floats(-0.3, 0.3)
position = st.tuples(coordinate, coordinate, coordinate)
small = st.floats(-0.06, 0.06)
displacement = st.tuples(small, small, small)
OBSTACLES = pack_obstacles(
    [Box((0.0, 0.0, 0.0), (0.1, 0.05, 0.15)), Cylinder((0.15, 0.15, 0.0), 0.05, 0.2, axis=0)]
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(position, position, displacement, displacement)
def test_the_share_without_contact_is_where_the_first_contact_is(a, b, move_a, move_b):
    grippers, move = np.array([a, b]), np.array([move_a, move_b])
    if signed_distance(grippers, OBSTACLES).min() < GRIPPER_RADIUS:
        return
    share = share_without_contact(grippers, move, OBSTACLES)
    shares = np.linspace(0.0, 1.0, 2001)
    ways = grippers + shares[:, None, None] * move
    clearance = signed_distance(ways, OBSTACLES).min(axis=1) - GRIPPER_RADIUS
    assert clearance[shares <= share].min() > -1e-5  # places a millimetre apart are looked at
    assert signed_distance(grippers + share * move, OBSTACLES).min() >= GRIPPER_RADIUS
    if share < 1.0:
        assert clearance[shares > share].min() < 1e-7
        assert signed_distance(grippers + share * move, OBSTACLES).min() < GRIPPER_RADIUS + 1e-6
    else:
        assert clearance.min() > -1e-5
