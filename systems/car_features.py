"""Compiled description of the car's transitions, in the car's own frame."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.car_geometry import clearance, scene_distance

Array = NDArray[np.float64]

AHEAD = np.array([-1.05, -0.45, 0.15, 0.75, 1.35])
ASIDE = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
SENSING_RANGE = 1.0
N_FEATURES = 6 + len(AHEAD) * len(ASIDE)


@njit(cache=True, nogil=True)
def transition_features(
    poses: Array, following: Array, hulls: Array, corners: Array, walls: Array
) -> Array:
    """Describe transitions by their displacement and by what is near, seen from the car.

    Parameters
    ----------
    poses, following : ndarray of shape (n, 3)
    hulls, corners, walls : ndarray
        The scene, packed.

    Returns
    -------
    X : ndarray of shape (n, 31)
        Displacement ahead, to the left (metres) and in heading (radians), the sine of its slip,
        arc of that displacement would lack (radians), clearance before and after, and the signed
        distance of 5 by 5 points around the car from the nearest obstacle, all clipped at 1 m.
    """
    features = np.empty((poses.shape[0], N_FEATURES))
    for row in range(poses.shape[0]):
        x, y, heading = poses[row, 0], poses[row, 1], poses[row, 2]
        cosine, sine = np.cos(heading), np.sin(heading)
        dx, dy = following[row, 0] - x, following[row, 1] - y
        turn = wrap_angle(following[row, 2] - heading)
        ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        features[row, 0], features[row, 1], features[row, 2] = ahead, left, turn
        features[row, 3] = sine_of_slip(ahead, left, turn)
        before = clearance(x, y, heading, hulls, corners, walls)
        after = clearance(
            following[row, 0], following[row, 1], following[row, 2], hulls, corners, walls
        )
        features[row, 4] = min(SENSING_RANGE, before)
        features[row, 5] = min(SENSING_RANGE, after)
        column = 6
        for i in range(AHEAD.shape[0]):
            for j in range(ASIDE.shape[0]):
                px = x + cosine * AHEAD[i] - sine * ASIDE[j]
                py = y + sine * AHEAD[i] + cosine * ASIDE[j]
                distance = scene_distance(px, py, px, py, hulls, corners, walls)
                features[row, column] = max(-SENSING_RANGE, min(SENSING_RANGE, distance))
                column += 1
    return features


@njit(cache=True, nogil=True)
def sine_of_slip(ahead: float, left: float, turn: float) -> float:
    """Return the sine of the angle between a displacement and the chord of an arc that turns so.

    Zero where the car can drive there on a circle, forwards or backwards; ±1 for going sideways.
    """
    length = np.hypot(ahead, left)
    if length < 1e-9:
        return 0.0
    return (left * np.cos(0.5 * turn) - ahead * np.sin(0.5 * turn)) / length
