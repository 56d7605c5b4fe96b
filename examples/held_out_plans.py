"""Searching parameters and measuring accuracy on plans that the classifier has not seen.

Transitions of one plan are alike. Split by rows, a classifier is tested on what it has nearly seen,
and seems to be right more often than it is on new plans. So data are split by plan: the plans' ids
are what scikit-learn calls ``groups``.
"""

import sklearn
from sklearn.model_selection import GridSearchCV, GroupKFold, KFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from planners import BiasedRRTConnect
from reliability import (
    MLP,
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    collect_transitions,
)
from systems import PlanarArm

N_PLANS = 100

arm = PlanarArm()
data = collect_transitions(arm, BiasedRRTConnect(arm), N_PLANS, n_jobs=2, random_state=0)
X, y, plan = data.features(arm), data.y, data.plan

by_rows, by_plans = KFold(3, shuffle=True, random_state=0), GroupKFold(3)
trees = FastHistGradientBoostingClassifier(max_iter=30, random_state=0)
for name, split, groups in (("rows", by_rows, None), ("plans", by_plans, plan)):
    accuracy = cross_val_score(trees, X, y, groups=groups, cv=split).mean()
    print(f"boosted trees, split by {name}: {accuracy:.1%} right")

# The network holds out plans of its own as well, to know when to stop. With metadata routing, the
# ids go to the splits and, as it asks for them, to its fit, through the pipeline and the search.
sklearn.set_config(enable_metadata_routing=True)
network = TransitionReliabilityClassifier(max_epochs=4, random_state=0)
network.set_fit_request(groups=True)
search = GridSearchCV(
    make_pipeline(StandardScaler(), network),
    {"transitionreliabilityclassifier__backend": [MLP((32,)), MLP((128, 64))]},
    cv=by_plans,
)
search.fit(X, y, groups=plan)
(layers,) = search.best_params_.values()
print(f"network, split by plans: {search.best_score_:.1%} right with the layers {layers}")
