"""The rope as a system: contract, steps, problems, data and bad input."""

import pickle

import joblib
import numpy as np
import pytest
from rope_states import slow_margin

from planners import BiasedRRT
from reliability import collect_transitions
from systems import Box, Rope, RopeState, Scene, check_system
from systems.rope.band.band import band_length, reduced_dim
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import SCENE_NAMES
from systems.rope.scene import GRIPPER_CLEARANCE


@pytest.fixture(scope="module")
def rope():
    return Rope("simple_hook")


@pytest.fixture(scope="module")
def start(rope):
    return rope.reduce(rope.scene_problem().start)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_contract_holds(engine):
    check_system(Rope("engine_assembly", engine))


@pytest.mark.parametrize("name", SCENE_NAMES)
def test_every_scene_can_be_left_from_its_start(name):
    rope = Rope(name)
    problem = rope.scene_problem()
    reduced = rope.reduce(problem.start)[None]
    np.testing.assert_allclose(problem.start.grippers, rope.scene.start, atol=1e-9)
    following, valid = rope.propagate(reduced, rope.steer(reduced, problem.goal))
    assert valid[0]
    assert following.shape == (1, rope.reduced_dim)
    assert rope.goal_reached(reduced, problem.goal).tolist() == [False]


def test_commands_are_steps_in_r6(rope, start, rng):
    rows = np.tile(start, (50, 1))
    targets = rope.sample_configurations(rng, 50)
    command = rope.steer(rows, targets)
    np.testing.assert_allclose(np.linalg.norm(command, axis=1), 0.025)
    way = targets - rows[:, :6]
    np.testing.assert_allclose(command / 0.025, way / np.linalg.norm(way, axis=1)[:, None])
    near = rows[:, :6] + 1e-3
    np.testing.assert_allclose(rope.steer(rows, near), 1e-3)


def test_valid_successors_keep_every_limit(rope, start, rng):
    rows, scene = np.tile(start, (30, 1)), rope.scene
    targets = rope.sample_configurations(rng, 30)
    n_invalid = 0
    for _ in range(40):
        command = rope.steer(rows, targets)
        following, valid = rope.propagate(rows, command)
        np.testing.assert_allclose(following[valid, :6], (rows[:, :6] + command)[valid])
        np.testing.assert_array_equal(following[~valid], rows[~valid])
        assert (band_length(following) <= scene.max_band_length).all()
        for row in following:
            assert slow_margin(scene, row[:6].reshape(2, 3)) >= GRIPPER_CLEARANCE - 1e-6
        for before, moved in zip(rows[~valid], command[~valid], strict=True):
            grippers = (before[:6] + moved).reshape(2, 3)
            overstretched = np.linalg.norm(grippers[0] - grippers[1]) > scene.max_band_length
            n_invalid += overstretched or slow_margin(scene, grippers) < GRIPPER_CLEARANCE
        rows = following
    assert n_invalid > 20


def test_grippers_that_are_too_near_may_only_leave():
    rope = Rope("engine_assembly")
    start = rope.reduce(rope.scene_problem().start)[None]
    assert slow_margin(rope.scene, start[0, :6].reshape(2, 3)) < GRIPPER_CLEARANCE
    inwards = np.array([[0.005, 0, 0, 0, 0, 0]])
    assert rope.propagate(start, inwards)[1][0]
    assert rope.propagate(start, 0 * inwards)[1][0]
    assert not rope.propagate(start, -inwards)[1][0]


def test_configurations_are_sampled_where_they_make_sense(rope, rng):
    samples = rope.sample_configurations(rng, 300)
    assert samples.shape == (300, 6)
    apart = np.linalg.norm(samples[:, :3] - samples[:, 3:], axis=1)
    assert apart.max() <= rope.scene.max_band_length
    assert min(slow_margin(rope.scene, row.reshape(2, 3)) for row in samples) >= GRIPPER_CLEARANCE
    first = samples[:, :3]
    assert (first.min(axis=0) < rope.scene.bounds[0] + 0.1).all()
    assert (first.max(axis=0) > rope.scene.bounds[1] - 0.1).all()


