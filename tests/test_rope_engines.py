import gc
import pickle
import subprocess
import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rope_paths import PATHS, path_commands

from systems import Rope
from systems.errors import SimulationDivergedError
from systems.rope.catenary import hanging_rope
from systems.rope.obstacles.shapes import Box, Capsule, Cylinder
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import SCENE_NAMES, load_scene
from systems.rope.scene import GRIPPER_RADIUS, ROPE_RADIUS, Scene
from systems.rope.simulation.engines import ENGINES
from systems.rope.simulation.quasistatic import RopeRollout, rope_length
from systems.rope.simulation.state import RopeState
from systems.rope.simulation.stop_reason import RopeStopReason
from systems.system import StopReason

RESTART_TOLERANCE = {"mujoco": 0.0, "pybullet": 1e-3}
STOP_REASONS = {"caught": RopeStopReason.OVERSTRETCHED, "free": StopReason.COMPLETED}
SCENES = [
    pytest.param(name, marks=[] if name == "simple_hook" else pytest.mark.slow)
    for name in SCENE_NAMES
]
every_engine = pytest.mark.parametrize("engine", ENGINES)
every_kind = pytest.mark.parametrize("kind", STOP_REASONS)


@cache
def rollout_of(scene, engine):
    return RopeRollout(load_scene(scene), engine)


def settled(rollout, grippers):
    scene = rollout.scene
    return rollout.settle(hanging_rope(grippers, scene.rope_length, scene.n_nodes))


@cache
def executed(scene, engine, kind):
    waypoints = PATHS[scene][kind]
    rollout = rollout_of(scene, engine)
    commands = path_commands(waypoints)
    return commands, rollout.execute(settled(rollout, waypoints[0]), commands)


def clearance(scene, points):
    return float(signed_distance(points, scene.packed).min())


def assert_same(states, others, tolerance=0.0):
    for state, other in zip(states, others, strict=True):
        np.testing.assert_allclose(state.grippers, other.grippers, rtol=0, atol=1e-12)
        np.testing.assert_allclose(state.nodes, other.nodes, rtol=0, atol=tolerance)


def with_all_speeds(rollout, state, speed):
    """Give every free node the same absurd speed, whatever engine the state is of."""
    simulation = state.simulation.copy()
    if rollout.engine == "pybullet":
        simulation[:, 4:7] = speed
    else:
        n_coordinates = 3 * (rollout.scene.n_nodes - 2)
        simulation[1 + n_coordinates : 1 + 2 * n_coordinates] = speed
    return replace(state, simulation=simulation)


@pytest.mark.parametrize("scene", SCENES)
@every_engine
@every_kind
def test_only_a_caught_rope_is_stopped_and_only_by_stretch(scene, engine, kind):
    commands, rollout = executed(scene, engine, kind)
    assert rollout.stop_reason is STOP_REASONS[kind]
    stopped = rollout.stop_reason is not StopReason.COMPLETED
    assert len(rollout.states) == rollout.n_completed + 1 + stopped
    reached = rollout.states[rollout.n_completed].grippers.ravel()
    start = np.ravel(PATHS[scene][kind][0])
    np.testing.assert_allclose(reached, start + commands[: rollout.n_completed].sum(0), atol=1e-9)


@pytest.mark.parametrize("scene", SCENES)
@every_engine
@every_kind
def test_no_state_is_past_the_boundary(scene, engine, kind):
    states, limit = executed(scene, engine, kind)[1].states, load_scene(scene).max_band_length
    assert max(map(rope_length, states)) <= limit
    for state in states:
        assert clearance(load_scene(scene), state.grippers) >= GRIPPER_RADIUS
        assert clearance(load_scene(scene), state.nodes) > 0.5 * ROPE_RADIUS
    if kind == "caught":
        assert rope_length(states[-1]) > 0.99 * limit


@pytest.mark.parametrize("scene", SCENES)
def test_engines_catch_the_rope_at_the_same_place(scene):
    ends = [executed(scene, engine, "caught")[1].states[-1] for engine in ENGINES]
    np.testing.assert_allclose(ends[0].grippers, ends[1].grippers, atol=0.03)


