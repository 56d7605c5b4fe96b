"""Which Unreliable transitions a search accepts, by each rule, and when planners warn of k."""

import math
import warnings

import numpy as np
import pytest
from ompl import base as ob
from ompl import geometric as og
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from toy_systems import Disc, Odometer

from planners import BiasedRRT, BiasedRRTConnect, CheckTransition, PermissiveAcceptanceWarning
from reliability import collect_transitions, learn_in_rounds

N = 20_000
RULES = ("fixed", "probability", "temperature")


class Believes:
    """Says of a transition that starts at x how probably it is Reliable."""

    classes_ = np.array([0, 1])

    def __init__(self, probability):
        self.probability = probability

    def predict(self, X):
        return (self.predict_proba(X)[:, 1] > 0.5).astype(int)

    def predict_proba(self, X):
        reliable = np.broadcast_to(self.probability(X[:, 0]), len(X))
        return np.column_stack([1 - reliable, reliable])


class BelievesFast(Believes):
    """Is asked about single transitions, by OMPL's RRT-Connect."""

    def fast_decision_function(self, X):
        reliable = self.predict_proba(X)[:, 1]
        return np.log(reliable / (1 - reliable))


class NeverAskedForProbabilities(Believes):
    def predict(self, X):
        return np.zeros(len(X), dtype=int)

    def predict_proba(self, X):
        raise AssertionError("not needed")


def checker(estimator, acceptance, k=1.0, seed=0, accuracy=None):
    rng = np.random.default_rng(seed)
    return CheckTransition(
        Disc(), estimator, k=k, accuracy=accuracy, rng=rng, acceptance=acceptance
    )


def rows(x):
    reduced = np.column_stack([x, np.zeros(len(x))])
    return reduced, reduced + 0.01


def sure_of(probability):
    return Believes(lambda x: probability)


def uncertain_in_between(x):
    return np.where((x > 0.5) & (x < 0.6), 0.3, 0.9)


def assert_share(accepted, expected):
    deviation = np.sqrt(expected * (1 - expected) / len(accepted))
    assert accepted.mean() == pytest.approx(expected, abs=4 * deviation + 1e-12)


@pytest.mark.parametrize(("probability", "k"), [(0.45, 1), (0.2, 1), (0.02, 1), (0.4, 3), (0.1, 0)])
def test_by_probability_each_is_accepted_with_p_to_the_k(probability, k):
    check = checker(sure_of(probability), "probability", k)
    accepted = check(*rows(np.zeros(N)))
    assert_share(accepted, probability**k)
    assert check.n_accepted_unreliable == accepted.sum()
    assert (check.n_checked, check.n_rejected) == (N, N - accepted.sum())


def test_by_probability_each_transition_decides_for_itself():
    check = checker(Believes(lambda x: x), "probability", k=2)
    p = np.tile([0.9, 0.4, 0.05], N)
    accepted = check(*rows(p))
    assert accepted[p == 0.9].all(), "Reliable"
    for unreliable in (0.4, 0.05):
        assert_share(accepted[p == unreliable], unreliable**2)
    assert check.n_accepted_unreliable == accepted.sum() - N
    assert check.n_rejected == 3 * N - accepted.sum()


def test_the_fixed_rule_asks_for_no_probabilities():
    check = checker(NeverAskedForProbabilities(None), "fixed", k=2, accuracy=0.5)
    assert_share(check(*rows(np.zeros(N))), np.exp(-1))


@pytest.mark.parametrize("acceptance", RULES)
@pytest.mark.parametrize(("k", "share"), [(0, 1.0), (np.inf, 0.0)])
def test_the_ends_of_k_mean_all_and_none_by_every_rule(acceptance, k, share):
    check = checker(Believes(lambda x: x), acceptance, k, accuracy=0.0)
    p = np.linspace(0, 0.5, N)
    assert check(*rows(p)).mean() == share


def accepted_by_reference(p, k, numbers):
    """T-RRT's transition test, as the docstring tells it, for p <= 0.5."""
    temperature, in_a_row, accepted = 1 / k, 0, []
    for probability, number in zip(p, numbers, strict=True):
        accepted.append(number < probability ** (1 / temperature))
        in_a_row = 0 if accepted[-1] else in_a_row + 1
        if accepted[-1]:
            temperature /= 2
        elif in_a_row == 100:
            temperature, in_a_row = temperature * 2, 0
    return accepted


def test_the_temperature_doubles_after_100_rejections_in_a_row_and_halves_when_one_is_accepted():
    p = np.random.default_rng(1).uniform(0.01, 0.5, N)
    expected = accepted_by_reference(p, 5.0, np.random.default_rng(0).random(N))
    assert 10 < sum(expected) < N / 50
    at_once = checker(Believes(lambda x: x), "temperature", k=5)
    assert at_once(*rows(p)).tolist() == expected
    assert at_once.n_accepted_unreliable == sum(expected)
    by_parts = checker(Believes(lambda x: x), "temperature", k=5)
    parts = [by_parts(*rows(part)) for part in np.array_split(p, 3000)]
    assert np.concatenate(parts).tolist() == expected


