"""The whole road in one file: an arm that is too weak to lift itself outstretched stands up."""

import numpy as np

from planners import BiasedRRTConnect
from reliability import TransitionReliabilityClassifier, collect_transitions
from systems import PlanarArm

N_PLANS = 300

arm = PlanarArm()
# Plan with a model that knows no torque, execute, and note which transitions came out as planned.
data = collect_transitions(arm, BiasedRRTConnect(arm), N_PLANS, n_jobs=2, random_state=0)
# Learn to tell Reliable from Unreliable transitions.
classifier = TransitionReliabilityClassifier(random_state=0)
classifier.fit(data.features(arm), data.y, groups=data.plan)
print(f"{len(data)} transitions, held-out accuracy {classifier.validation_accuracy_:.0%}")

# Plan with and without the classifier, from hanging down to standing up, and execute both plans.
hanging, standing = np.array([-np.pi / 2, 0, 0]), np.array([np.pi / 2, 0, 0])
for name, estimator in (("without", None), ("with", classifier)):
    plan = BiasedRRTConnect(arm, estimator, k=10, random_state=0).plan(hanging, standing)
    final = arm.rollout(hanging, plan.commands).states[-1]
    stands = arm.succeeded(final, standing[None], tolerance=0.1)
    print(f"{name} the classifier: {plan.status.value} Does the arm stand? {stands}")
