"""What a plan is worth: calibrated probabilities, thresholds with a guarantee, distrust."""

import io
import pickle
from dataclasses import replace
from types import SimpleNamespace

import joblib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from scipy.special import expit
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from sklearn.preprocessing import StandardScaler
from test_planners import HalfPlane, assert_same_plan
from test_restarts import plan_of
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, PlanResult, PlanStatus, SuccessCalibration
from planners.plan_turning import plan_turning

PLANNERS = [BiasedRRTConnect, BiasedRRT]
START, GOAL = np.array([-0.9, 0.0]), np.array([0.9, 0.0])


def costs_of(plan):
    return np.log(1e-4 - np.log(plan.reliability))


def random_plans(rng, n, *, offset=2.5):
    """Plans that succeed as a known logistic of their last and worst transitions says."""
    plans = []
    for number in range(n):
        size = rng.integers(2, 12)
        plans.append(plan_of(*expit(rng.normal(2, 2.5, size)), seed=number))
    worst, last = (
        np.array([pick(costs_of(plan)) for plan in plans]) for pick in (max, lambda c: c[-1])
    )
    truth = expit(offset - 1.5 * worst - 2.5 * last)
    return plans, truth, rng.random(n) < truth


def calibration_error(truth, probability):
    """Weigh each tenth's gap between the mean probability and the mean of what was expected."""
    tenths = np.minimum((10 * probability).astype(int), 9)
    gaps = [(truth - probability)[tenths == tenth].sum() for tenth in range(10)]
    return np.abs(gaps).sum() / len(truth)


def test_it_finds_the_logistic_that_plans_were_drawn_from(rng):
    plans, _, succeeded = random_plans(rng, 1500)
    unseen, truth, outcomes = random_plans(rng, 1500)
    probability = SuccessCalibration().fit(plans, succeeded).predict_proba(unseen)[:, 1]
    product = np.array([plan.reliability_product for plan in unseen])
    assert calibration_error(truth, probability) < 0.03
    assert calibration_error(truth, product) > 0.1, "what it has to mend"
    assert roc_auc_score(outcomes, probability) > roc_auc_score(outcomes, product)
    assert roc_auc_score(outcomes, probability) > roc_auc_score(outcomes, truth) - 0.01


def test_it_is_logistic_regression_on_sum_length_worst_and_last(rng):
    plans, _, succeeded = random_plans(rng, 200)
    rows = []
    for plan in plans:
        costs = -np.log(plan.reliability)
        total, worst, last = np.log([1e-4 + costs.sum(), 1e-4 + costs.max(), 1e-4 + costs[-1]])
        rows.append([total, len(costs), worst, last])
    X = StandardScaler().fit_transform(rows)
    expected = LogisticRegression().fit(X, succeeded).predict_proba(X)
    calibration = SuccessCalibration().fit(plans, succeeded)
    np.testing.assert_allclose(calibration.predict_proba(plans), expected)
    assert_array_equal(calibration.classes_, [False, True])


def test_it_learns_from_turning_what_no_transition_tells(rng):
    def turning_plans(n):
        turning = rng.uniform(0, 10, n)
        plans = [replace(plan_of(0.9, 0.9), turning=float(value)) for value in turning]
        return plans, rng.random(n) < expit(5 - turning)

    calibration = SuccessCalibration().fit(*turning_plans(400))
    unseen, outcomes = turning_plans(400)
    assert roc_auc_score(outcomes, calibration.predict_proba(unseen)[:, 1]) > 0.9


@pytest.mark.parametrize(
    ("points", "turning"),
    [
        ([[0, 0], [1, 0], [2, 0]], 0),
        ([[0, 0], [1, 0], [1, 1], [1, 2]], np.sqrt(2)),
        ([[0, 0], [1, 0], [0, 0], [1, 0]], 4),
        ([[0, 0], [1, 0], [1.5, 0]], 0.5),
        ([[0, 0]], 0),
    ],
)
def test_turning_is_counted_in_steps(points, turning):
    disc = Disc()
    reduced = disc.step_size * np.array(points, dtype=float)
    assert plan_turning(disc, reduced) == pytest.approx(turning)


def test_turning_goes_the_short_way_around_and_looks_at_configurations_only():
    turner = SimpleNamespace(configuration_dim=1, angular=(0,), step_size=0.1)
    reduced = np.array([[3.1, 7.0], [3.2 - 2 * np.pi, -9.0], [3.3 - 2 * np.pi, 2.0]])
    assert plan_turning(turner, reduced) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("planner", PLANNERS)
