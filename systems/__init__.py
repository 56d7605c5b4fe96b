"""Systems: a robot in one scene, with its reduced model g and its true execution Γ."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from systems.errors import SimulationDivergedError, SystemContractError
from systems.system import Problem, Rollout, StopReason, System

if TYPE_CHECKING:
    from systems.car.car import Car
    from systems.car.scenes import CarScene, Circle, ConvexPolygon, random_car_scene
    from systems.contract_checks import check_system
    from systems.planar_arm.planar_arm import PlanarArm
    from systems.rope.obstacles.shapes import Box, Capsule, Cylinder
    from systems.rope.paper_scenes import load_scene
    from systems.rope.random_scenes import random_rope_scene
    from systems.rope.rope import Rope
    from systems.rope.scene import Scene
    from systems.rope.simulation.state import RopeState
    from systems.rope.simulation.stop_reason import RopeStopReason

__all__ = [
    "Box",
    "Capsule",
    "Car",
    "CarScene",
    "Circle",
    "ConvexPolygon",
    "Cylinder",
    "PlanarArm",
    "Problem",
    "Rollout",
    "Rope",
    "RopeState",
    "RopeStopReason",
    "Scene",
    "SimulationDivergedError",
    "StopReason",
    "System",
    "SystemContractError",
    "check_system",
    "load_scene",
    "random_car_scene",
    "random_rope_scene",
]

_HOMES = {
    "Box": "systems.rope.obstacles.shapes",
    "Capsule": "systems.rope.obstacles.shapes",
    "Car": "systems.car.car",
    "CarScene": "systems.car.scenes",
    "Circle": "systems.car.scenes",
    "ConvexPolygon": "systems.car.scenes",
    "Cylinder": "systems.rope.obstacles.shapes",
    "PlanarArm": "systems.planar_arm.planar_arm",
    "Rope": "systems.rope.rope",
    "RopeState": "systems.rope.simulation.state",
    "RopeStopReason": "systems.rope.simulation.stop_reason",
    "Scene": "systems.rope.scene",
    "check_system": "systems.contract_checks",
    "load_scene": "systems.rope.paper_scenes",
    "random_car_scene": "systems.car.scenes",
    "random_rope_scene": "systems.rope.random_scenes",
}


def __getattr__(name: str) -> Any:
    # Each system is imported when it is first named, so that one does not pay for the others.
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'systems' has no attribute {name!r}")