@pytest.mark.parametrize("scene", SCENES)
@every_kind
def test_engines_move_the_rope_alike(scene, kind):
    one, other = (executed(scene, engine, kind)[1].states for engine in ENGINES)
    n_both = min(len(one), len(other)) - 1
    apart = [
        np.linalg.norm(a.nodes - b.nodes, axis=1).mean()
        for a, b in zip(one[:n_both], other[:n_both], strict=True)
    ]
    assert np.mean(apart) < 0.03


@every_engine
def test_settled_rope_hangs_as_a_catenary(engine):
    rollout = rollout_of("simple_hook", engine)
    grippers = np.array([[-0.9, 0.2, 0.3], [-0.9, -0.2, 0.3]])
    laid = hanging_rope(grippers, rollout.scene.rope_length, rollout.scene.n_nodes)
    state = rollout.settle(laid)
    np.testing.assert_allclose(state.nodes, laid, atol=0.03)
    np.testing.assert_allclose(state.nodes[[0, -1]], grippers, atol=0.005)


def crossing_scene(obstacle):
    return Scene(
        obstacles=[obstacle],
        bounds=np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]),
        rope_length=0.6,
        start=np.array([[-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0]]),
        goal=np.array([[0.5, 0.2, 0.0], [0.5, -0.2, 0.0]]),
    )


FORWARD, DOWN = (0.0177, 0.0, 0.0), (0.0, 0.0, -0.0177)


@every_engine
@pytest.mark.parametrize(
    ("obstacle", "direction"),
    [
        (Box((0.0, 0.0, 0.0), (0.025, 0.025, 0.5)), FORWARD),
        (Cylinder((0.0, 0.0, 0.0), 0.025, 0.5, axis=2), FORWARD),
        (Capsule((0.0, 0.0, -0.5), (0.0, 0.0, 0.5), 0.025), FORWARD),
        (Capsule((0.1, 0.0, -0.5), (-0.1, 0.0, 0.5), 0.025), FORWARD),
        (Cylinder((-0.3, 0.0, -0.35), 0.025, 0.2, axis=0), DOWN),
    ],
    ids=["box", "cylinder", "capsule", "slanted capsule", "cylinder from above"],
)
def test_rope_does_not_tunnel_through_five_centimetres(engine, obstacle, direction):
    scene = crossing_scene(obstacle)
    rollout = RopeRollout(scene, engine)
    commands = np.tile(direction, (60, 2))
    executed = rollout.execute(rollout.settle(scene.start_rope()), commands)
    assert executed.stop_reason is RopeStopReason.OVERSTRETCHED
    for state in executed.states:
        middles = 0.5 * (state.nodes[1:] + state.nodes[:-1])
        assert clearance(scene, state.nodes) > 0.5 * ROPE_RADIUS
        assert clearance(scene, middles) > 0.25 * ROPE_RADIUS


@every_engine
def test_gripper_stops_on_the_boundary_of_an_obstacle(engine):
    rollout = rollout_of("simple_hook", engine)
    start = settled(rollout, [(0.2, 0.3, 0.2), (0.2, 0.0, 0.2)])
    forward = np.tile([0.02, 0.0, 0.0], 2)
    stopped = rollout.execute(start, np.tile(forward, (20, 1)))
    assert stopped.stop_reason is RopeStopReason.GRIPPER_CONTACT
    last = stopped.states[-1]
    assert 0.0 <= clearance(rollout.scene, last.grippers) - GRIPPER_RADIUS < 1e-6
    again = rollout.execute(last, forward[None])
    assert again.stop_reason is RopeStopReason.GRIPPER_CONTACT
    np.testing.assert_allclose(again.states[-1].grippers, last.grippers, atol=1e-6)
    back = rollout.execute(last, -forward[None])
    assert back.stop_reason is StopReason.COMPLETED


def test_stretched_rope_may_go_back():
    rollout = rollout_of("simple_hook", "mujoco")
    caught = executed("simple_hook", "mujoco", "caught")[1].states[-1]
    forward = np.tile([0.02, 0.0, 0.0], 2)
    assert rollout.execute(caught, forward[None]).stop_reason is RopeStopReason.OVERSTRETCHED
    assert rollout.execute(caught, -forward[None]).stop_reason is StopReason.COMPLETED


