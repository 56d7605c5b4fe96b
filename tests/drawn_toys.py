"""Systems that can be drawn, as quickly as can be."""

import numpy as np
from toy_systems import Disc

from systems import BoxShape, SphereShape, TubeShape


class DrawnDisc(Disc):
    """The disc with a ball for a robot, and a box for a scene."""

    def draw(self, reduced):
        return [SphereShape([*reduced, 0.0], 0.1, (0.0, 0.0, 1.0, 1.0))]

    def draw_scene(self):
        return [BoxShape([0.0, 0.0, -0.3], [1.0, 1.0, 0.01])]

    def traced_points(self, configurations):
        return np.insert(configurations, 2, 0.0, axis=1)[:, None]


class DrawnArrow(DrawnDisc):
    """The disc as a tube towards the origin, with another picture of the true state."""

    def draw(self, reduced):
        return [TubeShape([[0.0, 0.0, 0.0], [*reduced, 0.0]], 0.02)]

    def draw_state(self, state):
        return [SphereShape([*state, 0.0], 0.1)]
