"""Voxel grids of the rope agree with slow plain ones."""

import numpy as np
import pytest
from rope_states import resample_bands
from scipy.spatial.transform import Rotation

from systems import (
    Box,
    Capsule,
    ConvexPolyhedron,
    Cylinder,
    Rope,
    Scene,
    Sphere,
    check_system,
)
from systems.rope.band.band import reduced_dim
from systems.rope.features.voxels import unpack_voxels, voxel_features
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.paper_scenes import SCENE_NAMES, load_scene


def random_bands(scene, rng, n):
    """Bands through random points of a box that reaches out of the world."""
    low, high = scene.bounds
    room = 0.3 * (high - low)
    rows = np.empty((n, reduced_dim(scene)))
    for row in rows:
        middle = rng.uniform(low - 0.3 * room, high + 0.3 * room)
        points = middle + rng.normal(size=(rng.integers(2, 9), 3)) * scene.max_band_length / 5
        row[:6] = np.concatenate([points[0], points[-1]])
        row[6:] = np.tile(points[-1], (len(row) - 6) // 3)
        row[6 : 6 + points.size] = points.ravel()
    return rows


def successors(rows, rng):
    """The same bands, each point moved by about a step."""
    after = rows.copy()
    after[:, :6] += rng.normal(size=(len(rows), 6)) * 0.01
    after[:, 6:9], after[:, -3:] = after[:, :3], after[:, 3:6]
    return after


def slow_voxels(before, after, scene):
    """One transition's grids, cell by cell."""
    side = scene.max_band_length
    grippers = before[:3] + before[3:6] + (after[:3] + after[3:6])
    origin = 0.25 * grippers - 0.5 * side
    axes = [start + (np.arange(32) + 0.5) * (side / 32) for start in origin]
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    free = signed_distance(centers, scene.packed) > 0
    free &= ((centers >= scene.bounds[0]) & (centers <= scene.bounds[1])).all(axis=-1)
    cells = np.zeros((3, 32, 32, 32), dtype=np.uint8)
    cells[0] = ~free
    for channel, band in ((1, before), (2, after)):
        index = np.floor((resample_bands(band[None])[0] - origin) * (32 / side)).astype(int)
        index = index[((index >= 0) & (index < 32)).all(axis=1)]
        cells[channel][tuple(index.T)] = 1
    return cells


@pytest.mark.parametrize("name", SCENE_NAMES)
def test_grids_agree_with_slow_ones_in_every_scene(name, rng):
    scene = load_scene(name)
    before = random_bands(scene, rng, 25)
    after = successors(before, rng)
    grids = unpack_voxels(voxel_features(before, after, scene))
    for grid, *pair in zip(grids, before, after, strict=True):
        np.testing.assert_array_equal(grid, slow_voxels(*pair, scene))
    assert 0 < grids[:, 0].mean() < 1


def test_obstacles_of_every_kind_agree_with_slow_ones(rng):
    cylinders = [Cylinder(rng.uniform(-0.4, 0.4, 3), 0.06, 0.1, axis) for axis in (0, 1, 2)]
    ends = rng.uniform(-0.5, 0.5, (8, 3))
    ends[1] = ends[0] + [0, 0, 0.3]
    capsules = [Capsule(p, q, 0.05) for p, q in ends.reshape(4, 2, 3)]
    box = Box((0.1, 0.2, -0.1), (0.1, 0.02, 0.3))
    turn = Rotation.from_euler("xyz", (20, 40, 60), degrees=True).as_matrix()
    tilted = [
        Box(place, (0.15, 0.1, 0.01), rotation=turn) for place in rng.uniform(-0.4, 0.4, (3, 3))
    ]
    poles = [Cylinder(rng.uniform(-0.4, 0.4, 3), 0.03, 0.2, rng.normal(size=3)) for _ in range(3)]
    ball = Sphere((0.2, -0.3, 0.1), 0.08)
    wedge = ConvexPolyhedron((-0.2, 0.1, 0.0) + rng.normal(size=(8, 3)) * 0.1)
    rest = [wedge, ball, *poles, *tilted]
    bounds = np.array([[-0.6, -0.6, -0.6], [0.6, 0.6, 0.9]])
    start = np.array([[-0.1, 0.0, 0.85], [0.1, 0.0, 0.85]])
    scene = Scene([*rest, *capsules, *cylinders, box], bounds, 0.22, start, start)
    wide = Scene([*rest, *capsules, *cylinders, box], bounds, 0.3, start, start, max_stretch=3.0)
    for each in (scene, wide):
        before = random_bands(each, rng, 40)
        after = successors(before, rng)
        grids = unpack_voxels(voxel_features(before, after, each))
        slow = [slow_voxels(*pair, each) for pair in zip(before, after, strict=True)]
        np.testing.assert_array_equal(grids, slow)


def test_rows_are_packed_bits_in_the_order_channel_x_y_z():
    start = np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    bounds = np.array([[-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]])
    scene = Scene([Box((0.155, 0.0, 0.0), (0.003, 9, 9))], bounds, 0.32, start, start, 1.0)
    row = np.zeros((1, reduced_dim(scene)))
    row[0, :6] = start.ravel()
    row[0, 6:9], row[0, 9:] = start[0], np.tile(start[1], (row.shape[1] - 9) // 3)
    after = row + np.tile([0.0, 0.0, 0.04], row.shape[1] // 3)
    rows = voxel_features(row, after, scene)
    assert rows.shape == (1, 12288)
    assert rows.dtype == np.uint8
    cells = unpack_voxels(rows)
    np.testing.assert_array_equal(np.packbits(cells.reshape(1, -1), axis=1), rows)
    # The cube is 0.32 m wide around (0, 0, 0.02): a cell is 1 cm.
    surroundings, before, following = cells[0]
    assert np.flatnonzero(surroundings.any(axis=(1, 2))).tolist() == [31]
    assert set(np.argwhere(before)[:, 2]) == {14}
    assert set(np.argwhere(following)[:, 2]) == {18}
    assert 20 <= before.sum() <= 21


def test_out_of_the_world_is_occupied():
    scene = load_scene("simple_hook")
    rows = random_bands(scene, np.random.default_rng(1), 1)
    rows += np.tile(scene.bounds[1] + 5 * scene.max_band_length, rows.shape[1] // 3)
    assert unpack_voxels(voxel_features(rows, rows, scene))[0, 0].all()


@pytest.mark.parametrize(("features", "width"), [("voxels", 12288), ("vector", 13)])
def test_the_rope_gives_either_kind_of_row(features, width):
    rope = Rope("engine_assembly", features=features)
    check_system(rope)
    state = np.tile(rope.scene.start.ravel(), rope.reduced_dim // 6)[None]
    rows = rope.features(state, state)
    assert rows.shape == (1, width)
    assert (rows.dtype == np.uint8) == (features == "voxels")


def test_bad_rows_are_refused():
    scene = load_scene("simple_hook")
    rows = np.zeros((2, reduced_dim(scene)))
    for call, message in (
        (lambda: voxel_features(rows[:, 1:], rows, scene), "reduced must have the shape"),
        (lambda: voxel_features(rows, rows[:1], scene), "next_reduced must have the shape"),
        (lambda: voxel_features(rows + np.nan, rows, scene), "reduced must be finite"),
        (lambda: unpack_voxels(np.zeros((1, 12288))), "rows must be uint8 of the shape"),
    ):
        with pytest.raises(ValueError, match=message):
            call()


def test_a_box_fills_the_cells_whose_centres_it_holds_whatever_its_place(rng):
    """Boxes are filled in by whole columns along z, from their lowest cell to their highest."""
    start = np.array([[-0.1, 0.0, 2.0], [0.1, 0.0, 2.0]])
    bounds = np.array([[-9.0] * 3, [9.0] * 3])
    for _ in range(40):
        low = rng.uniform(-0.2, 0.1, size=3)
        high = low + rng.uniform(0.0005, 0.3, size=3)
        box = Box(tuple(0.5 * (low + high)), tuple(0.5 * (high - low)))
        scene = Scene([box], bounds, 0.32, start, start, max_stretch=1.0)
        row = np.zeros((1, reduced_dim(scene)))
        surroundings = unpack_voxels(voxel_features(row, row, scene))[0, 0]
        centers = -0.16 + 0.01 * (np.arange(32) + 0.5)
        inside = [
            (box.center[k] - box.half_extents[k] <= centers)
            & (centers <= box.center[k] + box.half_extents[k])
            for k in range(3)
        ]
        expected = np.einsum("i,j,k->ijk", *(each.astype(np.uint8) for each in inside))
        np.testing.assert_array_equal(surroundings, expected)


def test_grids_move_along_with_their_bands(rng):
    scene = load_scene("simple_hook")
    before = random_bands(scene, rng, 10)
    after = successors(before, rng)
    shift = np.array([0.25, -0.5, 0.125])
    moved = [Box(tuple(np.add(each.center, shift)), each.half_extents) for each in scene.obstacles]
    there = Scene(
        moved, scene.bounds + shift, scene.rope_length, scene.start + shift, scene.goal + shift
    )
    everywhere = np.tile(shift, before.shape[1] // 3)
    here = unpack_voxels(voxel_features(before, after, scene))
    shifted = unpack_voxels(voxel_features(before + everywhere, after + everywhere, there))
    # Rounding may take a point that is on the face between two cells to the other one.
    assert (here != shifted).mean() < 1e-5
    swapped = unpack_voxels(voxel_features(after, before, scene))
    np.testing.assert_array_equal(swapped[:, [0, 2, 1]], here)