@every_engine
def test_grippers_stop_at_the_bounds_of_the_scene(engine):
    rope = Rope("simple_hook_short", engine)
    start = rope.scene_problem().start
    up = rope.rollout(start, [[0.0, 0.0, 2.0] * 2])
    assert up.stop_reason is RopeStopReason.EDGE_OF_WORLD
    assert up.n_completed == 0
    np.testing.assert_allclose(up.states[-1].grippers[:, 2], rope.scene.bounds[1, 2], atol=1e-9)
    assert (up.states[-1].grippers <= rope.scene.bounds[1]).all()


@settings(max_examples=25, deadline=None, derandomize=True)
@given(arrays(float, (8, 6), elements=st.floats(-0.1, 0.1)))
def test_no_motion_leads_past_a_boundary(commands):
    rollout = rollout_of("simple_hook", "mujoco")
    start = executed("simple_hook", "mujoco", "caught")[1].states[90]
    done = rollout.execute(start, commands)
    for state in done.states:
        assert clearance(rollout.scene, state.grippers) >= GRIPPER_RADIUS
        assert rope_length(state) <= rollout.scene.max_band_length
    np.testing.assert_allclose(
        done.states[done.n_completed].grippers.ravel(),
        start.grippers.ravel() + commands[: done.n_completed].sum(0),
        atol=1e-12,
    )


@every_engine
@every_kind
def test_same_call_gives_the_same_result(engine, kind):
    commands, first = executed("simple_hook", engine, kind)
    for rollout in (
        rollout_of("simple_hook", engine),
        RopeRollout(load_scene("simple_hook"), engine),
    ):
        again = rollout.execute(first.states[0], commands)
        assert again.stop_reason is first.stop_reason
        assert_same(again.states, first.states)


@every_engine
@every_kind
@pytest.mark.parametrize("middle", [30, 100])
def test_restart_from_a_state_in_between(engine, kind, middle):
    commands, whole = executed("simple_hook", engine, kind)
    rest = rollout_of("simple_hook", engine).execute(whole.states[middle], commands[middle:])
    assert rest.stop_reason is whole.stop_reason
    assert_same(rest.states[:40], whole.states[middle:][:40], RESTART_TOLERANCE[engine])


@every_engine
def test_states_and_rollouts_pickle(engine):
    commands, whole = executed("simple_hook", engine, "free")
    state = pickle.loads(pickle.dumps(whole.states[50]))
    copy = pickle.loads(pickle.dumps(rollout_of("simple_hook", engine)))
    assert_same(
        copy.execute(state, commands[50:60]).states,
        rollout_of("simple_hook", engine).execute(whole.states[50], commands[50:60]).states,
    )


@every_engine
def test_no_commands_leave_the_state_as_it_is(engine):
    state = executed("simple_hook", engine, "free")[1].states[0]
    done = rollout_of("simple_hook", engine).execute(state, np.empty((0, 6)))
    assert done.states == [state]
    assert (done.n_completed, done.stop_reason) == (0, StopReason.COMPLETED)


