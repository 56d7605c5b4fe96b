"""Plans whose outcome hangs by a hair: models that are varied a little part, and it is noticed."""

import copy
import itertools
import pickle

import numpy as np
import pytest
from test_planners import assert_same_plan
from test_restarts import plan_of
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, PlanResult, PlanStatus, SuccessCalibration
from planners.distrust import DistrustedTransitions
from planners.path import Path
from planners.plan_robustness import N_VARIANTS, plan_robustness
from systems import Box, Cylinder, Rope, Scene

START, GOAL = np.array([-0.9, 0.0]), np.array([0.9, 0.0])


class Sure:
    """Calls every transition Reliable, and is almost sure of it."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 1.0

    def predict(self, X):
        return np.ones(len(X), dtype=int)

    def predict_proba(self, X):
        return np.tile([0.001, 0.999], (len(X), 1))

    def __sklearn_is_fitted__(self):
        return True


class Ridge(Disc):
    """A ball that is pushed along a ridge at y = ridge, and rolls off it to one side.

    Where the ridge is, is known to a centimetre. In each step the ball rolls as far away from it as
    it is already, but at most 0.05. Nothing rolls where ``is_flat`` is True.
    """

    radius = 1e-6

    def __init__(self, ridge=0.0, is_flat=False):
        super().__init__(sticky=False)
        self.ridge = ridge
        self.is_flat = is_flat

    def propagate(self, reduced, command):
        off = reduced[:, 1] - self.ridge
        rolls = np.zeros_like(off) if self.is_flat else np.clip(off, -0.05, 0.05)
        return reduced + command + rolls[:, None] * [0.0, 1.0], np.ones(len(reduced), dtype=bool)

    def close(self, predicted, executed):
        return np.linalg.norm(predicted - executed, axis=1) < 0.2

    def vary(self, rng):
        variant = copy.copy(self)
        variant.ridge += 0.01 * rng.standard_normal()
        return variant


def pushed(system, y, n=12):
    commands = np.tile([0.1, 0.0], (n, 1))
    reduced = [np.array([-0.9, y])]
    for command in commands:
        reduced.append(system.propagate(reduced[-1][None], command[None])[0][0])
    return Path(np.array(reduced), commands)


@pytest.mark.parametrize(("y", "low", "high"), [(0.1, 1, 1), (-0.1, 1, 1), (0.002, 0.2, 0.8)])
def test_balls_on_the_ridge_roll_off_to_both_sides(y, low, high):
    ridge = Ridge()
    shares = [
        plan_robustness(ridge, pushed(ridge, y), np.random.default_rng(seed)) for seed in range(20)
    ]
    assert low <= np.mean(shares) <= high
    assert all(share * N_VARIANTS == round(share * N_VARIANTS) for share in shares)


def test_the_share_is_that_of_the_variants_that_stay():
    """A ball at y = d goes the other way where the ridge is moved by more than d."""
    ridge = Ridge()
    draws = np.random.default_rng(3)
    moved = [0.01 * draws.standard_normal() for _ in range(N_VARIANTS)]
    found = plan_robustness(ridge, pushed(ridge, 0.005, n=30), np.random.default_rng(3))
    assert 0 < found < 1
    assert found == np.mean(np.array(moved) < 0.005)


def test_a_variant_without_a_successor_does_not_agree():
    class Blocked(Ridge):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            return following, valid & ((self.ridge < 0) | (reduced[:, 0] < 0))

    blocked = Blocked(is_flat=True)
    draws = np.random.default_rng(0)
    open_share = np.mean([draws.standard_normal() < 0 for _ in range(N_VARIANTS)])
    path = pushed(Ridge(is_flat=True), 0.0)
    assert plan_robustness(blocked, path, np.random.default_rng(0)) == open_share


def test_without_variants_nothing_changes(tmp_path):
    """Systems that define no vary give the results, and the files, that they always gave."""
    assert plan_robustness(Disc(), pushed(Ridge(), 0.1), np.random.default_rng(0)) is None
    plan = BiasedRRT(Disc(), Sure(), random_state=0).plan(START, GOAL)
    assert plan.robustness is None
    assert plan.success_probability == plan.reliability_product
    plan.save(tmp_path / "plan.npz")
    with np.load(tmp_path / "plan.npz") as file:
        assert "robustness" not in file
    assert PlanResult.load(tmp_path / "plan.npz").robustness is None


def test_a_bad_variant_is_named():
    class Wrong(Ridge):
        def vary(self, rng):
            return "another"

    with pytest.raises(
        ValueError, match=r"Wrong\.vary must return None or a System, got 'another'"
    ):
        BiasedRRT(Wrong(is_flat=True), Sure(), random_state=0).plan(START, GOAL)


@pytest.mark.parametrize("planner", [BiasedRRT, BiasedRRTConnect])
def test_plans_are_worth_less_where_variants_part(planner, tmp_path):
    class Slope(Ridge):
        """The plan's g sees no ridge; some of its variants do."""

        def vary(self, rng):
            variant = super().vary(rng)
            variant.is_flat = bool(rng.random() < 0.5)
            return variant

    plain = planner(Disc(sticky=False), Sure(), random_state=1)
    plain.system.radius = Slope.radius
    start, goal = np.array([-0.9, 0.3]), np.array([0.9, 0.3])
    plan = planner(Slope(is_flat=True), Sure(), random_state=1).plan(start, goal)
    assert_same_plan(plan, plain.plan(start, goal))
    assert 0.2 < plan.robustness < 0.8
    assert plan.success_probability == plan.reliability_product * plan.robustness
    again = planner(Slope(is_flat=True), Sure(), random_state=1).plan(start, goal)
    assert again.robustness == plan.robustness
    plan.save(tmp_path / "plan.npz")
    assert PlanResult.load(tmp_path / "plan.npz").robustness == plan.robustness
    careful = planner(Slope(is_flat=True), Sure(), min_success=0.9, random_state=1)
    assert careful.plan(start, goal).status is PlanStatus.DISTRUSTED
    calm = planner(Ridge(is_flat=True), Sure(), min_success=0.9, random_state=1)
    assert calm.plan(start, goal).status is PlanStatus.SOLVED
    assert calm.plan(start, goal).robustness == 1.0
    without = planner(Slope(is_flat=True), random_state=1).plan(start, goal)
    assert without.robustness is None, "without an estimator plans have no probability"


