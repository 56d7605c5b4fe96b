"""The PBD rope: against a plain reference, and against what the rope does."""

import numpy as np
import pytest
from rope_paths import PATHS, path_commands
from rope_states import pbd_nodes, polyline_length

from systems import Box, Rope, Scene
from systems.rope.band.band import reduced_dim
from systems.rope.catenary import hanging_rope
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import load_scene
from systems.rope.simulation.quasistatic import RopeRollout
from systems.rope.slack.pbd_kernels import propagate_pbd_ropes
from systems.rope.slack.pbd_ropes import KINDS, pbd_dim, pbd_model, pbd_ropes_at_rest

WORLD = np.array([[-2.0] * 3, [2.0] * 3])
ENDS = np.array([[0.0, -0.2, 0.0], [0.0, 0.2, 0.0]])


def room(*obstacles, length=0.6):
    away = ENDS + np.array([1.2, 0.0, 0.0])
    return Scene(obstacles, WORLD, length, away, away)


def reference_step(nodes, moved, spacing, kind, packed):
    friction, radius = kind
    before = nodes.copy()
    nodes[1:-1] += moved
    nodes[1:-1, 2] -= 1e-4
    order = list(range(len(nodes) - 1))
    for i in 2 * (order + order[::-1]):
        way = nodes[i + 1] - nodes[i]
        length = np.linalg.norm(way)
        if length > spacing:
            free = np.array([i > 0, i + 1 < len(nodes) - 1])
            nodes[i] += free[0] / free.sum() * (1 - spacing / length) * way
            nodes[i + 1] -= free[1] / free.sum() * (1 - spacing / length) * way
    for i in range(1, len(nodes) - 1):
        depth = radius - signed_distance(nodes[i][None], packed)[0]
        if depth > 0:
            h = 1e-7 * np.eye(3)
            sides = signed_distance(np.concatenate([nodes[i] + h, nodes[i] - h]), packed)
            normal = (sides[:3] - sides[3:]) / 2e-7
            way = nodes[i] + depth * normal - before[i]
            slid = way - (way @ normal) * normal
            rubbed = min(1.0, friction * depth / max(np.linalg.norm(slid), 1e-300))
            nodes[i] = before[i] + way - rubbed * slid
    return 0.975 * (nodes - before)[1:-1]


def reference_move(nodes, moved, command, spacing, kind, packed):
    nodes, start = nodes.copy(), nodes[[0, -1]].copy()
    n_strides = max(1, int(np.ceil(np.linalg.norm(command.reshape(2, 3), axis=1).max() / 0.005)))
    for share in np.arange(1, n_strides + 1) / n_strides:
        nodes[[0, -1]] = start + share * command.reshape(2, 3)
        for _ in range(2):
            moved = reference_step(nodes, moved, spacing, kind, packed)
    for _ in range(4):
        moved = reference_step(nodes, moved, spacing, kind, packed)
    return nodes, moved


def moved_by(command, row, grippers, scene):
    allowed, model = np.array([True]), pbd_model(scene)
    limit = scene.max_band_length
    return propagate_pbd_ropes(row, grippers[None], command[None], allowed, model, limit)


def carried_along(scene, ropes, grippers, commands):
    """Return the nodes after each command that is valid in turn, (T, n_ropes, n_nodes, 3)."""
    row, nodes = ropes[None], []
    for command in commands:
        row, valid = moved_by(command, row, grippers, scene)
        if not valid[0]:
            break
        grippers = grippers + command
        nodes.append(pbd_nodes(row[0], grippers))
    return np.array(nodes)


