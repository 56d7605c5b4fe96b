"""Planners take whatever scikit-learn users have."""

import joblib
import numpy as np
import pytest
from sklearn.calibration import CalibratedClassifierCV
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.linear_model import LogisticRegression, SGDClassifier
from sklearn.model_selection import FixedThresholdClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier
from test_planners import assert_same_plan, assert_sound
from threadpoolctl import threadpool_info, threadpool_limits
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect
from reliability import MLP, TransitionReliabilityClassifier

START, GOAL = np.array([-0.9, -0.1]), np.array([0.2, 0.6])
OURS = TransitionReliabilityClassifier(MLP((32, 16)), max_epochs=20, random_state=0)
ESTIMATORS = {
    "ours": OURS,
    "forest": RandomForestClassifier(20, random_state=0),
    "pipeline": make_pipeline(StandardScaler(), LogisticRegression()),
    "ours in a pipeline": make_pipeline(StandardScaler(), OURS),
    "calibrated": CalibratedClassifierCV(DecisionTreeClassifier(max_depth=5), cv=3),
    "threshold": FixedThresholdClassifier(
        CalibratedClassifierCV(HistGradientBoostingClassifier(max_iter=20), cv=2), threshold=0.6
    ),
    "without probabilities": SGDClassifier(random_state=0),
}


@pytest.fixture(scope="module", params=ESTIMATORS)
def estimator(request, disc_data):
    X, y, _ = disc_data
    return ESTIMATORS[request.param].fit(X, y)


@pytest.mark.parametrize("planner", [BiasedRRTConnect, BiasedRRT])
def test_plans_use_what_the_estimator_trusts(planner, estimator):
    system = Disc()
    for seed in range(3):
        result = planner(system, estimator, k=np.inf, accuracy=0.9, random_state=seed).plan(
            START, GOAL
        )
        assert_sound(system, result, START, GOAL)
        rows = system.features(result.reduced[:-1], result.reduced[1:])
        assert (estimator.predict(rows) == 1).all()
        if hasattr(estimator, "predict_proba"):
            expected = estimator.predict_proba(rows)[:, 1]
            np.testing.assert_allclose(result.reliability, expected)
        assert result.n_accepted_unreliable == 0
        assert result.n_checked >= len(result.commands)


class Onlooker(DummyClassifier):
    """Notes how many threads OpenMP may use whenever it is asked."""

    seen = ()

    def predict(self, X):
        threads = [pool["num_threads"] for pool in openmp_pools()]
        self.seen = (*self.seen, *threads)
        return super().predict(X)


def openmp_pools():
    return [pool for pool in threadpool_info() if pool["user_api"] == "openmp"]


@pytest.mark.parametrize("planner", [BiasedRRTConnect, BiasedRRT])
def test_few_rows_are_not_shared_out_among_threads(planner, disc_data):
    X, y, _ = disc_data
    onlooker = Onlooker(strategy="constant", constant=1).fit(X, y)
    with threadpool_limits(2, user_api="openmp"):
        before = openmp_pools()
        planner(Disc(), onlooker, accuracy=0.9, random_state=0).plan(START, GOAL)
        assert openmp_pools() == before
    assert before
    assert set(onlooker.seen) == {1}


@pytest.mark.parametrize("planner", [BiasedRRTConnect, BiasedRRT])
def test_string_labels(planner, disc_data):
    X, y, _ = disc_data
    names = np.where(y == 1, "Reliable", "Unreliable")
    by_name = LogisticRegression().fit(X, names)
    by_number = LogisticRegression().fit(X, y)
    parameters = {"accuracy": 0.9, "k": 3, "random_state": 0}
    assert_same_plan(
        planner(Disc(), by_name, **parameters).plan(START, GOAL),
        planner(Disc(), by_number, **parameters).plan(START, GOAL),
    )


@pytest.mark.parametrize("planner", [BiasedRRTConnect, BiasedRRT])
def test_a_single_class(planner, disc_data):
    X, _, _ = disc_data
    trusting = DummyClassifier().fit(X, np.ones(len(X), dtype=int))
    result = planner(Disc(), trusting, accuracy=1.0, random_state=0).plan(START, GOAL)
    assert result.success
    assert (result.reliability == 1).all()
    distrusting = DummyClassifier().fit(X, np.zeros(len(X), dtype=int))
    strict = planner(Disc(), distrusting, k=np.inf, accuracy=1.0, max_iterations=200)
    assert not strict.plan(START, GOAL).success
    lenient = planner(Disc(), distrusting, k=0.1, accuracy=1.0, random_state=0)
    result = lenient.plan(START, GOAL)
    assert result.success
    assert (result.reliability == 0).all()
    with pytest.warns(UserWarning, match="all of one class"):
        ours = TransitionReliabilityClassifier(random_state=0).fit(X, np.zeros(len(X), dtype=int))
    assert not planner(Disc(), ours, k=np.inf, max_iterations=200).plan(START, GOAL).success


@pytest.mark.parametrize("planner", [BiasedRRTConnect, BiasedRRT])
def test_loaded_by_joblib(planner, estimator, tmp_path):
    joblib.dump(estimator, tmp_path / "model.joblib")
    loaded = joblib.load(tmp_path / "model.joblib")
    parameters = {"accuracy": 0.9, "k": 3, "random_state": 0}
    assert_same_plan(
        planner(Disc(), loaded, **parameters).plan(START, GOAL),
        planner(Disc(), estimator, **parameters).plan(START, GOAL),
    )


def test_the_fast_path_and_the_batches_plan_equally_well(arm, arm_classifier):
    class Opaque:
        classes_ = arm_classifier.classes_

        def predict(self, X):
            return arm_classifier.predict(X)

    solved = {"fast": 0, "opaque": 0}
    for seed in range(15):
        problem = arm.sample_reaching_problem(np.random.SeedSequence([99, seed]))
        for name, model in (("fast", arm_classifier), ("opaque", Opaque())):
            planner = BiasedRRTConnect(arm, model, accuracy=0.95, random_state=seed)
            result = planner.plan(problem.start, problem.goal)
            assert_sound(arm, result, problem.start, problem.goal)
            final = arm.rollout(problem.start, result.commands).states[-1]
            solved[name] += arm.succeeded(final, problem.goal, 0.1)
    assert min(solved.values()) >= 12