def test_a_search_that_is_stuck_takes_ever_greater_risks():
    hopeless = checker(sure_of(1e-9), "temperature", k=1)
    accepted = hopeless(*rows(np.zeros(3000)))
    # exp(-20.7 / T) is 1e-9 at first; once 400 are rejected, T = 16 and it is more than a quarter.
    assert 200 < accepted.argmax() < 500
    assert accepted.any()


def test_reliable_transitions_leave_the_temperature_as_it_is():
    def answers(x):
        check = checker(Believes(lambda x: x), "temperature", k=1)
        return check(*rows(x))[x < 0.5]

    p = np.random.default_rng(1).uniform(0, 0.3, 2000)
    mixed = np.insert(p, np.arange(0, 2000, 3), 0.8)
    assert answers(mixed).tolist() == answers(p).tolist()


def test_the_temperature_never_falls_to_zero():
    """As where a threshold was moved, so that what is called Unreliable has a probability of 1."""

    class Suspicious(Believes):
        def predict(self, X):
            return np.zeros(len(X), dtype=int)

    assert checker(Suspicious(lambda x: 1.0), "temperature")(*rows(np.zeros(N))).all()


def plan(planner):
    return planner.plan([-0.9, 0.0] + [0.0] * (planner.system.reduced_dim - 2), [0.9, 0.0])


@pytest.mark.parametrize("acceptance", RULES)
@pytest.mark.parametrize(
    ("kind", "system", "estimator"),
    [
        (BiasedRRT, Odometer(), Believes(uncertain_in_between)),
        (BiasedRRTConnect, Disc(), Believes(uncertain_in_between)),
        (BiasedRRTConnect, Disc(), BelievesFast(uncertain_in_between)),
    ],
    ids=["RRT", "batched RRT-Connect", "OMPL's RRT-Connect"],
)
def test_the_same_seed_gives_the_same_plan(kind, system, estimator, acceptance):
    parameters = {"accuracy": 0.9, "acceptance": acceptance, "k": 1, "max_iterations": 2000}
    planner = kind(system, estimator, random_state=3, **parameters)
    one, same = plan(planner), plan(planner)
    np.testing.assert_array_equal(one.reduced, same.reduced)
    np.testing.assert_array_equal(one.tree, same.tree)
    counts = (one.n_checked, one.n_rejected, one.n_accepted_unreliable)
    assert counts == (same.n_checked, same.n_rejected, same.n_accepted_unreliable)
    # The goal can't be reached without an Unreliable transition.
    assert one.success
    assert one.n_accepted_unreliable >= (one.reliability < 0.5).sum() > 0
    other = plan(planner.set_params(random_state=4))
    assert not np.array_equal(one.tree, other.tree)


@pytest.mark.parametrize("acceptance", RULES)
def test_every_restart_and_every_plan_begins_at_the_same_temperature(acceptance):
    parameters = {"accuracy": 0.9, "acceptance": acceptance, "k": 2, "max_iterations": 30}
    planner = BiasedRRT(Disc(), sure_of(0.1), random_state=0, **parameters)
    assert plan(planner).n_accepted_unreliable == plan(planner).n_accepted_unreliable
    restarted = plan(planner.set_params(restarts=2))
    assert restarted.n_checked > 1.5 * plan(planner.set_params(restarts=0)).n_checked


def test_a_plan_by_ompls_door_is_that_of_plan():
    disc = Disc()
    space = ob.RealVectorStateSpace(2)
    limits = ob.RealVectorBounds(2)
    limits.setLow(-1)
    limits.setHigh(1)
    space.setBounds(limits)
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(ob.AllValidStateValidityChecker(setup.getSpaceInformation()))
    information = setup.getSpaceInformation()
    start, goal = information.allocState(), information.allocState()
    start[0:2], goal[0:2] = [-0.9, 0.0], [0.9, 0.0]
    setup.setStartAndGoalStates(start, goal)
    planner = BiasedRRTConnect(
        disc, Believes(uncertain_in_between), k=3, acceptance="temperature", random_state=0
    )
    door = planner.ompl_planner(information)
    setup.setPlanner(door)
    assert setup.solve(20.0).getStatus() == ob.PlannerStatus.EXACT_SOLUTION
    np.testing.assert_array_equal(door.result.reduced, plan(planner).reduced)


def disc_data():
    data = collect_transitions(Disc(), BiasedRRTConnect(Disc()), 60, random_state=0)
    return data.features(Disc()), data.y


