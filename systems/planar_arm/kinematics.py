"""Forward and inverse kinematics of an arm of three equal links in a plane."""

from __future__ import annotations

import numpy as np

from systems.angles import TURN
from systems.system import Array

LINK_LENGTH = 0.5
REACH = 3 * LINK_LENGTH


def forward_kinematics(configurations: Array) -> Array:
    """Locate the base, the two inner joints and the tip of the arm.

    Parameters
    ----------
    configurations : ndarray of shape (n, 3)
        Joint angles in radians, each relative to the link before.

    Returns
    -------
    positions : ndarray of shape (n, 4, 2)
        x and z in metres, with the base at the origin.
    """
    angles = np.cumsum(configurations, axis=1)
    links = LINK_LENGTH * np.stack([np.cos(angles), np.sin(angles)], axis=2)
    return np.concatenate([np.zeros((len(links), 1, 2)), np.cumsum(links, axis=1)], axis=1)


def inverse_kinematics(target: Array, headings: Array) -> Array:
    """Find the configurations that put the arm's tip on a point with given last links.

    Parameters
    ----------
    target : ndarray of shape (2,)
        x and z in metres.
    headings : ndarray of shape (n,)
        Directions of the last link, in radians from the x axis.

    Returns
    -------
    solutions : ndarray of shape (n_solutions, 3)
        Joint angles in [-π, π): for every heading that leaves the last joint within reach of the
        first two links, the solution with the elbow bent to the left, then, in the same order,
        those with it bent to the right.
    """
    wrist = target - LINK_LENGTH * np.column_stack([np.cos(headings), np.sin(headings)])
    cosine_of_elbow = np.sum(wrist**2, axis=1) / (2 * LINK_LENGTH**2) - 1
    reached = cosine_of_elbow <= 1
    bend = np.arccos(cosine_of_elbow[reached])
    elbow = np.concatenate([bend, -bend])
    shoulder = np.tile(np.arctan2(wrist[reached, 1], wrist[reached, 0]), 2) - elbow / 2
    hand = np.tile(headings[reached], 2) - shoulder - elbow
    return (np.column_stack([shoulder, elbow, hand]) + np.pi) % TURN - np.pi
