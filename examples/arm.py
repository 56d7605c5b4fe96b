"""An arm whose first joint is too weak to hold it out straight learns to fold before it rises.

Without a classifier the plan goes straight from hanging to standing, and the arm sags back. With
one, the plan folds the arm first. Writes arm.png.
"""

import matplotlib.pyplot as plt
import numpy as np

from planners import BiasedRRTConnect
from reliability import TransitionReliabilityClassifier, collect_transitions
from systems import PlanarArm

N_PLANS = 600
N_TESTS = 20
N_POSES = 12  # shown of each motion

arm = PlanarArm()
data = collect_transitions(arm, BiasedRRTConnect(arm), N_PLANS, n_jobs=2, random_state=0)
classifier = TransitionReliabilityClassifier(random_state=0)
classifier.fit(data.features(arm), data.y, groups=data.plan)
print(f"{len(data)} transitions, {(data.y == 0).mean():.0%} of them Unreliable")

# Joint angles in radians, counter-clockwise, the first one from the horizontal.
hanging, standing = np.array([-np.pi / 2, 0, 0]), np.array([np.pi / 2, 0, 0])


def move(estimator, start, goal):
    """Plan and execute; return planned and executed joint angles, and whether the arm arrived."""
    plan = BiasedRRTConnect(arm, estimator, k=10, random_state=0).plan(start, goal)
    executed = arm.rollout(start, plan.commands).states
    return plan.reduced, executed, plan.success and arm.succeeded(executed[-1], goal, 0.1)


# Other problems: bring the tip of the arm to a point, in any of several postures.
tests = [arm.sample_reaching_problem(i) for i in range(N_TESTS)]
figure, axes = plt.subplots(1, 2, figsize=(9.5, 5.3), layout="constrained", sharey=True)
for axis, name, estimator in zip(axes, ("Without", "With"), (None, classifier), strict=True):
    n_arrived = sum(move(estimator, test.start, test.goal)[2] for test in tests)
    print(f"{name} the classifier the arm arrives in {n_arrived} of {N_TESTS} test problems.")
    planned, executed, arrived = move(estimator, hanging, standing[None])
    outcome = "the arm stands up" if arrived else "the arm sags back"
    colors = plt.get_cmap("viridis")(np.linspace(0, 0.95, N_POSES))
    shown = np.linspace(0, len(planned) - 1, N_POSES).astype(int)
    for color, *poses in zip(colors, planned[shown], executed[shown], strict=True):
        plan_pose, arm_pose = arm.joint_positions(np.array(poses))
        axis.plot(*plan_pose.T, color="0.8", linewidth=1, zorder=1)
        axis.plot(*arm_pose.T, color=color, linewidth=3, marker="o", markersize=4)
    axis.plot([], [], color="0.8", label="planned")
    axis.plot([], [], color=colors[0], linewidth=3, label="executed, at first")
    axis.plot([], [], color=colors[-1], linewidth=3, label="executed, at the end")
    axis.plot([0, 0], [0, 1.5], "r--", label="goal")
    axis.plot(0, 0, "ks", markersize=9)
    axis.set(title=f"{name} the classifier: {outcome}", aspect="equal", xlabel="x (m)")
    axis.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6))
axes[0].set_ylabel("z (m)")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig("arm.png")
