"""Any scikit-learn classifier can steer a planner; this compares a few on the paper's arm."""

import numpy as np
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupShuffleSplit
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from planners import BiasedRRTConnect
from reliability import (
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    collect_transitions,
)
from systems import PlanarArm

N_PLANS = 200
N_PROBLEMS = 20

network = TransitionReliabilityClassifier(max_epochs=10, random_state=0)
ESTIMATORS = {
    "no classifier": None,
    "logistic regression": make_pipeline(StandardScaler(), LogisticRegression()),
    "random forest": RandomForestClassifier(50, max_depth=12, random_state=0),
    "boosted trees": FastHistGradientBoostingClassifier(max_iter=60, random_state=0),
    "network": network,
    "calibrated network": CalibratedClassifierCV(network, cv=2),
}

arm = PlanarArm()
data = collect_transitions(arm, BiasedRRTConnect(arm), N_PLANS, n_jobs=2, random_state=0)
X, y = data.features(arm), data.y
# The planner wants to know how accurate an estimator is on plans that it has not seen.
train, test = next(GroupShuffleSplit(test_size=0.2, random_state=0).split(X, y, data.plan))

print(f"{'':20s} accuracy  solved  arrived  ms per plan")
for name, estimator in ESTIMATORS.items():
    accuracy = None
    if estimator is not None:
        accuracy = estimator.fit(X[train], y[train]).score(X[test], y[test])
    n_solved, n_arrived, seconds = 0, 0, []
    for i in range(N_PROBLEMS):
        problem = arm.sample_reaching_problem(i)
        planner = BiasedRRTConnect(arm, estimator, k=10, accuracy=accuracy, random_state=i)
        plan = planner.plan(problem.start, problem.goal)
        final = arm.rollout(problem.start, plan.commands).states[-1]
        n_solved += plan.success
        n_arrived += plan.success and arm.succeeded(final, problem.goal, tolerance=0.1)
        seconds.append(plan.planning_time + plan.simplification_time)
    shown = "" if accuracy is None else f"{accuracy:.1%}"
    print(f"{name:20s} {shown:>8s} {n_solved:7d} {n_arrived:8d} {1e3 * np.median(seconds):12.1f}")
