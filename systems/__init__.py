"""Systems: a robot in one scene, with its reduced model g and its true execution Γ."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from systems.errors import SimulationDivergedError, SystemContractError
from systems.system import Problem, Rollout, StopReason, System

if TYPE_CHECKING:
    from systems.car import Car
    from systems.car_scenes import CarScene, Circle, ConvexPolygon, random_car_scene
    from systems.contract_checks import check_system
    from systems.obstacles import Box, Capsule, Cylinder
    from systems.planar_arm import PlanarArm
    from systems.random_rope_scenes import random_rope_scene
    from systems.rope import Rope
    from systems.rope_scene import Scene
    from systems.rope_scenes import load_scene

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
    "Box": "systems.obstacles",
    "Capsule": "systems.obstacles",
    "Car": "systems.car",
    "CarScene": "systems.car_scenes",
    "Circle": "systems.car_scenes",
    "ConvexPolygon": "systems.car_scenes",
    "Cylinder": "systems.obstacles",
    "PlanarArm": "systems.planar_arm",
    "Rope": "systems.rope",
    "Scene": "systems.rope_scene",
    "check_system": "systems.contract_checks",
    "load_scene": "systems.rope_scenes",
    "random_car_scene": "systems.car_scenes",
    "random_rope_scene": "systems.random_rope_scenes",
}


def __getattr__(name: str) -> Any:
    # Each system is imported when it is first named, so that one does not pay for the others.
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'systems' has no attribute {name!r}")