def test_planners_tell_the_turning_of_their_plans(planner, tmp_path):
    plan = planner(Disc(), Doubtful(), random_state=0, simplify=False).plan(START, GOAL)
    assert plan.turning == plan_turning(Disc(), plan.reduced) > 0
    plan.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz").turning == plan.turning


reliabilities = st.lists(st.floats(0, 1), max_size=8)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.lists(reliabilities, min_size=2, max_size=20), st.data())
def test_any_plans_have_a_probability(many, data):
    plans = [plan_of(*reliability) for reliability in many]
    outcomes = data.draw(st.permutations([True, False] * len(plans)))[: len(plans)]
    outcomes[0] = not outcomes[1]
    calibration = SuccessCalibration().fit(plans, outcomes)
    probability = calibration.predict_proba(plans)
    assert ((probability >= 0) & (probability <= 1)).all()
    np.testing.assert_allclose(probability.sum(axis=1), 1)
    alone = [calibration.predict_proba([plan])[0, 1] for plan in plans]
    np.testing.assert_allclose(alone, probability[:, 1])


def test_no_plan_does_not_succeed(rng):
    plans, _, succeeded = random_plans(rng, 50)
    failed = plan_of(status=PlanStatus.TIME_LIMIT)
    probability = SuccessCalibration().fit(plans, succeeded).predict_proba([failed, plans[0]])
    assert_array_equal(probability[0], [1, 0])
    assert 0 < probability[1, 1] < 1


def without_reliability():
    plan = BiasedRRT(Disc(), random_state=0).plan(START, GOAL)
    return [plan, plan_of(0.5)]


@pytest.mark.parametrize(
    ("results", "succeeded", "message"),
    [
        ([], [], "results must hold at least one plan, got none"),
        ([plan_of(0.5)] * 2, [True, True], "2 plans of which all did. Execute more plans"),
        ([plan_of(0.5)] * 2, [0, 0], "2 plans of which none did"),
        ([plan_of(0.5)] * 2, [True], "True or False for each of 2 results"),
        ([plan_of(0.5)] * 2, [0.5, 1], "True or False for each of 2 results"),
        (plan_of(0.5), [True], "results must be a sequence of PlanResult"),
        ([plan_of(0.5), 0.3], [True, False], "results must be a sequence of PlanResult"),
        (without_reliability(), [True, False], r"results\[0\] has none, since it was planned"),
        (
            [plan_of(0.5), plan_of(status=PlanStatus.ITERATION_LIMIT)],
            [True, False],
            r"results\[1\] is none \(ITERATION_LIMIT\)",
        ),
    ],
)
def test_unfit_plans_are_refused(results, succeeded, message):
    with pytest.raises(ValueError, match=message):
        SuccessCalibration().fit(results, succeeded)


def test_it_must_be_fitted():
    for use in (
        lambda: SuccessCalibration().predict_proba([plan_of(0.5)]),
        lambda: SuccessCalibration().min_success_for([plan_of(0.5)], [True]),
        lambda: BiasedRRT(Disc(), HalfPlane(), calibration=SuccessCalibration()).plan(START, GOAL),
    ):
        with pytest.raises(NotFittedError):
            use()


def test_it_is_saved_and_loaded(rng, tmp_path):
    plans, _, succeeded = random_plans(rng, 60)
    calibration = SuccessCalibration().fit(plans, succeeded)
    joblib.dump(calibration, tmp_path / "calibration.joblib")
    again = joblib.load(tmp_path / "calibration.joblib")
    assert_array_equal(again.predict_proba(plans), calibration.predict_proba(plans))
    assert not hasattr(clone(calibration), "model_")


# The guarantee.


class Known(SuccessCalibration):
    """Knows the probability of success of plans of one transition, right or wrong."""

    def _probability(self, results):
        return np.array([plan.reliability[0] for plan in results])


def known(rng, n, truth_of):
    probability = rng.random(n)
    return [plan_of(p) for p in probability], rng.random(n) < truth_of(probability)


