"""What g says of the rest of a plan, from where the system really is."""

from __future__ import annotations

import numpy as np

from planners.predicted_end import predicted_end
from systems.angles import shortest_way
from systems.system import Array, System


def still_arrives(
    system: System, reduced: Array, commands: Array, end: Array, tolerance: float
) -> bool:
    """Say whether g predicts that the rest of a plan arrives, though the system left the plan.

    Commands that name places lead back to the plan; displacements carry an error on to the end.
    Which of the two they are need not be known: g is asked.

    Parameters
    ----------
    system : System
    reduced : ndarray of shape (reduced_dim,)
        Where the system is.
    commands : ndarray of shape (n, command_dim)
        Those of the plan that were not carried out yet.
    end : ndarray of shape (reduced_dim,)
        Where the plan ends.
    tolerance : float
        How far from the plan's end the predicted configuration may be, in the units of the
        configuration.

    Returns
    -------
    arrives : bool
        False if a transition is not valid.
    """
    arrived = predicted_end(system, reduced, commands)
    if arrived is None:
        return False
    dim = system.configuration_dim
    gap = shortest_way(arrived[:dim], end[:dim], system.angular)
    return bool(np.linalg.norm(gap) <= tolerance)