def test_it_agrees_with_a_plain_reference():
    bar = Box((0.05, 0.0, -0.1), (0.3, 0.03, 0.03), "bar")
    scene = room(bar)
    nodes = hanging_rope(ENDS + np.array([0, 0, 0.2]), 0.6, scene.n_nodes)
    spacing, rng = 0.6 / (scene.n_nodes - 1), np.random.default_rng(0)
    row, grippers = pbd_ropes_at_rest(nodes)[None], nodes[[0, -1]].ravel()
    ropes = [(nodes, 0.0)] * len(KINDS)
    for _ in range(25):
        command = np.tile([0.0, 0.0, -0.01], 2) + rng.normal(scale=0.004, size=6)
        row, _ = moved_by(command, row, grippers, scene)
        ropes = [
            reference_move(*rope, command, spacing, kind, scene.packed)
            for rope, kind in zip(ropes, KINDS, strict=True)
        ]
        grippers = grippers + command
        expected = [nodes for nodes, _ in ropes]
        np.testing.assert_allclose(pbd_nodes(row[0], grippers), expected, atol=1e-6)
    for (nodes, _), (_, radius) in zip(ropes, KINDS, strict=True):
        assert signed_distance(nodes[1:-1], scene.packed).min() < radius + 1e-6, "they touch"


def test_a_rope_in_the_air_hangs_as_a_catenary():
    scene = room()
    laid = np.linspace(*ENDS, scene.n_nodes)
    still = np.zeros((200, 6))
    ropes = carried_along(scene, pbd_ropes_at_rest(laid), ENDS.ravel(), still)[-1]
    expected = hanging_rope(ENDS, 0.6, scene.n_nodes)
    np.testing.assert_allclose(ropes, [expected] * len(KINDS), atol=0.01)


