"""The scenes that the rope's models learn in, and that executions end where g forbids it."""

import numpy as np
import pytest

from benchmarks.rope.collection import (
    RopeWithoutSlackLimit,
    TrainingRope,
    TrainingScenes,
    _HardScene,
    of_bands,
)
from benchmarks.rope.training import MirroredBoosting
from planners import BiasedRRT
from reliability import (
    FastHistGradientBoostingClassifier,
    Transitions,
    compile_inference,
)
from systems import Rope, RopeStopReason, has_slot_and_slit, load_scene

SLOTTED, SIMPLE_HOOK = 28, 29


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    return TrainingScenes(tmp_path_factory.mktemp("scenes"))


@pytest.fixture(scope="module")
def rope(family):
    return family(SLOTTED)


def plan_through_mistakes(rope, seed=0):
    problem = rope.sample_problem(seed)
    planner = BiasedRRT(rope, max_iterations=4000, random_state=seed)
    return problem, planner.plan(rope.reduce(problem.start), problem.goal)


def test_half_of_the_scenes_are_simple_hook_from_starts_that_are_drawn(family):
    rope = family(SIMPLE_HOOK)
    np.testing.assert_array_equal(rope.scene.packed, load_scene("simple_hook").packed)
    starts = [rope.reduce(rope.sample_problem(seed).start) for seed in range(2)]
    assert not np.array_equal(*starts)


def test_the_others_are_random_and_hard_and_half_of_those_have_a_slot_and_a_slit(rope):
    assert has_slot_and_slit(rope.scene)
    starts = [rope.reduce(rope.sample_problem(seed).start) for seed in range(2)]
    np.testing.assert_array_equal(*starts)
    np.testing.assert_array_equal(starts[0], rope.reduce(rope.scene_problem().start))
    problem, plan = plan_through_mistakes(rope)
    rollout = rope.rollout(problem.start, plan.commands)
    completed = rollout.n_completed == len(plan.commands)
    end = rope.reduce(rollout.states[-1])[None]
    assert not (completed and rope.close(plan.reduced[-1:], end)[0])


def test_a_scene_that_was_looked_for_is_not_looked_for_again(family, rope, monkeypatch):
    monkeypatch.setattr(_HardScene, "__call__", None)
    again = TrainingScenes(family.folder)(SLOTTED)
    np.testing.assert_array_equal(again.scene.packed, rope.scene.packed)


def test_executions_end_where_the_ropes_own_g_forbids_it(rope):
    problem, plan = plan_through_mistakes(rope)
    own, lax = Rope(rope.scene, features="clearance"), RopeWithoutSlackLimit(rope.scene)
    allowed = own.propagate(plan.reduced[:-1], plan.commands)[1]
    n_allowed = int(np.argmin(np.append(allowed, False)))
    rollout = rope.rollout(problem.start, plan.commands)
    whole = lax.rollout(problem.start, plan.commands)
    assert 0 < n_allowed < len(plan.commands), "the plan overstretches a PBD rope"
    n_states = 1 + min(n_allowed, len(whole.states) - 1)
    assert len(rollout.states) == n_states
    np.testing.assert_array_equal(rollout.states[-1].nodes, whole.states[n_states - 1].nodes)
    if whole.n_completed >= n_allowed:
        assert rollout.n_completed == n_allowed
        assert rollout.stop_reason is RopeStopReason.OVERSTRETCHED


def test_a_plan_that_g_allows_is_executed_as_it_is():
    scene = load_scene("simple_hook")
    rope = TrainingRope(scene, from_scene_start=False)
    problem = rope.sample_problem(0)
    commands = np.tile([0.0, 0.0, 0.01, 0.0, 0.0, 0.01], (3, 1))
    rollouts = [one.rollout(problem.start, commands) for one in (rope, Rope(scene))]
    assert rollouts[0].n_completed == len(commands)
    assert rollouts[0].stop_reason is rollouts[1].stop_reason
    np.testing.assert_array_equal(*[one.states[-1].nodes for one in rollouts])


def test_bands_alone_are_what_other_features_see():
    rope = RopeWithoutSlackLimit(load_scene("simple_hook"))
    reduced = rope.reduce(rope.sample_problem(0).start)[None]
    command = np.array([[0.0, 0.0, 0.01, 0.0, 0.0, 0.01]])
    following = rope.propagate(reduced, command)[0]
    bands = of_bands(Transitions(reduced, command, following, [1], [7], [3]))
    vector = Rope("simple_hook", features="vector")
    expected = vector.features(rope.bands(reduced), rope.bands(following))
    np.testing.assert_array_equal(bands.features(vector), expected)
    assert (bands.y, bands.plan, bands.step) == (1, 7, 3)


def test_mirrored_boosting_becomes_a_classifier_that_files_can_hold():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(400, 496)).astype(np.float32)
    y = (X[:, 0] > 1).astype(int)
    fitted = MirroredBoosting(max_iter=5, early_stopping=False, random_state=0).fit(X, y)
    plain = fitted.as_boosting()
    assert type(plain) is FastHistGradientBoostingClassifier
    np.testing.assert_array_equal(plain.predict_proba(X), fitted.predict_proba(X))
    assert compile_inference(fitted) is not None, "planners ask it as quickly"


def test_both_labels_weigh_the_same_however_rare_one_is():
    X = np.zeros((1000, 496), dtype=np.float32)
    y = (np.arange(1000) < 50).astype(int)
    fitted = MirroredBoosting(max_iter=5, early_stopping=False, random_state=0).fit(X, y)
    np.testing.assert_allclose(fitted.predict_proba(X[:1]), 0.5, atol=0.05)
