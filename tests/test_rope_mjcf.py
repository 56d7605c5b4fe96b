"""Obstacles in MuJoCo are where our distances say they are, and pictures show them."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from systems import (
    Box,
    Capsule,
    ConvexPolyhedron,
    Cylinder,
    SceneRenderer,
    Sphere,
    load_scene,
)
from systems.rope.obstacles.mjcf import geom_xml, meshes_xml
from systems.rope.obstacles.packing import pack_obstacles
from systems.rope.obstacles.shapes import box_from_ranges
from systems.rope.obstacles.signed_distance import signed_distance

PROBE_RADIUS = 0.01
TURN = Rotation.from_euler("xyz", (20, 40, 60), degrees=True).as_matrix()
OBSTACLES = [
    Box((0.1, -0.2, 0.05), (0.1, 0.2, 0.3)),
    Cylinder((0.0, 0.1, -0.1), 0.1, 0.2, 0),
    Cylinder((0.0, 0.1, -0.1), 0.1, 0.2, 1),
    Cylinder((0.0, 0.1, -0.1), 0.1, 0.2, 2),
    Capsule((0.1, 0.1, 0.1), (-0.1, 0.3, -0.2), 0.07),
    Sphere((0.1, -0.1, 0.05), 0.2),
    Box((0.1, -0.2, 0.05), (0.1, 0.2, 0.3), rotation=TURN),
    Cylinder((0.0, 0.1, -0.1), 0.1, 0.2, (0.3, -0.2, 0.5)),
    ConvexPolyhedron(np.random.default_rng(3).normal(size=(12, 3)) * 0.15),
]


def in_mujoco(obstacle, points):
    """Distances from points to an obstacle as MuJoCo computes them, with a small sphere."""
    probe = f'<body mocap="true"><geom type="sphere" size="{PROBE_RADIUS}"/></body>'
    meshes = f"<asset>{meshes_xml([obstacle])}</asset>"
    xml = f"<mujoco>{meshes}<worldbody>{geom_xml(obstacle)}{probe}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    distances = []
    for point in points:
        data.mocap_pos[0] = point
        mujoco.mj_forward(model, data)
        distances.append(mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None) + PROBE_RADIUS)
    return np.array(distances)


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda each: f"{type(each).__name__}")
def test_distances_are_mujocos(obstacle, rng):
    points = rng.uniform(-0.6, 0.6, size=(60, 3))
    ours = signed_distance(points, pack_obstacles([obstacle]))
    outside = ours > 2 * PROBE_RADIUS
    assert outside.sum() > 30
    np.testing.assert_allclose(in_mujoco(obstacle, points[outside]), ours[outside], atol=2e-5)


def test_geoms_bear_further_attributes_and_exact_numbers():
    third = Box((1 / 3, 0.0, 0.0), (0.1, 0.1, 0.1))
    xml = geom_xml(third, 'rgba="1 0 0 1"')
    assert repr(1 / 3) in xml
    assert xml.startswith("<geom ")
    assert xml.endswith('rgba="1 0 0 1"/>')


def test_a_box_from_ranges_spans_them():
    box = box_from_ranges((-0.1, 0.3), (0.2, 0.4), (0.0, 1.0), "box")
    assert box.center == pytest.approx((0.1, 0.3, 0.5))
    assert box.half_extents == pytest.approx((0.2, 0.1, 0.5))
    with pytest.raises(ValueError, match="half_extents must be positive"):
        box_from_ranges((0.3, -0.1), (0.2, 0.4), (0.0, 1.0), "box")


PICTURES = """
import sys
import numpy as np
from systems.rope.paper_scenes import load_scene
from systems.rope.renderer import ROPE_COLOR, SceneRenderer

scene = load_scene("engine_assembly")
with SceneRenderer(scene, width=120, height=80) as renderer:
    pictures = [
        renderer.render([], goal=False),
        renderer.render([(scene.start_rope(), ROPE_COLOR)], goal=False),
        renderer.render([]),
    ]
with SceneRenderer(scene, width=120, height=80, azimuth=220.0) as renderer:
    pictures.append(renderer.render([], goal=False))
np.save(sys.argv[1], pictures)
"""


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("scene", None),
        ("scene", "engine_assembly"),
        ("width", 0),
        ("width", 10**6),
        ("height", -1),
        ("height", 2.5),
        ("azimuth", np.nan),
        ("elevation", "up"),
    ],
)
def test_pictures_that_would_end_the_process_are_refused(argument, value):
    arguments = {"scene": load_scene("engine_assembly")} | {argument: value}
    with pytest.raises(ValueError, match=argument):
        SceneRenderer(**arguments)


AFTER_MUJOCO = """
import mujoco
from systems import SceneRenderer, load_scene

SceneRenderer(load_scene("engine_assembly"), width=120, height=80)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere MuJoCo draws without being told")
def test_without_a_display_a_picture_is_refused_in_words(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    done = subprocess.run([sys.executable, "-c", AFTER_MUJOCO], capture_output=True, text=True)
    assert "Set the environment variable MUJOCO_GL" in done.stderr


def test_pictures_show_obstacles_the_rope_and_the_goal(tmp_path):
    # In a process of its own: MuJoCo chooses how to render when it is first imported.
    file = tmp_path / "pictures.npy"
    done = subprocess.run([sys.executable, "-c", PICTURES, file], capture_output=True, text=True)
    if any(word in done.stderr for word in ("EGL", "OpenGL", "OSMesa")):
        pytest.skip(f"MuJoCo can't render here: {done.stderr.splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    empty, with_rope, with_goal, other_side = np.load(file).astype(int)
    assert empty.shape == (80, 120, 3)
    assert empty.std() > 10, "the engine is in it"
    changed = np.abs(with_rope - empty).sum(axis=2) > 60
    assert 20 < changed.sum() < 1500
    red, green, blue = with_rope[changed].T
    assert ((green > red) | (blue > red)).mean() > 0.8, "the rope is green, its grippers are blue"
    red, green, blue = with_goal[np.abs(with_goal - empty).sum(axis=2) > 60].T
    assert len(red) > 5
    assert (red > 1.2 * green).sum() > 5, "the goal is red"
    assert (red >= green).all(), "and its shadow grey"
    assert np.abs(other_side - empty).mean() > 3
