"""Why an execution of the rope can stop."""

from __future__ import annotations

from enum import Enum


class RopeStopReason(Enum):
    """Why an execution of the rope stopped early; each value is a sentence."""

    GRIPPER_CONTACT = "A gripper would have touched an obstacle and stopped before it."
    OVERSTRETCHED = "The rope reached its largest allowed stretch and stopped there."
