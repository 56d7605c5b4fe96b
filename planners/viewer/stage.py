"""Panels in a viser scene."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from planners.viewer.colors import GOAL, LEFT_PLAN, TREE
from planners.viewer.layout import FIELD_OF_VIEW, Layout
from planners.viewer.nodes import ShapeNodes, add_lines
from planners.viewer.panel import Panel
from systems.drawing.shapes import Shape, SphereShape
from systems.extras import needing
from systems.system import Array

# What can be shown and hidden, by the name of its part of the scene.
PARTS = {
    "tree": "search tree",
    "planned": "planned motion",
    "executed": "executed motion",
    "goal": "goal",
}
_GOAL_RADIUS, _LEFT_RADIUS = 0.012, 0.010
_IN_FRONT = 0.004
_AMBIENT = 0.7
_TREE_WIDTH, _PLANNED_WIDTH, _EXECUTED_WIDTH = 1.0, 4.5, 2.0


def start_server(port: int) -> Any:
    """Return a viser server that only this machine can reach.

    Raises
    ------
    ImportError
        If viser is not installed.
    """
    with needing("viewer", "The viewer"):
        import viser
    with quiet():
        return viser.ViserServer(host="127.0.0.1", port=port, verbose=False)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep viser's announcements off the standard output."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


class Stage:
    """Panels, set up in the scene of a viser server.

    Parameters
    ----------
    server : viser.ViserServer
    panels : sequence of Panel
    layout : Layout
    """

    def __init__(self, server: Any, panels: Sequence[Panel], layout: Layout) -> None:
        self._server = server
        self._moving: list[tuple[ShapeNodes, list[list[Shape]]]] = []
        self._set_up_view(layout)
        self._groups: dict[str, list[Any]] = {part: [] for part in PARTS}
        for i, (panel, offset) in enumerate(zip(panels, layout.offsets, strict=True)):
            name = f"/{i + 1}. {panel.name.replace('/', '-')}"
            self._server.scene.add_frame(name, show_axes=False, position=offset)
            self._add(name, panel, layout)
            if len(panels) > 1:
                self._label(name, panel, layout.labels[i])

    def show_frame(self, frame: int) -> None:
        """Move everything to where it is in a frame."""
        with self._server.atomic():
            for nodes, frames in self._moving:
                nodes.show(frames[frame])

    def set_visible(self, part: str, visible: bool) -> None:
        """Show or hide one of ``PARTS`` in all panels."""
        for group in self._groups[part]:
            group.visible = visible

    def _set_up_view(self, layout: Layout) -> None:
        scene, camera = self._server.scene, self._server.initial_camera
        scene.set_up_direction("+z")
        camera.fov = FIELD_OF_VIEW
        camera.position, camera.look_at = layout.camera, layout.look_at
        camera.near, camera.far = 1e-3 * layout.size, 1e2 * layout.size
        scene.configure_default_lights(enabled=True, cast_shadow=False)
        scene.add_light_ambient("/light", intensity=_AMBIENT)

    def _add(self, name: str, panel: Panel, layout: Layout) -> None:
        scene, size = self._server.scene, layout.size
        ShapeNodes(scene, f"{name}/scene").show(panel.scene)
        for part in PARTS:
            group = scene.add_frame(f"{name}/{part}", show_axes=False)
            self._groups[part].append(group)
        add_lines(scene, f"{name}/tree/lines", panel.tree, TREE, _TREE_WIDTH)
        path = panel.planned_path
        add_lines(scene, f"{name}/planned/path", path.points, path.colors, _PLANNED_WIDTH)
        # Where the execution follows the plan, its thinner line is to be seen in front.
        towards = layout.camera - layout.look_at
        raised = _IN_FRONT * size * towards / np.linalg.norm(towards)
        path = panel.executed_path
        add_lines(
            scene, f"{name}/executed/path", path.points + raised, path.colors, _EXECUTED_WIDTH
        )
        goals = _balls(panel.goal_points, _GOAL_RADIUS * size, GOAL)
        ShapeNodes(scene, f"{name}/goal").show([*panel.goal, *goals])
        left = _balls(panel.left_plan, _LEFT_RADIUS * size, LEFT_PLAN)
        ShapeNodes(scene, f"{name}/executed/left plan").show(left)
        for part, frames in (("planned", panel.planned), ("executed", panel.executed)):
            if frames:
                self._moving.append((ShapeNodes(scene, f"{name}/{part}/robot"), frames))

    def _label(self, name: str, panel: Panel, place: Array) -> None:
        self._server.scene.add_label(
            f"{name}/name", panel.name, position=place, anchor="top-center", font_screen_scale=1.4
        )


def _balls(points: Array, radius: float, color: tuple[float, float, float, float]) -> list[Shape]:
    different = np.unique(points.round(9), axis=0)
    return [SphereShape(point, radius, color) for point in different]
