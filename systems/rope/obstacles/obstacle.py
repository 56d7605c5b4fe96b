"""What may stand in a scene."""

from __future__ import annotations

from systems.rope.obstacles.polyhedron import ConvexPolyhedron
from systems.rope.obstacles.shapes import Box, Capsule, Cylinder, Sphere

Obstacle = Box | Cylinder | Capsule | Sphere | ConvexPolyhedron
OBSTACLE_KINDS = "Box, Cylinder, Capsule, Sphere or ConvexPolyhedron"
