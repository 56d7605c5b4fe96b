"""A rope gets caught on a hook without a classifier, and passes it with one. Writes rope.png.

The planner sees a rubber band between the grippers, the rope pulled taut (orange). The band glides
over the hook; the true rope (green) sags below it. Red spheres are where the grippers should end.
"""

import matplotlib.pyplot as plt
import numpy as np

from planners import BiasedRRT
from reliability import load_pretrained
from systems import BAND_COLOR, ROPE_COLOR, Rope, SceneRenderer

SCENE = "simple_hook"
SEED = 1

classifier = load_pretrained("rope")
# This classifier reads how far the obstacles are below the band, the space where the rope hangs.
rope = Rope(SCENE, features=classifier.provenance_["features"])

figure, axes = plt.subplots(2, 3, figsize=(14, 5.6), layout="constrained")
view = {"width": 900, "height": 660, "azimuth": 120, "elevation": -20}
with SceneRenderer(rope.scene, **view) as pictures:
    problem = rope.scene_problem()
    for row, name, system, estimator in (
        (axes[0], "Without", Rope(SCENE), None),
        (axes[1], "With", rope, classifier),
    ):
        planner = BiasedRRT(system, estimator, k=10, max_iterations=10**6, random_state=SEED)
        plan = planner.plan(system.reduce(problem.start), problem.goal)
        rollout = system.rollout(problem.start, plan.commands)
        arrived = system.succeeded(rollout.states[-1], problem.goal, tolerance=0.025)
        outcome = "passes" if arrived else "gets caught"
        print(f"{name} the classifier the rope {outcome}. {rollout.stop_reason.value}")
        moments = np.linspace(0, len(rollout.states) - 1, 4).astype(int)[1:]
        bands = system.bands(plan.reduced[moments])[:, 6:].reshape(3, -1, 3)
        for axis, moment, band in zip(row, moments, bands, strict=True):
            nodes = rollout.states[moment].nodes
            axis.imshow(pictures.render([(nodes, ROPE_COLOR), (band, BAND_COLOR)])[100:560])
            axis.set(xticks=[], yticks=[], title=f"after {moment} of {len(plan.commands)} moves")
        row[0].set_ylabel(f"{name} the classifier:\nthe rope {outcome}", fontsize=13)
figure.suptitle("Green: the true rope. Orange: the band that the planner believes. Red: the goal.")
figure.savefig("rope.png")
