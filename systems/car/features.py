"""Compiled description of the car's transitions, in the car's own frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.car.geometry import clearance, scene_distance
from systems.compilation import compiled

Array = NDArray[np.float64]

AHEAD = np.array([-1.05, -0.45, 0.15, 0.75, 1.35])
ASIDE = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
ALONG_ARC = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.25])
SENSING_RANGE = 1.0
NEAR = 0.3
SHARPEST = 4.0
SHORTEST = 1e-9
N_FEATURES = 6 + len(ALONG_ARC) + len(AHEAD) * len(ASIDE)


@compiled
def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


@compiled
def sine_of_slip(ahead: float, left: float, turn: float) -> float:
    """Return the sine of the angle between a displacement and the chord of an arc that turns so.

    Zero where the car can drive there on a circle, forwards or backwards; ±1 for going sideways.
    """
    length = np.hypot(ahead, left)
    if length < SHORTEST:
        return 0.0
    return (left * np.cos(0.5 * turn) - ahead * np.sin(0.5 * turn)) / length


@compiled
def _clearances_along_arc(
    pose: Array,
    chord: float,
    turn: float,
    hulls: Array,
    corners: Array,
    walls: Array,
    result: Array,
) -> None:
    """Measure the clearance on the circle that the car would drive, and a bit beyond its end.

    Parameters
    ----------
    pose : ndarray of shape (3,)
    chord : float
        Distance to the circle's end, negative in reverse.
    turn : float
    result : ndarray of shape (6,)
        In units of 0.3 m, at most 1.
    """
    half = 0.5 * turn
    for k in range(ALONG_ARC.shape[0]):
        part = ALONG_ARC[k]
        reach = chord * part
        if abs(half) > 1e-6:
            reach = chord * np.sin(part * half) / np.sin(half)
        way = pose[2] + part * half
        x, y = pose[0] + reach * np.cos(way), pose[1] + reach * np.sin(way)
        room = clearance(x, y, pose[2] + part * turn, hulls, corners, walls)
        result[k] = _clip(room, NEAR) / NEAR


@compiled
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
    X : ndarray of shape (n, 37)
        Displacement ahead and to the left (metres) and in heading (radians); the sine of the
        angle by which it is off the chord of a circle; the circle's curvature over 4/m; the
        clearance at its end and at six places along the circle, over 0.3 m and at most 1; and
        the signed distance of 5 by 5 points around the car from the nearest thing, in metres and
        at most 1.
    """
    features = np.empty((poses.shape[0], N_FEATURES))
    for row in range(poses.shape[0]):
        x, y, heading = poses[row, 0], poses[row, 1], poses[row, 2]
        cosine, sine = np.cos(heading), np.sin(heading)
        dx, dy = following[row, 0] - x, following[row, 1] - y
        turn = wrap_angle(following[row, 2] - heading)
        ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        length = max(SHORTEST, np.hypot(ahead, left))
        own = features[row]
        own[0], own[1], own[2] = ahead, left, turn
        own[3] = sine_of_slip(ahead, left, turn)
        own[4] = _clip(turn / length, SHARPEST) / SHARPEST
        room = clearance(
            following[row, 0], following[row, 1], following[row, 2], hulls, corners, walls
        )
        own[5] = _clip(room, NEAR) / NEAR
        chord = length if ahead >= 0 else -length
        _clearances_along_arc(poses[row], chord, turn, hulls, corners, walls, own[6:12])
        column = 12
        for i in range(AHEAD.shape[0]):
            for j in range(ASIDE.shape[0]):
                px = x + cosine * AHEAD[i] - sine * ASIDE[j]
                py = y + sine * AHEAD[i] + cosine * ASIDE[j]
                distance = scene_distance(px, py, px, py, hulls, corners, walls)
                own[column] = _clip(distance, SENSING_RANGE)
                column += 1
    return features