@pytest.mark.parametrize(
    ("share", "truth_of", "least_returned"),
    [
        (0.9, lambda p: p**0.3, 20),
        (0.8, lambda p: p**0.5, 80),
        (0.8, lambda p: p, 50),
        # The likelier a plan is said to be, the more often it fails.
        (0.7, lambda p: 1 - 0.7 * p, 0),
        # Every threshold breaks the promise, by little.
        (0.6, lambda p: np.full_like(p, 0.595), 0),
    ],
)
def test_the_guarantee_holds(share, truth_of, least_returned):
    """Of 200 repetitions about 5 % at most may return a threshold that breaks the promise."""
    calibration = Known().fit(*known(np.random.default_rng(1), 300, truth_of))
    grid = np.linspace(0, 1, 10_001)
    n_broken = n_returned = 0
    for seed in range(200):
        plans, succeeded = known(np.random.default_rng([2, seed]), 150, truth_of)
        try:
            level = calibration.min_success_for(plans, succeeded, share)
        except ValueError:
            continue
        n_returned += 1
        n_broken += truth_of(grid[grid >= level]).mean() < share
    # The 99.9 % quantile of a binomial distribution of 200 draws and probability 0.05.
    assert n_broken <= 20
    assert n_returned >= least_returned


def test_the_threshold_is_about_the_smallest_that_keeps_the_promise(rng):
    calibration = Known().fit(*known(rng, 1000, lambda p: p))
    plans, succeeded = known(rng, 20_000, lambda p: p)
    # Of plans of at least the probability t, (1 + t) / 2 succeed; levels are a twentieth apart.
    assert 0.6 < calibration.min_success_for(plans, succeeded, 0.8) < 0.71
    assert calibration.min_success_for(plans, succeeded, 0.3) == 0.0
    loose, strict = (
        calibration.min_success_for(plans[:500], succeeded[:500], 0.6, confidence=confidence)
        for confidence in (0.6, 0.999)
    )
    assert loose < strict


def test_what_can_not_be_guaranteed_is_said(rng):
    plans, succeeded = known(rng, 200, lambda p: p)
    calibration = Known().fit(plans, succeeded)
    for few in (1, 10):
        with pytest.raises(ValueError, match="No min_success can be guaranteed: of the"):
            calibration.min_success_for(plans[:few], succeeded[:few], 0.9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"share": 0}, "share must be between 0 and 1, both excluded, got 0"),
        ({"share": "most"}, "share must be a number between"),
        ({"confidence": 1.0}, "confidence must be between 0 and 1, both excluded"),
    ],
)
def test_bad_shares_are_refused(rng, arguments, message):
    plans, succeeded = known(rng, 50, lambda p: p)
    with pytest.raises(ValueError, match=message):
        Known().fit(plans, succeeded).min_success_for(plans, succeeded, **arguments)


# In planners.


class Doubtful(HalfPlane):
    """Calls all transitions Reliable, those further up less probably so."""

    def predict(self, X):
        return np.ones(len(X), dtype=int)

    def predict_proba(self, X):
        reliable = expit(3 - 2 * X[:, 1])
        return np.column_stack([1 - reliable, reliable])


@pytest.fixture(scope="module")
def calibration():
    # Plans of the disc world pass above or below the disc.
    plans = [BiasedRRT(Disc(), Doubtful(), random_state=i).plan(START, GOAL) for i in range(30)]
    below = [plan.reduced[:, 1].min() < -0.3 for plan in plans]
    return SuccessCalibration().fit(plans, below)


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_calibration_changes_what_a_plan_is_worth_and_not_the_plan(
    planner, calibration, tmp_path
):
    raw = planner(Disc(), Doubtful(), random_state=0).plan(START, GOAL)
    assert raw.calibrated_probability is None
    assert raw.success_probability == raw.reliability_product == np.prod(raw.reliability)
    plan = planner(Disc(), Doubtful(), calibration=calibration, random_state=0).plan(START, GOAL)
    assert_same_plan(plan, raw)
    assert plan.success_probability == plan.calibrated_probability
    assert plan.success_probability == calibration.predict_proba([raw])[0, 1]
    assert plan.reliability_product == raw.reliability_product
    plan.save(tmp_path / "plan.npz")
    again = PlanResult.load(tmp_path / "plan.npz")
    assert_same_plan(again, plan)
    assert again.calibrated_probability == plan.calibrated_probability
    assert again.reliability_product == plan.reliability_product


@pytest.mark.parametrize("planner", PLANNERS)
def test_an_unlikely_plan_is_distrusted_and_attached(planner, calibration, tmp_path):
    parameters = {"calibration": calibration, "random_state": 0}
    plan = planner(Disc(), Doubtful(), **parameters).plan(START, GOAL)
    worth = plan.success_probability
    exact = planner(Disc(), Doubtful(), min_success=worth, **parameters).plan(START, GOAL)
    assert exact.status is PlanStatus.SOLVED
    distrusted = planner(Disc(), Doubtful(), min_success=np.nextafter(worth, 1), **parameters).plan(
        START, GOAL
    )
    assert distrusted.status is PlanStatus.DISTRUSTED
    assert not distrusted.success
    assert distrusted.solved
    assert "Raise restarts" in distrusted.status.value
    assert_array_equal(distrusted.reduced, plan.reduced)
    assert_array_equal(distrusted.commands, plan.commands)
    assert distrusted.success_probability == worth
    distrusted.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz").status is PlanStatus.DISTRUSTED