def test_it_lies_on_a_bar_and_not_in_it():
    scene = room(Box((0.0, 0.0, -0.1), (0.3, 0.03, 0.03), "bar"))
    laid = np.linspace(*ENDS, scene.n_nodes)
    ropes = carried_along(scene, pbd_ropes_at_rest(laid), ENDS.ravel(), np.zeros((200, 6)))[-1]
    for nodes, (_, radius) in zip(ropes, KINDS, strict=True):
        middle = nodes[scene.n_nodes // 2]
        assert -0.07 + radius - 1e-6 < middle[2] < -0.05
        assert signed_distance(nodes[1:-1], scene.packed).min() > radius - 0.005


def test_ropes_whose_commands_are_not_carried_out_stay():
    scene = room()
    rows = np.tile(pbd_ropes_at_rest(hanging_rope(ENDS, 0.6, scene.n_nodes)), (2, 1))
    grippers, command = np.tile(ENDS.ravel(), (2, 1)), np.full((2, 6), 0.01)
    moves = np.array([False, True])
    moved, valid = propagate_pbd_ropes(rows, grippers, command, moves, pbd_model(scene), np.inf)
    np.testing.assert_array_equal(valid, moves)
    np.testing.assert_array_equal(moved[0], rows[0])
    assert np.abs(moved[1] - rows[1]).max() > 0.005


@pytest.mark.parametrize("kind", ["caught", "free"])
@pytest.mark.parametrize("name", ["simple_hook", "complex_hook"])
def test_it_moves_like_the_rope_and_is_caught_where_the_rope_is(name, kind):
    scene, path = load_scene(name), PATHS[name][kind]
    commands, rollout = path_commands(path), RopeRollout(scene)
    start = rollout.settle(hanging_rope(path[0], scene.rope_length, scene.n_nodes))
    executed = rollout.execute(start, commands)
    at_rest = pbd_ropes_at_rest(start.nodes)
    ropes = carried_along(scene, at_rest, start.grippers.ravel(), commands)
    n = executed.n_completed
    n_both = min(n, len(ropes))
    true = np.array([state.nodes for state in executed.states[1 : n_both + 1]])
    apart = np.linalg.norm(ropes[:n_both] - true[:, None], axis=3).mean(axis=(0, 2))
    assert apart.max() < 0.03
    assert (len(ropes) < len(commands)) == (kind == "caught")
    assert abs(len(ropes) - n) <= 8


def test_a_successor_may_not_overstretch_any_of_them():
    scene = room(length=0.4)
    ends = 0.999 * ENDS * scene.max_band_length / 0.4
    taut = pbd_ropes_at_rest(np.linspace(*ends, scene.n_nodes))
    apart = 0.001 * ENDS.ravel() * scene.max_band_length / 0.4
    for command, expected in ((0.9 * apart, True), (1.1 * apart, False)):
        moved, valid = moved_by(command, taut[None], ends.ravel(), scene)
        assert valid[0] == expected
        assert np.array_equal(moved[0], taut) != expected


@pytest.mark.parametrize("overstretched", range(len(KINDS)))
def test_it_takes_only_one_of_them(overstretched):
    scene = room()
    near = np.array([[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]])
    ropes = np.tile(hanging_rope(near, 0.6, scene.n_nodes), (len(KINDS), 1, 1))
    ropes[overstretched, 1:-1, 2] -= 0.4
    row = np.concatenate(
        [pbd_ropes_at_rest(rope)[: pbd_dim(scene) // len(KINDS)] for rope in ropes]
    )
    moved, valid = moved_by(np.zeros(6), row[None], near.ravel(), scene)
    assert not valid[0]
    np.testing.assert_array_equal(moved[0], row)


def test_many_at_once_move_as_each_does_alone():
    bar = Box((0.05, 0.0, -0.1), (0.3, 0.03, 0.03), "bar")
    scene, rng = room(bar), np.random.default_rng(0)
    rest = pbd_ropes_at_rest(hanging_rope(ENDS, 0.6, scene.n_nodes))
    rows, grippers = np.tile(rest, (70, 1)), np.tile(ENDS.ravel(), (70, 1))
    rows += rng.normal(scale=0.002, size=rows.shape)
    commands = rng.uniform(0.1, 1.0, size=(70, 1)) * rng.uniform(-0.025, 0.025, size=(70, 6))
    moves = rng.random(70) < 0.8
    free, _ = propagate_pbd_ropes(rows, grippers, commands, moves, pbd_model(scene), np.inf)
    ropes = [pbd_nodes(*row) for row in zip(free, grippers + commands, strict=True)]
    longest = np.median(polyline_length(np.array(ropes)))
    model = pbd_model(scene)
    together, valid = propagate_pbd_ropes(rows, grippers, commands, moves, model, longest)
    assert 0 < np.count_nonzero(valid) < np.count_nonzero(moves)
    for i in range(70):
        one = slice(i, i + 1)
        alone = propagate_pbd_ropes(
            rows[one], grippers[one], commands[one], moves[one], model, longest
        )
        np.testing.assert_array_equal(together[one], alone[0])
        assert valid[i] == alone[1][0]


def test_nodes_at_one_place_do_not_stop_it():
    scene = room()
    row = pbd_ropes_at_rest(np.zeros((scene.n_nodes, 3)))[None]
    moved, valid = moved_by(np.zeros(6), row, ENDS.ravel(), scene)
    assert valid[0]
    assert np.isfinite(moved).all()
    assert not np.array_equal(moved, row)


def test_what_the_rope_is_caught_on_stops_it_where_the_band_alone_goes_on():
    bands, ropes = Rope("simple_hook"), Rope("simple_hook", features="clearance")
    path = PATHS["simple_hook"]["caught"]
    nodes = hanging_rope(path[0], bands.scene.rope_length, bands.scene.n_nodes)
    start, commands = RopeRollout(bands.scene).settle(nodes), path_commands(path)
    band, row, stopped = bands.reduce(start)[None], ropes.reduce(start)[None], None
    for step, command in enumerate(commands):
        band, valid = bands.propagate(band, command[None])
        assert valid[0]
        following, valid = ropes.propagate(row, command[None])
        if not valid[0]:
            stopped = step
            np.testing.assert_array_equal(following, row)
            break
        row = following
        np.testing.assert_array_equal(ropes.bands(row), band)
    assert stopped is not None


def test_a_rope_that_carries_it_plans_with_it():
    rope = Rope("simple_hook", features="clearance")
    start = rope.reduce(rope.scene_problem().start)
    command = np.tile([0.0, 0.0, 0.01], 2)
    reached, valid = rope.propagate(start[None], command[None])
    assert valid.all()
    width = reduced_dim(rope.scene)
    np.testing.assert_array_equal(
        reached[0, :width], Rope("simple_hook").propagate(start[None, :width], command[None])[0][0]
    )
    nodes = pbd_nodes(reached[0, width:], reached[0, :6])
    ends = np.tile(start[:6] + command, (len(KINDS), 1))
    np.testing.assert_allclose(nodes[:, [0, -1]].reshape(-1, 6), ends, atol=1e-12)