def test_problems_start_at_rest_and_cover_the_world(rope):
    problems = [rope.sample_problem(seed) for seed in range(24)]
    again = rope.sample_problem(5)
    np.testing.assert_array_equal(again.start.nodes, problems[5].start.nodes)
    starts = np.array([problem.start.grippers.ravel() for problem in problems])
    assert starts[:, 0].min() < -0.9
    assert starts[:, 0].max() > -0.5
    assert (starts[:, 1] > 0.01).all(), "gripper A starts on its own side"
    assert (starts[:, 4] < 0.01).all(), "gripper B starts on its own side"
    way = np.linalg.norm(starts - rope.scene.goal.ravel(), axis=1)
    assert (way > 0.75 * np.linalg.norm(rope.scene.start - rope.scene.goal)).all()
    for problem in problems[:6]:
        np.testing.assert_array_equal(problem.goal, rope.scene.goal.reshape(1, 6))
        assert signed_distance(problem.start.nodes, rope.scene.packed).min() > 0.005
        rest = rope.rollout(problem.start, np.zeros((10, 6))).states[-1]
        assert rope.close(rope.reduce(problem.start)[None], rope.reduce(rest)[None])[0]


def test_goals_are_two_and_a_half_centimetres_wide(rope):
    problem = rope.scene_problem()
    reduced = np.zeros((3, rope.reduced_dim))
    reduced[:, :6] = problem.goal
    reduced[1, 0] += 0.0249
    reduced[2, [0, 4]] += 0.0249
    assert rope.goal_reached(reduced, problem.goal).tolist() == [True, True, False]
    arrived = RopeState(problem.goal.reshape(2, 3), problem.start.nodes)
    assert rope.succeeded(arrived, problem.goal, 0.0)
    assert not rope.succeeded(problem.start, problem.goal, 1.0)


def test_thirteen_features_see_a_hook_between_rope_and_grippers():
    beam = Box((0.0, 0.0, 0.03), (1.0, 0.02, 0.01), "beam")
    bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    start = np.array([[0.0, -0.2, 0.1], [0.0, 0.2, 0.1]])
    grippers = {"bounds": bounds, "rope_length": 0.5, "start": start, "goal": start + 0.2}
    high = Scene([Box((0.0, 0.0, 0.8), (0.1, 0.1, 0.1))], **grippers)
    rows = []
    for scene in (high, Scene([beam], **grippers | {"rope_length": 0.41})):
        rope = Rope(scene, features="vector")
        row = np.zeros((1, rope.reduced_dim))
        row[0, :12] = np.tile(start.ravel(), 2)
        row[0, 12:] = np.tile(start[1], (rope.reduced_dim - 12) // 3)
        after = row.copy()
        after[0, [4, 7, 10]] += 0.01
        rows.append(rope.features(row, after)[0])
    for features, rope_length, parts in zip(rows, (0.5, 0.41), (1, 2), strict=True):
        limit = 1.15 * rope_length
        np.testing.assert_allclose(features[[0, 2]], 0.4 / limit)
        np.testing.assert_allclose(features[1], 0.41 / limit)
        assert features[10] == parts, "occupied: the surroundings, and what hangs between"
        assert features[4] == features[7] + features[10]
        np.testing.assert_array_equal(features[6:13:3], features[5:12:3] - features[4:11:3])


def test_rope_plans_around_its_wall_and_carries_the_band(rope, start):
    planner = BiasedRRT(rope, random_state=0)
    result = planner.plan(start, rope.scene.goal.ravel())
    assert result.success
    assert rope.goal_reached(result.reduced[-1:], rope.scene.goal.reshape(1, 6))[0]
    following, valid = rope.propagate(result.reduced[:-1], result.commands)
    assert valid.all()
    np.testing.assert_array_equal(following, result.reduced[1:])
    again = planner.plan(start, rope.scene.goal.ravel())
    np.testing.assert_array_equal(again.reduced, result.reduced)
    assert result.tree.shape[1:] == (2, 6)


def test_collected_data_are_compact_and_resume(rope, tmp_path):
    arguments = {"random_state": 1, "path": tmp_path / "data"}
    planner = BiasedRRT(rope)
    data = collect_transitions(rope, planner, 3, **arguments)
    again = collect_transitions(Rope("simple_hook"), BiasedRRT(Rope()), 3, **arguments)
    np.testing.assert_array_equal(again.next_reduced, data.next_reduced)
    assert data.nbytes < 600 * len(data)
    size = sum(file.stat().st_size for file in (tmp_path / "data").glob("*.item"))
    assert 0 < size < 600 * len(data) + 3 * 4000
    rows = data.features(rope)
    assert rows.shape == (len(data), 12288)
    assert rows.dtype == np.uint8
    assert data.features(Rope(features="vector")).shape == (len(data), 13)


WIDTHS = {"voxels": 12288, "clearance": 496, "vector": 13}


@pytest.mark.parametrize("features", WIDTHS)
def test_no_rows_give_no_rows(features):
    rope, width = Rope(features=features), WIDTHS[features]
    none = np.empty((0, rope.reduced_dim))
    following, valid = rope.propagate(none, np.empty((0, 6)))
    assert (following.shape, valid.shape) == (none.shape, (0,))
    assert rope.features(none, none).shape == (0, width)
    assert rope.close(none, none).shape == (0,)
    assert rope.steer(none, np.empty((0, 6))).shape == (0, 6)
    assert rope.goal_reached(none, np.zeros((1, 6))).shape == (0,)


def test_ropes_pickle_and_hash_alike_before_and_after_use(rope):
    fresh = Rope("simple_hook")
    before = joblib.hash(fresh)
    fresh.rollout(fresh.scene_problem().start, np.zeros((1, 6)))
    assert joblib.hash(fresh) == before
    copy = pickle.loads(pickle.dumps(fresh))
    assert copy.reduced_dim == reduced_dim(rope.scene)
    assert joblib.hash(copy) == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scene": "no_hook"}, "scene must be one of simple_hook_short"),
        ({"scene": 3}, "scene must be a Scene or the name of one, got 3"),
        ({"engine": "bullet"}, "engine must be one of mujoco, pybullet, got 'bullet'"),
        ({"features": "pixels"}, "features must be one of voxels, clearance, vector, got 'pixels'"),
    ],
)
def test_unknown_scenes_and_engines_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Rope(**arguments)


