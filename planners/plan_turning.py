"""How much a plan's motion changes from each transition to the next."""

from __future__ import annotations

import numpy as np

from systems.angles import shortest_way
from systems.system import Array, System


def plan_turning(system: System, reduced: Array) -> float:
    """Return the sum of the changes of motion between a plan's transitions, in steps.

    A motion is the difference of two successive configurations, divided by ``step_size``. A
    straight plan with even steps has 0, a turn by 90° adds √2, and turning back adds 2.

    What a reduced model leaves out often acts on from one transition to the next: a load swings, a
    trailer cuts corners, a car keeps its speed. An estimator, which is asked about single
    transitions, can't know; and the more a plan's motion changes, the more there is of it.

    Parameters
    ----------
    system : System
    reduced : ndarray of shape (T + 1, reduced_dim)

    Returns
    -------
    turning : float
    """
    configurations = reduced[:, : system.configuration_dim]
    motions = shortest_way(configurations[:-1], configurations[1:], system.angular)
    changes = np.linalg.norm(np.diff(motions, axis=0), axis=1)
    return float(changes.sum() / system.step_size)
