"""A rope scene of your own, and a classifier that learns it. Writes own_scene.png."""

import matplotlib.pyplot as plt
import numpy as np

from planners import BiasedRRT
from reliability import Summary, TransitionReliabilityClassifier, collect_transitions
from systems import BAND_COLOR, ROPE_COLOR, Box, Rope, Scene, SceneRenderer

N_PLANS, N_TESTS = 120, 6

# Metres, z up. A box is its centre, its half extents and a name that decides its colour.
scene = Scene(
    obstacles=[
        Box((0.0, 0.0, -0.475), (1.0, 0.5, 0.025), "floor"),
        Box((-0.1, 0.0, -0.05), (0.4, 0.025, 0.025), "bar"),
        Box((0.35, 0.0, -0.25), (0.05, 0.5, 0.2), "wall"),
    ],
    bounds=np.array([[-1.0, -0.5, -0.45], [1.0, 0.5, 0.45]]),
    rope_length=0.8,
    start=np.array([[-0.8, 0.35, 0.1], [-0.8, -0.35, 0.1]]),  # of both grippers
    goal=np.array([[0.8, 0.2, 0.1], [0.8, -0.2, 0.1]]),
)
rope = Rope(scene, features="vector")  # thirteen numbers; "clearance" sees more, and takes longer
# The renderer comes first: MuJoCo must learn how to draw before it simulates.
with SceneRenderer(scene, width=900, height=560, azimuth=60, elevation=-25) as pictures:
    data = collect_transitions(rope, BiasedRRT(rope), N_PLANS, n_jobs=2, random_state=0)
    print(Summary.of(data))
    classifier = TransitionReliabilityClassifier(class_weight="balanced", random_state=0)
    classifier.fit(data.features(rope), data.y, groups=data.plan)

    problem = rope.scene_problem()
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.3), layout="constrained")
    for axis, name, estimator in zip(axes, ("Without", "With"), (None, classifier), strict=True):
        n_arrived = 0
        for seed in reversed(range(N_TESTS)):
            planner = BiasedRRT(rope, estimator, k=10, random_state=seed)
            plan = planner.plan(rope.reduce(problem.start), problem.goal)
            rollout = rope.rollout(problem.start, plan.commands)
            n_arrived += rope.succeeded(rollout.states[-1], problem.goal, tolerance=0.025)
        print(f"{name} the classifier {n_arrived} of {N_TESTS} ropes arrive.")
        # Shown is the last one: where its plan takes the band, and where the rope really is.
        band = rope.bands(plan.reduced[[rollout.n_completed]])[0, 6:].reshape(-1, 3)
        axis.imshow(pictures.render([(rollout.states[-1].nodes, ROPE_COLOR), (band, BAND_COLOR)]))
        axis.set(
            xticks=[], yticks=[], title=f"{name} the classifier: {n_arrived} of {N_TESTS} arrive"
        )
figure.suptitle("Green: the true rope. Orange: the band that the planner believes. Red: the goal.")
figure.savefig("own_scene.png")
