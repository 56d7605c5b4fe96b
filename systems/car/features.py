"""Compiled features of the car's transitions, in the car's own frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.car.geometry import PackedScene, clearance, clipped, scene_distance
from systems.compilation import compiled

Array = NDArray[np.float64]

# Where the scene is sensed, in metres from the rear axle: 5 places ahead by 5 to the left.
AHEAD = np.array([-1.05, -0.45, 0.15, 0.75, 1.35])
ASIDE = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
SENSING_RANGE = 1.0
# Where the clearance is measured along the driven arc, as parts of its length.
ALONG_ARC = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.25])
# Clearances above this, in metres, make no difference.
NEAR = 0.3
# Curvatures above this, in 1/m, make no difference.
SHARPEST = 4.0
SHORTEST = 1e-9

# The columns of a row of features.
MOVE_AHEAD, MOVE_LEFT, TURN, SLIP, CURVATURE, END_CLEARANCE = range(6)
ARC_CLEARANCES = END_CLEARANCE + 1
SENSED = ARC_CLEARANCES + len(ALONG_ARC)
N_FEATURES = SENSED + len(AHEAD) * len(ASIDE)
FEATURE_NAMES = (
    "ahead",
    "left",
    "turn",
    "sine_of_slip",
    "curvature",
    "clearance_at_end",
    *(f"clearance_at_{part:.0%}_of_arc" for part in ALONG_ARC),
    *(f"distance_{ahead:+}_ahead_{left:+}_left" for ahead in AHEAD for left in ASIDE),
)


@compiled
def sine_of_slip(ahead: float, left: float, turn: float) -> float:
    """Return the sine of the angle between a displacement and the chord of an arc.

    The arc starts in the car's direction and turns as the displacement does. The sine is 0 where
    the car can drive along that arc, forwards or backwards, and ±1 for a motion sideways.
    """
    length = np.hypot(ahead, left)
    if length < SHORTEST:
        return 0.0
    return (left * np.cos(0.5 * turn) - ahead * np.sin(0.5 * turn)) / length


@compiled
def _clearances_along_arc(
    pose: Array, chord: float, turn: float, scene: PackedScene, result: Array
) -> None:
    """Measure the clearance along the arc that the car would drive, and a bit beyond its end.

    Parameters
    ----------
    pose : ndarray of shape (3,)
    chord : float
        Distance to the arc's end in metres, negative in reverse.
    turn : float
        Change of heading from the arc's start to its end.
    scene : PackedScene
    result : ndarray of shape (6,)
        Receives the clearances in units of 0.3 m, limited to [-1, 1].
    """
    half = 0.5 * turn
    for k in range(ALONG_ARC.shape[0]):
        part = ALONG_ARC[k]
        reach = chord * part
        if abs(half) > 1e-6:
            reach = chord * np.sin(part * half) / np.sin(half)
        way = pose[2] + part * half
        x, y = pose[0] + reach * np.cos(way), pose[1] + reach * np.sin(way)
        room = clearance(x, y, pose[2] + part * turn, scene)
        result[k] = clipped(room, NEAR) / NEAR


@compiled
def _sensed_distances(pose: Array, scene: PackedScene, result: Array) -> None:
    """Measure the signed distance of 25 places around the car from the nearest thing.

    Parameters
    ----------
    pose : ndarray of shape (3,)
    scene : PackedScene
    result : ndarray of shape (25,)
        Receives the distances in metres, limited to [-1, 1].
    """
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    k = 0
    for i in range(AHEAD.shape[0]):
        for j in range(ASIDE.shape[0]):
            x = pose[0] + cosine * AHEAD[i] - sine * ASIDE[j]
            y = pose[1] + sine * AHEAD[i] + cosine * ASIDE[j]
            result[k] = clipped(scene_distance(x, y, x, y, scene), SENSING_RANGE)
            k += 1


@compiled
def transition_features(poses: Array, following: Array, scene: PackedScene) -> Array:
    """Describe transitions by their displacement and by what is near, as seen from the car.

    Parameters
    ----------
    poses, following : ndarray of shape (n, 3)
    scene : PackedScene

    Returns
    -------
    X : ndarray of shape (n, 37)
        The displacement ahead and to the left (metres) and in heading (radians); the sine of the
        angle between it and the chord of an arc that turns as much; the curvature of that arc in
        units of 4/m, limited to [-1, 1]; the clearance at its end and at six places along the arc,
        in units of 0.3 m and limited to [-1, 1]; and the signed distances of 5 by 5 places around
        the car from the nearest obstacle or wall, in metres and limited to [-1, 1].
    """
    features = np.empty((poses.shape[0], N_FEATURES))
    for row in range(poses.shape[0]):
        pose, end, own = poses[row], following[row], features[row]
        cosine, sine = np.cos(pose[2]), np.sin(pose[2])
        dx, dy = end[0] - pose[0], end[1] - pose[1]
        turn = wrap_angle(end[2] - pose[2])
        ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        length = max(SHORTEST, np.hypot(ahead, left))
        own[MOVE_AHEAD], own[MOVE_LEFT], own[TURN] = ahead, left, turn
        own[SLIP] = sine_of_slip(ahead, left, turn)
        own[CURVATURE] = clipped(turn / length, SHARPEST) / SHARPEST
        own[END_CLEARANCE] = clipped(clearance(end[0], end[1], end[2], scene), NEAR) / NEAR
        chord = length if ahead >= 0 else -length
        _clearances_along_arc(pose, chord, turn, scene, own[ARC_CLEARANCES:SENSED])
        _sensed_distances(pose, scene, own[SENSED:])
    return features
