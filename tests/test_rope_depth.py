"""The rope's surface is at most a millimetre deep in an obstacle in every state that Γ returns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.rope.penetration import centre_line, line_depth, main, walk
from systems import Box, Capsule, Cylinder, Rope, Scene, random_rope_scene
from systems.rope.obstacles.packing import pack_obstacles
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import SCENE_NAMES
from systems.rope.scene import ROPE_RADIUS
from systems.rope.simulation.depth_kernels import depth_in_obstacles
from systems.rope.simulation.engines import ENGINES

MILLIMETRE = 1e-3

# Seeds of walks whose ropes snap over edges: at rest for as long as others, they would be 2 to
# 5 mm deep.
HARD = [("simple_hook_short", 0), ("simple_hook_short", 2), ("engine_assembly", 1)]


def deepest_on_walk(scene, engine, seed):
    rope = Rope(scene, engine)
    states = list(walk(rope, seed))
    assert len(states) > 8, "one for each leg at least, and the start"
    return max(line_depth(centre_line(state, rope.scene, engine), rope.scene) for state in states)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("scene", "seed"), HARD)
def test_ropes_that_snap_over_edges_are_returned_when_they_are_out(scene, engine, seed):
    assert -0.5 * MILLIMETRE < deepest_on_walk(scene, engine, seed) <= MILLIMETRE


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scene", SCENE_NAMES)
def test_no_rope_on_a_walk_is_deeper_than_a_millimetre(scene, engine):
    deepest = [deepest_on_walk(scene, engine, seed) for seed in range(4)]
    assert max(deepest) <= MILLIMETRE


@pytest.mark.slow
@pytest.mark.parametrize("number", [4, 5, 6, 7])
def test_nor_is_one_in_a_random_scene(number):
    scene = random_rope_scene(np.random.SeedSequence([2027, number]))
    assert max(deepest_on_walk(scene, "mujoco", seed) for seed in range(4)) <= MILLIMETRE


coordinate = st.floats(-0.2, 0.2)
lines = st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=2, max_size=5)
OBSTACLES = pack_obstacles(
    [
        Box((0.0, 0.0, 0.0), (0.1, 0.02, 0.05)),
        Cylinder((0.15, 0.1, 0.0), 0.03, 0.1, axis=0),
        Capsule((-0.1, 0.1, 0.1), (0.1, -0.1, 0.15), 0.01),
    ]
)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(lines)
def test_depth_is_that_of_the_nearest_place_of_the_line(points):
    line = np.array(points)
    shares = np.linspace(0.0, 1.0, 2001)[:, None, None]
    places = line[:-1] + shares * (line[1:] - line[:-1])
    plain = max(0.0, ROPE_RADIUS - signed_distance(places, OBSTACLES).min())
    assert depth_in_obstacles(line, OBSTACLES) == pytest.approx(plain, abs=4e-4)


def test_a_line_that_lies_on_an_obstacle_is_measured_to_a_hundredth_of_a_millimetre():
    for height, depth in ((0.0605, 0.0), (0.0595, 0.0005), (0.05, 0.01)):
        line = np.array([[-0.3, 0.0, height], [-0.01, 0.0, height], [0.3, 0.0, height]])
        assert depth_in_obstacles(line, OBSTACLES) == pytest.approx(depth, abs=1e-9)
    # It passes an edge, of which it is nearest between two of its places.
    for shift in np.linspace(0.0, 0.001, 7):
        line = np.array([[0.0, -0.2 + shift, 0.0588], [0.0, 0.2 + shift, 0.0588]])
        over_edge = line + np.array([0.1, 0.0, 0.0])
        assert depth_in_obstacles(over_edge, OBSTACLES) == pytest.approx(0.0012, abs=1.5e-5)
    assert depth_in_obstacles(line, np.empty((0, 8))) == 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_rope_that_is_laid_through_an_obstacle_settles_outside_or_not_at_all(engine):
    """A rope that lies 4 mm deep on a table is lifted."""
    table = Box((0.0, 0.0, 0.0), (0.5, 0.5, 0.1))
    start = np.array([[-0.2, 0.0, 0.3], [0.2, 0.0, 0.3]])
    scene = Scene([table], [[-1.0] * 3, [1.0] * 3], 0.4, start, start + np.array([0.0, 0.1, 0.0]))
    rope = Rope(scene, engine)
    laid = scene.start_rope()
    laid[:, 2] = 0.15
    laid[1:-1, 2] = 0.106
    state = rope._execution.settle(laid)
    assert line_depth(centre_line(state, scene, engine), scene) <= MILLIMETRE


def test_the_benchmark_tells_the_depth_in_returned_states_and_on_the_way(capsys):
    few = ["--random-scenes", "0", "--seeds", "1", "--scenes", "simple_hook_short"]
    main([*few, "--engines", "mujoco", "--moves", "walks"])
    header, row, total = capsys.readouterr().out.splitlines()
    assert "deepest" in header
    assert row.split()[:3] == ["mujoco", "walks", "simple_hook_short"]
    n_states, errors, deepest, _, _, above, lines, bands, on_the_way, _ = row.split()[3:]
    assert int(n_states) > 100
    assert (errors, above) == ("0", "0.00%")
    assert 0.5 < float(deepest) == float(lines) <= 1.0 < float(on_the_way) < 6.0
    assert 0.0 < float(bands) < 10.0, "the band's line is outside"
    assert total.split("all of these")[1].split() == row.split()[3:]
