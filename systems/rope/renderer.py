"""Pictures of a rope scene, rendered off screen with MuJoCo."""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.rope.gripper_goal import GripperGoal
from systems.rope.obstacles.mjcf import geom_xml, meshes_xml, numbers_xml
from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.shapes import Array
from systems.rope.scene import GRIPPER_RADIUS, ROPE_RADIUS, Scene
from systems.validation import check_count, check_finite

Color = tuple[float, float, float, float]
Image = NDArray[np.uint8]

ROPE_COLOR: Color = (0.15, 0.65, 0.15, 1.0)
BAND_COLOR: Color = (0.95, 0.60, 0.05, 1.0)
GRIPPER_COLOR: Color = (0.10, 0.25, 0.85, 1.0)
_GOAL_COLOR: Color = (0.90, 0.10, 0.10, 0.6)
_WALL_COLOR: Color = (0.55, 0.35, 0.75, 0.35)
_OUTER_WALL_COLOR: Color = (0.55, 0.35, 0.75, 0.08)
_FLOOR_COLOR: Color = (0.75, 0.75, 0.75, 1.0)
_HOOK_COLOR: Color = (0.05, 0.50, 0.55, 1.0)
_MAX_GEOMS = 5000
# MuJoCo ends the process where a picture is larger than the graphics driver's memory for it.
_MOST_PIXELS = 4096


class SceneRenderer:
    """Renders pictures of one scene; use it as a context manager.

    Without a display, MuJoCo needs the environment variable ``MUJOCO_GL`` to be ``egl`` or
    ``osmesa`` before it is first imported. On Linux without a display it is set to ``egl`` here,
    unless it is set already.

    Parameters
    ----------
    scene : Scene
    width, height : int
        Pixels.
        At most 4096.
    azimuth, elevation : float
        Direction of the camera's view, degrees.

    Raises
    ------
    ValueError
        If an argument is of the wrong kind or out of range.
    RuntimeError
        If there is no display, and MuJoCo was imported before it was told so.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        width: int = 960,
        height: int = 640,
        azimuth: float = 40.0,
        elevation: float = -30.0,
    ) -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene must be a Scene, got {scene!r}.")
        for name, pixels in (("width", width), ("height", height)):
            check_count(pixels, name)
            if pixels > _MOST_PIXELS:
                raise ValueError(f"{name} must be at most {_MOST_PIXELS} pixels, got {pixels}.")
        check_finite(azimuth, "azimuth")
        check_finite(elevation, "elevation")
        width, height = int(width), int(height)
        if sys.platform == "linux" and not _has_display():
            os.environ.setdefault("MUJOCO_GL", "egl")
        import mujoco

        if sys.platform == "linux" and not _has_display() and "glfw" in mujoco.GLContext.__module__:
            raise RuntimeError(
                "MuJoCo was imported before it was told to draw without a display. Set the "
                "environment variable MUJOCO_GL to egl or osmesa before Python starts."
            )
        self._scene = scene
        model = mujoco.MjModel.from_xml_string(_model_xml(scene, width, height))
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        self._renderer = mujoco.Renderer(model, height, width, max_geom=_MAX_GEOMS)
        self._camera = mujoco.MjvCamera()
        low, high = scene.bounds
        self._camera.lookat[:] = low + (high - low) * (0.5, 0.5, 0.25)
        self._camera.distance = float(np.linalg.norm(high - low))
        self._camera.azimuth, self._camera.elevation = azimuth, elevation

    def __repr__(self) -> str:
        return f"<SceneRenderer of {self._scene.name!r}>"

    def __enter__(self) -> SceneRenderer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._renderer.close()

    def render(self, curves: Iterable[tuple[Array, Color]], *, goal: bool = True) -> Image:
        """Render the scene with ropes or bands in it, the grippers at their ends.

        Parameters
        ----------
        curves : iterable of (ndarray of shape (n, 3), color)
            Centre lines, drawn as thick as the rope.
        goal : bool
            Whether to show where the grippers should end; of a ``GoalRegion`` nothing is shown.

        Returns
        -------
        image : ndarray of uint8 of shape (height, width, 3)
        """
        self._renderer.update_scene(self._data, self._camera)
        for points, color in curves:
            for start, end in itertools.pairwise(points):
                self._add_link(start, end, color)
            self._add_spheres((points[0], points[-1]), GRIPPER_COLOR)
        if goal:
            self._add_spheres(_goal_places(self._scene), _GOAL_COLOR, 1.5 * GRIPPER_RADIUS)
        image: Image = self._renderer.render()
        return image

    def _add_link(self, start: Array, end: Array, color: Color) -> None:
        import mujoco

        geom = self._new_geom(mujoco.mjtGeom.mjGEOM_CAPSULE, (1.0, 1.0, 1.0), start, color)
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, ROPE_RADIUS, start, end)

    def _add_spheres(
        self, centers: Iterable[Array], color: Color, radius: float = GRIPPER_RADIUS
    ) -> None:
        import mujoco

        for center in centers:
            self._new_geom(mujoco.mjtGeom.mjGEOM_SPHERE, (radius,) * 3, center, color)

    def _new_geom(self, shape: Any, size: Sequence[float], center: Array, color: Color) -> Any:
        import mujoco

        scene = self._renderer.scene
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            geom, shape, size, center, np.eye(3).ravel(), np.array(color, dtype=np.float32)
        )
        scene.ngeom += 1
        return geom


def _has_display() -> bool:
    return "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ


def _goal_places(scene: Scene) -> Array:
    if isinstance(scene.goal, GripperGoal):
        return np.array([scene.goal.position])
    return scene.goal.reshape(-1, 3) if isinstance(scene.goal, np.ndarray) else np.empty((0, 3))


def _model_xml(scene: Scene, width: int, height: int) -> str:
    geoms = "\n".join(
        geom_xml(obstacle, f'rgba="{numbers_xml(obstacle_color(obstacle))}"')
        for obstacle in scene.obstacles
    )
    high = scene.bounds[1] + (0.0, 0.0, 2.0)
    return f"""
<mujoco>
  <visual>
    <global offwidth="{width}" offheight="{height}"/>
    <headlight ambient="0.45 0.45 0.45" diffuse="0.45 0.45 0.45" specular="0 0 0"/>
    <quality shadowsize="4096"/>
    <map znear="0.02"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/>
    {meshes_xml(scene.obstacles)}
  </asset>
  <worldbody>
    <light pos="0 0 {high[2]}" dir="0.1 0.1 -1" diffuse="0.35 0.35 0.35"/>
{geoms}
  </worldbody>
</mujoco>"""


def obstacle_color(obstacle: Obstacle) -> Color:
    """Return the colour of an obstacle, which follows from its name."""
    if "outer wall" in obstacle.name:
        return _OUTER_WALL_COLOR
    if "wall" in obstacle.name:
        return _WALL_COLOR
    return _FLOOR_COLOR if obstacle.name == "floor" else _HOOK_COLOR
