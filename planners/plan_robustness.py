"""How many slightly different models predict that a plan ends where it should."""

from __future__ import annotations

import numpy as np

from planners.path import Path
from planners.predicted_end import predicted_end
from systems.system import System

N_VARIANTS = 16


def plan_robustness(system: System, path: Path, rng: np.random.Generator) -> float | None:
    """Predict a plan with varied models, and return the share that ends where the plan does.

    A variant ends where the plan does if it has a successor for every command and its last state
    is Close to the plan's. Where an outcome hangs by a hair, such as the side to which a ball rolls
    off a ridge, variants end on either side, and no estimator of the reduced state can know on
    which one the true system will.

    Parameters
    ----------
    system : System
        Draws the variants by ``vary``.
    path : Path
    rng : Generator

    Returns
    -------
    share : float or None
        None if the system does not define ``vary``.

    Raises
    ------
    ValueError
        If ``vary`` returns neither None nor a System.
    """
    n_agreeing = 0
    for _ in range(N_VARIANTS):
        variant = system.vary(rng)
        if variant is None:
            return None
        if not isinstance(variant, System):
            raise ValueError(
                f"{type(system).__name__}.vary must return None or a System, got {variant!r}."
            )
        n_agreeing += _agrees(variant, path)
    return n_agreeing / N_VARIANTS


def _agrees(variant: System, path: Path) -> bool:
    end = predicted_end(variant, path.reduced[0], path.commands)
    return end is not None and bool(variant.close(path.reduced[-1:], end[None])[0])
