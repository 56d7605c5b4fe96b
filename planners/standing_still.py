"""Whether a system may be at a place, by its model: where g allows the transition to nowhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.system import Array, System


def can_stay(system: System, reduced: Array) -> NDArray[np.bool_]:
    """Say, for each reduced state (n, reduced_dim), whether g allows standing still there."""
    command = system.steer(reduced, reduced[:, : system.configuration_dim])
    return system.propagate(reduced, command)[1]


def is_only_configuration(system: System) -> bool:
    """Say whether a system's reduced states are configurations and nothing else."""
    return system.reduced_dim == system.configuration_dim
