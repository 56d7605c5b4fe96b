"""Compiled inner loops of the planar arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.compilation import compiled

Array = NDArray[np.float64]


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
        The target itself where it is within one step.
    """
    limited = target.copy()
    for row in range(current.shape[0]):
        squared = 0.0
        for i in range(3):
            squared += (target[row, i] - current[row, i]) ** 2
        # The allowance lets transitions that were cut to one step arrive exactly.
        if squared > (step_size * (1 + 1e-9)) ** 2:
            scale = step_size / np.sqrt(squared)
            for i in range(3):
                limited[row, i] = current[row, i] + scale * (target[row, i] - current[row, i])
    return limited


@compiled
def transition_features(current: Array, following: Array, step_size: float) -> Array:
    """Describe transitions by configuration, link directions and direction of motion.

    Parameters
    ----------
    current, following : ndarray of shape (n, 3)
    step_size : float

    Returns
    -------
    X : ndarray of shape (n, 12)
        The three joint angles, sine and cosine of the three links' absolute angles, and the
        motion in steps.
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