def test_a_calibration_takes_robustness_as_the_probability_of_going_as_predicted(rng):
    def made(n):
        plans, went_well = [], []
        for number in range(n):
            certain = plan_of(*rng.uniform(0.5, 1, 4), seed=number)
            robustness = rng.choice([0.25, 0.5, 1.0])
            plans.append(PlanResult(**vars(certain) | {"robustness": robustness}))
            as_predicted = rng.random() < robustness
            went_well.append(as_predicted and rng.random() < certain.reliability[-1])
        return plans, np.array(went_well)

    calibration = SuccessCalibration().fit(*made(2000))
    plans, went_well = made(2000)
    probability = calibration.predict_proba(plans)[:, 1]
    robustness = np.array([plan.robustness for plan in plans])
    for share in (0.25, 0.5, 1.0):
        chosen = robustness == share
        assert abs(probability[chosen].mean() - went_well[chosen].mean()) < 0.05
    assert (probability <= robustness).all()


def test_a_system_without_distrusted_transitions_still_has_its_variants():
    ridge = Ridge()
    distrusted = DistrustedTransitions(ridge)
    distrusted.add(np.array([0.5, 0.5]), np.array([0.6, 0.5]))
    path = pushed(ridge, 0.002)
    shares = [
        plan_robustness(system, path, np.random.default_rng(0))
        for system in (ridge, distrusted.left_out_of(ridge))
    ]
    assert shares[0] == shares[1] < 1


# The rope.


def peg_scene():
    peg = Cylinder((0.0, 0.08, -0.25), 0.012, 0.2, 2, "peg")
    return Scene(
        obstacles=[Box((0.0, 0.0, -0.475), (0.9, 0.6, 0.025), "floor"), peg],
        bounds=np.array([[-0.5, -0.45, -0.45], [0.7, 0.45, 0.45]]),
        rope_length=0.8,
        start=np.array([[-0.2, 0.15, 0.3], [-0.2, -0.15, 0.3]]),
        goal=np.array([[0.5, 0.25, -0.2], [0.5, -0.25, -0.2]]),
    )


def over_the_peg(scene, height, x):
    """Drag the slack over the peg's head at a height, go down at x, and on to the goal."""
    start = scene.start.ravel()
    low, past, down = start.copy(), start.copy(), start.copy()
    low[[2, 5]] = past[[2, 5]] = height
    past[[0, 3]] = down[[0, 3]] = x
    down[[2, 5]] = -0.2
    corners = [start, low, past, down, scene.goal.ravel()]
    legs = [
        np.tile((b - a) / n, (n, 1))
        for a, b in itertools.pairwise(corners)
        for n in [int(np.ceil(np.linalg.norm(b - a) / 0.025))]
    ]
    return np.vstack(legs)


@pytest.mark.parametrize(
    ("x", "worked", "low", "high"), [(0.08, False, 0, 0.8), (0.29, True, 1, 1)]
)
def test_a_rope_that_hangs_on_the_head_of_a_peg_by_a_hair(x, worked, low, high):
    scene = peg_scene()
    rope = Rope(scene, features="clearance")
    problem, commands = rope.scene_problem(), over_the_peg(scene, 0.22, x)
    reduced = [rope.reduce(problem.start)]
    for command in commands:
        following, valid = rope.propagate(reduced[-1][None], command[None])
        assert valid[0], "g says that it works in either case"
        reduced.append(following[0])
    assert (rope.rollout(problem.start, commands).n_completed == len(commands)) == worked
    path = Path(np.array(reduced), commands)
    assert low <= plan_robustness(rope, path, np.random.default_rng(0)) <= high


def test_the_rope_s_variants_differ_in_friction_and_leave_it_as_it_is():
    rope = Rope(peg_scene(), features="clearance")
    before = pickle.dumps(rope._pbd_model.kinds)
    frictions = [
        rope.vary(np.random.default_rng(seed))._pbd_model.kinds[0, 0] for seed in range(99)
    ]
    assert len(set(frictions)) == 99
    assert 0.17 < min(frictions) < 0.2
    assert 0.65 < max(frictions) <= 0.7
    assert pickle.dumps(rope._pbd_model.kinds) == before
    assert Rope(peg_scene(), features="vector").vary(np.random.default_rng(0)) is None
