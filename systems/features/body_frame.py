"""Points and motions as a moving body sees them: from where it is, and the way it faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from systems.features.directions import directions
from systems.validation import as_any_array, as_finite_array

Array = NDArray[np.float64]
PLANAR, SPATIAL = 3, 7


def to_body_frame(poses: ArrayLike, points: ArrayLike) -> Array:
    """Express points of the world in the frame of a body, one body for each row.

    In the plane the first axis of a body's frame points ahead and the second to the left. What a
    feature says in this frame holds wherever in the scene the body is.

    Parameters
    ----------
    poses : array-like of shape (n, 3) or (n, 7)
        In the plane x, y and heading (radians, counter-clockwise from the x axis); in space x, y,
        z and a quaternion w, x, y, z that turns the body's frame into the world's, which need not
        be normalized.
    points : array-like of shape (n, d) or (n, k, d)
        One point, or k points, for each pose; d is 2 in the plane and 3 in space. World frame.

    Returns
    -------
    seen : ndarray of the same shape as ``points``

    Raises
    ------
    ValueError
        If the shapes do not fit together, or a number is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from systems import to_body_frame
    >>> to_body_frame([[1.0, 0.0, np.pi / 2]], [[1.0, 2.0]]).round(3)  # 2 m ahead
    array([[2., 0.]])
    """
    position, turned = _frames(poses)
    places = _points_of(points, len(position), position.shape[1])
    if places.ndim == 2:
        return ((places - position)[:, None] @ turned)[:, 0]
    return (places - position[:, None]) @ turned


def from_body_frame(poses: ArrayLike, places: ArrayLike) -> Array:
    """Locate places that are fixed to a body in the world, for each pose of the body.

    A signed-distance function of the scene, called with the result, gives what is free around the
    body: ``np.clip(signed_distance(from_body_frame(poses, places)), -1, 1)``.

    Parameters
    ----------
    poses : array-like of shape (n, 3) or (n, 7)
        As in :func:`to_body_frame`.
    places : array-like of shape (k, d)
        In the body's frame; d is 2 in the plane (ahead, left) and 3 in space.

    Returns
    -------
    points : ndarray of shape (n, k, d)

    Raises
    ------
    ValueError
        If the shapes do not fit together, or a number is not finite.
    """
    position, turned = _frames(poses)
    fixed = as_finite_array(places, "places", (None, position.shape[1]))
    return position[:, None] + fixed @ turned.transpose(0, 2, 1)


def motion_in_body_frame(poses: ArrayLike, next_poses: ArrayLike) -> Array:
    """Describe motions as the moving body sees them.

    Parameters
    ----------
    poses, next_poses : array-like of shape (n, 3) or (n, 7)
        As in :func:`to_body_frame`.

    Returns
    -------
    motion : ndarray of shape (n, 4) or (n, 6)
        In the plane the displacement ahead and to the left (in the poses' unit), and the sine and
        cosine of the change of heading. In space the displacement along the body's three axes, and
        the rotation as a vector along its axis, as long as its angle (radians).

    Raises
    ------
    ValueError
        If the shapes do not fit together, or a number is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from systems import motion_in_body_frame
    >>> motion_in_body_frame([[0.0, 0.0, np.pi]], [[-1.0, 0.0, -np.pi]]).round(3) + 0.0
    array([[1., 0., 0., 1.]])
    """
    before = _as_poses(poses)
    after = as_finite_array(next_poses, "next_poses", before.shape)
    if before.shape[1] == PLANAR:
        d, turned = 2, _planar_matrices(before)
        turn = directions(after[:, 2:] - before[:, 2:])
    else:
        rotations = _rotations(before)
        d, turned = 3, rotations.as_matrix()
        turn = (rotations.inv() * _rotations(after)).as_rotvec()
    moved = ((after[:, :d] - before[:, :d])[:, None] @ turned)[:, 0]
    return np.hstack([moved, turn])


def _as_poses(poses: ArrayLike) -> Array:
    rows = as_finite_array(poses, "poses", (None, None))
    if rows.shape[1] not in (PLANAR, SPATIAL):
        raise ValueError(
            "poses must have the shape (n, 3), x, y and heading, or (n, 7), x, y, z and a "
            f"quaternion, got {rows.shape}."
        )
    return rows


def _frames(poses: ArrayLike) -> tuple[Array, Array]:
    """Return the positions, (n, d), and the matrices, (n, d, d), that turn body into world."""
    rows = _as_poses(poses)
    if rows.shape[1] == PLANAR:
        return rows[:, :2], _planar_matrices(rows)
    return rows[:, :3], _rotations(rows).as_matrix()


def _planar_matrices(poses: Array) -> Array:
    sine, cosine = np.sin(poses[:, 2]), np.cos(poses[:, 2])
    return np.stack([cosine, -sine, sine, cosine], axis=1).reshape(-1, 2, 2)


def _rotations(poses: Array) -> Rotation:
    if not len(poses):
        return Rotation.identity(0)
    w, x, y, z = poses[:, 3:].T
    return Rotation.from_quat(np.stack([x, y, z, w], axis=1))


def _points_of(points: ArrayLike, n: int, d: int) -> Array:
    places = as_any_array(points, "points")
    shape = (n, d) if places.ndim == 2 else (n, None, d)
    return as_finite_array(points, "points", shape)
