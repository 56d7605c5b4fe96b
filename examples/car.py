"""A car is planned for as if it could move in any direction: learn which moves it can make.

Without a classifier the car swings wide and hits a wall. With one, learned from plans that were
executed in the same scene, it drives through the gate. Writes car.png.
"""

import matplotlib.pyplot as plt
import numpy as np

from planners import BiasedRRTConnect, best_of_restarts
from reliability import FastHistGradientBoostingClassifier, learn_in_rounds
from systems import Car, Problem

N_PLANS, N_TESTS = (1000, 300), 20  # in the first round and in each later one; problems to test on
car = Car("narrow_gate")

# The first round plans without a classifier, the others with what was learned so far. They also
# accept some moves that are believed Unreliable, since wrong beliefs must come to light.
classifier = FastHistGradientBoostingClassifier(max_iter=60, class_weight="balanced")
planner = BiasedRRTConnect(car, k=np.inf, accuracy=0.9, transitions_per_edge=1)
learned = learn_in_rounds(
    classifier, planner, car, n_rounds=3, n_plans=N_PLANS, labels="plan", n_jobs=2, random_state=0
)
print(learned)


def drive(estimator, problem):
    """Plan and execute; return the planned poses, the driven states and what came of it."""
    planner = BiasedRRTConnect(car, estimator, k=np.inf, accuracy=0.9, transitions_per_edge=1)
    start, goal = problem.start, problem.goal
    # Of four plans, keep the one that is likeliest to go well.
    plan = best_of_restarts(lambda i: planner.set_params(random_state=i).plan(start[:3], goal), 4)
    states = car.trace(start, plan.commands)
    arrived = plan.success and car.succeeded(states[-1], goal, tolerance=0.3)
    stopped = car.rollout(start, plan.commands).n_completed < len(plan.commands)
    return plan.reduced, states, "arrives" if arrived else "hits a wall" if stopped else "strays"


tests = [car.sample_problem(1000 + i) for i in range(N_TESTS)]
# The start is x, y, heading, speed and steering angle; the goal is a pose.
shown = Problem(np.array([0.8, 2.0, 1.57, 0, 0]), np.array([[7.2, 1.2, -1.57]]))
figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.4), layout="constrained")
for axis, name, estimator in zip(axes, ("Without", "With"), (None, learned.estimator), strict=True):
    n_arrived = sum(drive(estimator, test)[2] == "arrives" for test in tests)
    print(f"{name} the classifier the car arrives in {n_arrived} of {N_TESTS} test problems.")
    planned, driven, outcome = drive(estimator, shown)
    for obstacle in car.scene.obstacles:
        axis.fill(*obstacle.outline.T, color="0.7")
    axis.plot(*planned[:, :2].T, "k--", label="planned")
    axis.plot(*driven[:, :2].T, color="tab:orange", linewidth=2, label="driven")
    axis.plot(*car.outline(shown.start).T, color="0.5", label="start")
    axis.plot(*car.outline(shown.goal[0]).T, "b:", label="goal")
    axis.plot(*car.outline(driven[-1]).T, color="tab:green" if outcome == "arrives" else "tab:red")
    axis.set(aspect="equal", title=f"{name} the classifier the car {outcome}")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
figure.savefig("car.png")
