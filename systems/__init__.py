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
    from systems.planar_arm import PlanarArm

__all__ = [
    "Car",
    "CarScene",
    "Circle",
    "ConvexPolygon",
    "PlanarArm",
    "Problem",
    "Rollout",
    "SimulationDivergedError",
    "StopReason",
    "System",
    "SystemContractError",
    "check_system",
    "random_car_scene",
]

_HOMES = {
    "Car": "systems.car",
    "CarScene": "systems.car_scenes",
    "Circle": "systems.car_scenes",
    "ConvexPolygon": "systems.car_scenes",
    "PlanarArm": "systems.planar_arm",
    "check_system": "systems.contract_checks",
    "random_car_scene": "systems.car_scenes",
}


def __getattr__(name: str) -> Any:
    # Each system is imported when it is first named, so that one does not pay for the others.
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'systems' has no attribute {name!r}")
