"""Why the execution of a rope may end early."""

from __future__ import annotations

from enum import Enum


class RopeStopReason(Enum):
    """Why a rope's rollout ended before all commands were carried out."""

    GRIPPER_CONTACT = "A gripper would have touched an obstacle and stopped before it."
    EDGE_OF_WORLD = "A gripper would have left the scene's bounds and stopped at them."
    OVERSTRETCHED = "The rope reached its largest allowed stretch and stopped there."
