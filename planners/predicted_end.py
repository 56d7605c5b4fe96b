"""Where commands lead by g."""

from __future__ import annotations

from systems.system import Array, System


def predicted_end(system: System, reduced: Array, commands: Array) -> Array | None:
    """Predict commands one after the other, and return the reduced state that they lead to.

    Parameters
    ----------
    system : System
    reduced : ndarray of shape (reduced_dim,)
    commands : ndarray of shape (n, command_dim)

    Returns
    -------
    end : ndarray of shape (reduced_dim,) or None
        None if a transition is not valid.
    """
    predicted = reduced[None]
    for command in commands:
        predicted, valid = system.propagate(predicted, command[None])
        if not valid[0]:
            return None
    end: Array = predicted[0]
    return end