def test_min_success_works_on_the_product_too():
    plan = BiasedRRT(Disc(), Doubtful(), random_state=0).plan(START, GOAL)
    careful = BiasedRRT(Disc(), Doubtful(), min_success=0.99, random_state=0).plan(START, GOAL)
    assert plan.success
    assert careful.status is PlanStatus.DISTRUSTED


@pytest.mark.parametrize("planner", PLANNERS)
def test_restarts_end_with_the_first_plan_that_is_good_enough(planner, calibration):
    def plan(seed=None, **parameters):
        seed = unlucky if seed is None else seed
        made = planner(
            Disc(), Doubtful(), calibration=calibration, random_state=seed, **parameters
        ).plan(START, GOAL)
        assert made.random_state == seed, "the seed that gives this again"
        return made

    unlucky = next(seed for seed in range(100) if plan(seed).success_probability < 0.5)

    # Nothing is good enough for 1, so that the best of so many plans comes back.
    best = [plan(min_success=1.0, restarts=n) for n in range(7)]
    worth = [made.success_probability for made in best]
    assert all(made.status is PlanStatus.DISTRUSTED for made in best)
    assert worth == sorted(worth)
    checked = [made.n_checked for made in best]
    assert (np.diff(checked) > 0).all(), "counts add up"
    assert (np.diff([made.planning_time for made in best]) > 0).any()
    assert len(set(worth)) > 1, "other seeds make other plans"
    first = worth.index(worth[-1])
    enough = plan(min_success=worth[-1], restarts=10**6)
    assert enough.success
    assert enough.n_checked == checked[first], "it stops early"
    assert_array_equal(enough.reduced, best[first].reduced)
    assert_array_equal(plan().reduced, best[0].reduced)
    likeliest = plan(restarts=6)
    assert likeliest.success, "the best of all, which nothing is asked of"
    assert_array_equal(likeliest.reduced, best[-1].reduced)
    assert likeliest.n_checked == checked[-1]


def test_restarts_also_help_where_there_is_no_plan():
    def solved(**parameters):
        planner = BiasedRRTConnect(Disc(), HalfPlane(), k=1.0, max_iterations=20, **parameters)
        return [planner.set_params(random_state=i).plan(START, GOAL).success for i in range(20)]

    once, again = solved(), solved(restarts=5)
    assert sum(once) < sum(again)
    assert all(later >= earlier for earlier, later in zip(once, again, strict=True))


def test_a_time_limit_is_for_all_restarts_together(calibration):
    careful = BiasedRRT(
        Disc(),
        Doubtful(),
        calibration=calibration,
        min_success=1.0,
        restarts=10**9,
        time_limit=0.2,
        random_state=0,
    )
    plan = careful.plan(START, GOAL)
    assert plan.status is PlanStatus.DISTRUSTED
    assert plan.n_checked > 0


def test_planners_with_a_calibration_pickle(calibration):
    planner = BiasedRRT(
        Disc(), Doubtful(), calibration=calibration, min_success=0.6, restarts=2, random_state=1
    )
    stream = io.BytesIO(pickle.dumps(planner))
    assert_same_plan(pickle.load(stream).plan(START, GOAL), planner.plan(START, GOAL))
    assert planner.get_params(deep=False)["calibration"] is calibration


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"min_success": 1.5}, "min_success must be a number between 0 and 1, got 1.5"),
        ({"min_success": None}, "min_success must be a number"),
        ({"restarts": -1}, "restarts must be 0 or a positive integer, got -1"),
        ({"restarts": 1.5}, "restarts must be 0 or a positive integer"),
        ({"restarts": True}, "restarts must be 0 or a positive integer"),
        ({"calibration": LogisticRegression()}, "calibration must be None or a SuccessCalibr"),
        ({"estimator": None, "min_success": 0.5}, "need an estimator: without one"),
    ],
)
def test_bad_parameters_are_refused(parameters, message):
    planner = BiasedRRT(**{"system": Disc(), "estimator": Doubtful()} | parameters)
    with pytest.raises(ValueError, match=message):
        planner.plan(START, GOAL)


def test_a_calibration_needs_an_estimator(calibration):
    with pytest.raises(ValueError, match="calibration and min_success need an estimator"):
        BiasedRRT(Disc(), calibration=calibration).plan(START, GOAL)
