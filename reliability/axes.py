"""Where plots are drawn: what the user gave, or a new figure."""

from __future__ import annotations

from typing import Any

from systems.extras import needing


def drawing_axes(axes: Any, method: str, n_axes: int, **figure: Any) -> Any:
    """Return matplotlib Axes to draw on; a sequence, if more than one is needed.

    Parameters
    ----------
    axes : Axes, sequence of Axes, or None
        None makes a figure.
    method : str
        That draws, for the message where matplotlib is missing.
    n_axes : int
        How many are needed.
    **figure
        For ``matplotlib.pyplot.subplots``.

    Raises
    ------
    ValueError
        If ``axes`` are not as many Axes.
    """
    with needing("examples", method):
        from matplotlib.axes import Axes

    if axes is None:
        import matplotlib.pyplot as plt

        return plt.subplots(1, n_axes, layout="constrained", **figure)[1]
    try:
        given = [axes] if n_axes == 1 else list(axes)
    except TypeError:
        given = []
    if len(given) != n_axes or not all(isinstance(one, Axes) for one in given):
        name = "axis must be one matplotlib Axes" if n_axes == 1 else f"axes must be {n_axes} Axes"
        raise ValueError(f"{name}, got {axes!r}.")
    return axes
