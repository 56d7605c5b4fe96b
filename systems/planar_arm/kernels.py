"""Compiled steering and features of the planar arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

Array = NDArray[np.float64]
# Rounding of a motion that was shortened to one step.
STEP_ALLOWANCE = 1 + 1e-9
# What :func:`transition_features` returns. A link's angle is from the x axis.
FEATURE_NAMES = tuple(
    f"{kind}{i}" for kind in ("q", "sin_of_link", "cos_of_link", "change_of_q") for i in range(3)
)


@compiled
def limited_targets(current: Array, target: Array, step_size: float) -> Array:
    """Move each row of ``current`` towards ``target`` by at most ``step_size``.

    Parameters
    ----------
    current, target : ndarray of shape (n, 3)
    step_size : float

    Returns
    -------
    limited : ndarray of shape (n, 3)
        Equal to the target where that is within one step.
    """
    limited = target.copy()
    for row in range(current.shape[0]):
        squared = 0.0
        for i in range(3):
            squared += (target[row, i] - current[row, i]) ** 2
        if squared > (step_size * STEP_ALLOWANCE) ** 2:
            scale = step_size / np.sqrt(squared)
            for i in range(3):
                limited[row, i] = current[row, i] + scale * (target[row, i] - current[row, i])
    return limited


@compiled
def transition_features(current: Array, following: Array, step_size: float) -> Array:
    """Describe transitions by joint angles, directions of the links, and motion.

    Parameters
    ----------
    current, following : ndarray of shape (n, 3)
    step_size : float

    Returns
    -------
    X : ndarray of shape (n, 12)
        Three joint angles before the motion; the sines, then the cosines, of the three links'
        angles from the x axis; and the change of the joint angles, in units of one step.
    """
    features = np.empty((current.shape[0], 12))
    for row in range(current.shape[0]):
        angle = 0.0
        for i in range(3):
            angle += current[row, i]
            features[row, i] = current[row, i]
            features[row, 3 + i] = np.sin(angle)
            features[row, 6 + i] = np.cos(angle)
            features[row, 9 + i] = (following[row, i] - current[row, i]) / step_size
    return features