@pytest.mark.parametrize("acceptance", ["probability", "temperature"])
def test_an_estimator_without_probabilities_is_refused(acceptance):
    estimator = RidgeClassifier().fit(*disc_data())
    planner = BiasedRRT(Disc(), estimator, acceptance=acceptance)
    message = (
        f"acceptance='{acceptance}' needs an estimator with predict_proba, and RidgeClassifier"
    )
    with pytest.raises(ValueError, match=message):
        plan(planner)
    assert plan(planner.set_params(acceptance="fixed", k=10, accuracy=0.9)).success


def test_only_the_fixed_rule_needs_p_acc():
    estimator = LogisticRegression().fit(*disc_data())
    for acceptance in ("probability", "temperature"):
        assert plan(BiasedRRT(Disc(), estimator, acceptance=acceptance, random_state=0)).success
    with pytest.raises(ValueError, match=r"accuracy \(p_acc\) is not known"):
        plan(BiasedRRT(Disc(), estimator))


@pytest.mark.parametrize("estimator", [None, sure_of(0.9)])
@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"acceptance": "warm"}, "must be one of fixed, probability, temperature, got 'warm'"),
        ({"acceptance": None}, "must be one of fixed, probability, temperature, got None"),
        ({"acceptance": "temperature", "k": -1}, "k must be a number between 0 and inf, got -1"),
        ({"acceptance": "probability", "accuracy": 2}, "accuracy must be a number between 0 and 1"),
    ],
)
def test_bad_parameters_are_refused(estimator, parameters, message):
    with pytest.raises(ValueError, match=message):
        plan(BiasedRRT(Disc(), estimator, **parameters))


def shown(make):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
    return [w for w in caught if issubclass(w.category, PermissiveAcceptanceWarning)]


def test_a_permissive_k_is_told_once_with_figures_and_a_remedy():
    estimator = LogisticRegression().fit(*disc_data())  # which changes warning filters when asked

    def make():
        for i in range(3):
            plan(BiasedRRT(Disc(), estimator, accuracy=0.87, random_state=i))

    (warning,) = shown(make)
    assert "k=1 with p_acc 0.87 accepts 42 % of the transitions" in str(warning.message)
    assert "k=10 accepts 0.017 %" in str(warning.message)
    assert warning.filename == __file__, "where plan is called"
    assert not shown(make)
    (other,) = shown(lambda: plan(BiasedRRT(Disc(), estimator, k=2, accuracy=0.87)))
    assert "k=2 with p_acc 0.87 accepts 18 %" in str(other.message)


def test_where_no_usual_k_is_strict_the_remedy_is_an_infinite_one():
    (warning,) = shown(lambda: plan(BiasedRRT(Disc(), sure_of(0.9), k=1.01, accuracy=0.2)))
    assert "k=inf accepts 0 %" in str(warning.message)


@pytest.mark.parametrize(
    ("estimator", "parameters"),
    [
        (None, {}),
        (sure_of(0.9), {"k": -math.log(0.0999), "accuracy": 1.0}),
        (sure_of(0.9), {"acceptance": "probability"}),
        (sure_of(0.9), {"acceptance": "temperature"}),
    ],
)
def test_nothing_is_told_where_few_are_accepted_or_by_another_rule(estimator, parameters):
    assert not shown(lambda: plan(BiasedRRT(Disc(), estimator, **parameters)))


@pytest.mark.parametrize("acceptance", ["probability", "temperature"])
def test_rounds_explore_by_the_planners_rule(acceptance):
    def learned(acceptance):
        return learn_in_rounds(
            LogisticRegression(),
            BiasedRRTConnect(Disc(), accuracy=0.9, acceptance=acceptance, max_iterations=500),
            Disc(),
            n_rounds=2,
            n_plans=20,
            exploring_k=2,
            random_state=0,
        )

    result, again, fixed = (learned(rule) for rule in (acceptance, acceptance, "fixed"))
    np.testing.assert_array_equal(result.transitions.reduced, again.transitions.reduced)
    first = [one.transitions[one.round == 0].reduced for one in (result, fixed)]
    np.testing.assert_array_equal(*first, "without an estimator rules are all the same")
    assert not np.array_equal(result.transitions.reduced, fixed.transitions.reduced)


def test_nothing_is_told_where_exploring_is_meant():
    estimator, template = LogisticRegression(), BiasedRRT(Disc(), accuracy=0.77)

    def explore():
        learn_in_rounds(
            estimator, template, Disc(), n_rounds=2, n_plans=20, exploring_k=0.5, random_state=0
        )
        asked = BiasedRRT(Disc(), estimator.fit(*disc_data()), accuracy=0.77)
        collect_transitions(Disc(), asked, 3, random_state=0)

    assert not shown(explore)
    assert shown(lambda: plan(BiasedRRT(Disc(), estimator, accuracy=0.77)))