def test_bad_rows_states_and_goals_are_refused(rope, start):
    rows, moves = start[None], np.zeros((1, 6))
    broken = rows.copy()
    broken[0, 20] = np.nan
    for call, message in (
        (lambda: rope.propagate(broken, moves), "reduced must be finite"),
        (lambda: rope.propagate(rows, moves + np.inf), "command must be finite"),
        (lambda: rope.propagate(rows[:, :-1], moves), "reduced must have the shape"),
        (lambda: rope.steer(rows, moves[:, :3]), "configuration must have the shape"),
        (lambda: rope.steer(rows, np.zeros((2, 6))), "configuration must have as many rows"),
        (lambda: rope.features(broken, rows), "reduced must be finite"),
        (lambda: rope.close(rows, np.hstack([rows, rows])), "executed must have the shape"),
        (lambda: rope.close(rows, np.vstack([rows, rows])), "executed must have as many rows"),
        (lambda: rope.close(rows[0], rows), "predicted must have the shape"),
        (lambda: rope.close(rows, broken), "executed must be finite"),
        (lambda: rope.bands(broken), "reduced must be finite"),
        (lambda: rope.reduce(start), "state must be a RopeState"),
        (lambda: rope.rollout(start, moves), "state must be a RopeState"),
        (lambda: rope.succeeded(None, moves, 1.0), "state must be a RopeState"),
        (lambda: BiasedRRT(rope).plan(start, np.full(6, 9.0)), "goal must lie within the bounds"),
        (lambda: BiasedRRT(rope).plan(broken[0], np.zeros(6)), "start_reduced must be finite"),
    ):
        with pytest.raises(ValueError, match=message):
            call()


def test_a_small_world_has_problems_too():
    bounds = np.array([[-0.2, -0.2, 0.0], [0.2, 0.2, 0.6]])
    start = np.array([[-0.1, 0.0, 0.5], [0.1, 0.0, 0.5]])
    floor = Box((0.0, 0.0, 0.0), (0.2, 0.2, 0.05), "floor")
    scene = Scene([floor], bounds, 0.3, start, start + np.array([0.0, 0.1, 0.0]))
    rope = Rope(scene)
    assert np.isfinite(rope.reduce(rope.sample_problem(0).start)).all()