@every_engine
@pytest.mark.parametrize("speed", [1e3, 1e12])
def test_divergence_is_an_error_of_its_own(engine, speed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo by itself writes a log of its warnings there
    rollout = rollout_of("simple_hook", engine)
    commands, whole = executed("simple_hook", engine, "free")
    with pytest.raises(SimulationDivergedError):
        rollout.execute(with_all_speeds(rollout, whole.states[0], speed), commands)
    assert_same(rollout.execute(whole.states[0], commands[:5]).states, whole.states[:6])
    assert not list(tmp_path.iterdir())


@every_engine
def test_state_of_another_engine_is_refused_but_its_nodes_are_not(engine):
    other = next(name for name in ENGINES if name != engine)
    state = executed("simple_hook", other, "free")[1].states[40]
    rollout = rollout_of("simple_hook", engine)
    still = np.zeros((1, 6))
    with pytest.raises(ValueError, match="simulation=None"):
        rollout.execute(state, still)
    done = rollout.execute(replace(state, simulation=None), still)
    assert done.stop_reason is StopReason.COMPLETED


def test_bad_input_is_refused_at_the_door():
    rollout = rollout_of("simple_hook", "mujoco")
    state = executed("simple_hook", "mujoco", "free")[1].states[0]
    still = np.zeros((1, 6))
    with pytest.raises(ValueError, match="engine must be one of mujoco, pybullet"):
        RopeRollout(rollout.scene, "bullet")
    with pytest.raises(ValueError, match="commands must have the shape"):
        rollout.execute(state, np.zeros(6))
    with pytest.raises(ValueError, match="commands must be finite"):
        rollout.execute(state, still * np.nan)
    with pytest.raises(ValueError, match="nodes must have the shape"):
        rollout.settle(state.nodes[:-1])
    with pytest.raises(ValueError, match=r"state\.nodes must be finite"):
        rollout.execute(replace(state, nodes=state.nodes * np.nan), still)
    with pytest.raises(ValueError, match=r"state\.simulation must be finite"):
        rollout.execute(replace(state, simulation=state.simulation * np.nan), still)
    into_hook = np.array([-0.16, 0.0, -0.05]) - state.grippers[0]
    with pytest.raises(ValueError, match="away from the obstacles"):
        rollout.execute(RopeState(state.grippers + into_hook, state.nodes + into_hook), still)
    zigzag = state.nodes.copy()
    zigzag[1:-1:2, 0] += 0.02
    with pytest.raises(ValueError, match=r"a rope of at most 0\.874 m"):
        rollout.execute(RopeState(state.grippers, zigzag), still)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (lambda a, n: (a, n[::-1]), r"run from B to A: give state\.nodes\[::-1\]"),
        (lambda a, n: (1000 * a, 1000 * n), "evenly spaced along a rope of 0.76 m"),
        (lambda a, n: (a, n[::2]), r"state\.nodes must have the shape \(39, 3\), got \(20, 3\)"),
        (lambda a, n: (a + np.array([0.0, 0.0, 0.05]), n), "a first node 0.05 m from A"),
        (lambda a, n: (a, np.repeat(n[::2], 2, axis=0)[:-1]), "evenly spaced"),
        (lambda a, n: (a, "rope"), r"state\.nodes must be an array of numbers"),
    ],
)
def test_nodes_that_cannot_be_this_rope_are_refused(record, words):
    rope = Rope("simple_hook")
    start = rollout_of("simple_hook", "mujoco").settle(rope.scene.start_rope())
    state = RopeState(*record(start.grippers, start.nodes))
    with pytest.raises(ValueError, match=words):
        rope.reduce(state)
    with pytest.raises(ValueError, match=words):
        rope.rollout(state, np.zeros((1, 6)))


def test_a_rope_may_be_given_as_lists():
    rope = Rope("simple_hook")
    start = replace(
        rollout_of("simple_hook", "mujoco").settle(rope.scene.start_rope()), simulation=None
    )
    lists = RopeState(start.grippers.tolist(), start.nodes.tolist())
    move = np.full((1, 6), 0.005)
    np.testing.assert_array_equal(rope.reduce(lists), rope.reduce(start))
    moved, expected = rope.rollout(lists, move), rope.rollout(start, move)
    np.testing.assert_array_equal(moved.states[-1].nodes, expected.states[-1].nodes)
    assert rope.succeeded(lists, np.ravel(lists.grippers)[None], 1e-9)


def test_the_users_own_pybullet_client_is_never_taken():
    bullet = pytest.importorskip("pybullet")
    rollout = RopeRollout(load_scene("simple_hook"), "pybullet")
    state = rollout.settle(rollout.scene.start_rope())
    for number in range(64):  # A user may end all clients, and have one of a number of ours.
        if bullet.isConnected(number):
            bullet.disconnect(number)
    users = bullet.connect(bullet.DIRECT)
    bullet.createMultiBody(0.0, -1, -1, physicsClientId=users)
    rollout.execute(state, np.full((1, 6), 0.005))
    del rollout
    gc.collect()
    assert bullet.isConnected(users)
    assert bullet.getNumBodies(physicsClientId=users) == 1
    bullet.disconnect(users)


def test_missing_pybullet_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    rollout = RopeRollout(load_scene("simple_hook"), "pybullet")
    with pytest.raises(ImportError, match=r"transition-reliability\[pybullet\]"):
        rollout.settle(rollout.scene.start_rope())


def test_no_engine_is_imported_before_it_is_needed():
    program = (
        "import sys; from systems.rope.simulation.quasistatic import RopeRollout; "
        "from systems.rope.paper_scenes import load_scene; "
        "RopeRollout(load_scene('simple_hook'), 'pybullet'); "
        "assert not {'mujoco', 'pybullet'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
