"""Convex polyhedra as obstacles of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from systems.rope.obstacles.shapes import LARGEST_SIZE, Array, Point
from systems.validation import as_finite_array

# Metres: of flatter ones, physics engines can't compute the inertia.
LEAST_WIDTH = 1e-4
# A point's distance is computed from all faces that can be seen from it.
MOST_CORNERS = 500
# Qhull may cut a flat side into triangles of which some have no area, up to this share of the
# square of the longest edge. They hold no point that their neighbours don't.
_NO_AREA = 1e-12


@dataclass(frozen=True)
class ConvexPolyhedron:
    """The convex hull of points.

    A mesh that is convex is one, given by its vertices. A mesh that is not convex can be given as
    several, if it is a union of convex parts.

    Attributes
    ----------
    corners : array-like of shape (n, 3)
        At least four, not in one plane. Those that are no corners of the hull are left out. The
        hull may have at most 500, and must be at least 0.1 mm wide in all directions.
    name : str
    """

    corners: Sequence[Point]
    name: str = "polyhedron"

    def __post_init__(self) -> None:
        from scipy.spatial import ConvexHull, QhullError

        corners = as_finite_array(self.corners, "ConvexPolyhedron.corners", (None, 3))
        if len(corners) and np.abs(corners).max() > LARGEST_SIZE:
            raise ValueError(
                f"ConvexPolyhedron.corners must be at most {LARGEST_SIZE:g} m from the origin, got "
                f"{np.abs(corners).max():g} m."
            )
        try:
            kept = corners[np.sort(ConvexHull(corners).vertices)]
            object.__setattr__(self, "corners", tuple(map(tuple, kept.tolist())))
            width = self._least_width()
        except (QhullError, ValueError):
            width = 0.0
        if width < LEAST_WIDTH:
            raise ValueError(
                "ConvexPolyhedron.corners must be at least four points that are not in one plane, "
                f"and their hull at least {LEAST_WIDTH:g} m wide, got {len(corners)} points and a "
                f"width of {width:.3g} m."
            )
        if len(self.corners) > MOST_CORNERS:
            raise ValueError(
                f"ConvexPolyhedron.corners must have a hull of at most {MOST_CORNERS} corners, got "
                f"{len(self.corners)}; leave some out."
            )

    @cached_property
    def faces(self) -> tuple[Array, Array]:
        """Faces as triangles, shape (n_faces, 3, 3), and outward normals, shape (n_faces, 3)."""
        from scipy.spatial import ConvexHull

        hull = ConvexHull(np.array(self.corners))
        triangles = hull.points[hull.simplices]
        edges = triangles - np.roll(triangles, 1, axis=1)
        area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        kept = area > _NO_AREA * np.square(edges).sum(axis=2).max()
        return triangles[kept], hull.equations[kept, :3]

    def _least_width(self) -> float:
        triangles, normals = self.faces
        depths = (triangles[:, :1] - np.array(self.corners)) @ normals[:, :, None]
        return float(depths[..., 0].max(axis=1).min())
