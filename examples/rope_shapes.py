"""A rope that starts draped over a pole, among obstacles of every shape. Writes rope_shapes.png."""

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from planners import BiasedRRT, execute
from systems import (
    BAND_COLOR,
    ROPE_COLOR,
    Box,
    Capsule,
    ConvexPolyhedron,
    Cylinder,
    GripperGoal,
    Rope,
    Scene,
    SceneRenderer,
    Sphere,
)

# Metres, z up. A convex polyhedron is the hull of its corners: here a roof over its four sides.
roof = np.array([[x, y, 0.0] for x in (-0.2, 0.2) for y in (-0.15, 0.15)])
ridge = np.array([[-0.2, 0.0, 0.15], [0.2, 0.0, 0.15]])
scene = Scene(
    obstacles=[
        Box((0.0, 0.0, -0.425), (1.0, 0.7, 0.025), "floor"),
        Cylinder((-0.45, 0.0, -0.05), 0.025, 0.4, axis=(0.5, 0.0, 1.0), name="slanted pole"),
        Capsule((-0.8, 0.0, 0.1), (-0.38, 0.0, 0.1), 0.025, "arm of the pole"),
        Sphere((0.1, 0.35, -0.25), 0.15, "ball"),
        Box(
            (0.15, -0.4, -0.2),
            (0.25, 0.15, 0.015),
            "ramp",
            rotation=Rotation.from_euler("xyz", [20, -35, 10], degrees=True).as_matrix(),
        ),
        ConvexPolyhedron(np.add([*roof, *ridge], (0.6, 0.0, -0.4)), "roof"),
    ],
    bounds=[[-1.0, -0.7, -0.4], [1.0, 0.7, 0.5]],
    rope_length=0.8,
    start=[[-0.7, 0.3, -0.1], [-0.7, -0.3, -0.1]],  # of both grippers
    start_via=[[-0.7, 0.04, 0.145], [-0.7, -0.04, 0.145]],  # over the arm of the pole
    goal=GripperGoal("B", (0.75, -0.25, 0.0)),  # gripper A may be anywhere
)
rope = Rope(scene, features="vector")
# The renderer comes first: MuJoCo must learn how to draw before it simulates.
with SceneRenderer(scene, width=900, height=560, azimuth=115, elevation=-25) as pictures:
    problem = rope.scene_problem()  # the rope comes to rest over the pole's arm
    planner = BiasedRRT(rope, random_state=0)
    execution = execute(rope, planner, problem, tolerance=0.03, max_replans=3)
    print(execution.status.value)
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.1), layout="constrained")
    titles = ("The start: draped over the pole's arm", "The end: gripper B is at its goal")
    for axis, state, title in zip(
        axes, (execution.states[0], execution.states[-1]), titles, strict=True
    ):
        band = rope.reduce(state)[6:].reshape(-1, 3)
        axis.imshow(pictures.render([(state.nodes, ROPE_COLOR), (band, BAND_COLOR)]))
        axis.set(xticks=[], yticks=[], title=title)
figure.suptitle(
    "Green: the rope. Orange: the elastic band that it is planned for as. Red: the goal."
)
figure.savefig("rope_shapes.png")
