"""What features are called: by systems, in tables, in warnings, and when estimators are asked."""

import warnings

import numpy as np
import pandas as pd
import pytest
from labelled_tables import Table, executed_steps, table
from sklearn.compose import ColumnTransformer, make_column_selector, make_column_transformer
from sklearn.dummy import DummyClassifier
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from toy_systems import Disc, Odometer

from examples.own_systems.suspended_load import SuspendedLoad
from examples.own_systems.tractor_trailer import TractorTrailer
from planners import BiasedRRT, BiasedRRTConnect, CheckTransition
from reliability import (
    TransitionReliabilityClassifier,
    collect_transitions,
    compare_features,
    compile_inference,
    diagnose,
    learn_in_rounds,
)
from systems import Car, PlanarArm, Rope, System, SystemContractError, check_system

NAMES = ("x", "y", "east", "north")


class NamedDisc(Disc):
    feature_names_out = NAMES


class PlainDisc(Disc):
    """Has the default features, and an angle."""

    angular = (1,)
    features = System.features


@pytest.fixture(scope="module")
def data():
    disc = Disc()
    planner = BiasedRRTConnect(disc, max_iterations=2000)
    return collect_transitions(disc, planner, 60, labels="executed", random_state=0)


@pytest.fixture
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def steps(n=40, seed=0):
    rng = np.random.default_rng(seed)
    reduced = rng.uniform(-1, 1, size=(n, 2))
    return reduced, reduced + rng.uniform(-0.07, 0.07, size=(n, 2))


def checker(estimator, system):
    rng = np.random.default_rng(0)
    return CheckTransition(system, estimator, k=np.inf, accuracy=0.9, rng=rng)


# What systems call their features


def columns(system, reduced, next_reduced):
    X = system.features(reduced, next_reduced)
    assert X.shape[1] == len(system.feature_names_out) == len(set(system.feature_names_out))
    return dict(zip(system.feature_names_out, X.T, strict=True))


def test_default_features_have_names():
    system = PlainDisc()
    before, after = steps()
    found = columns(system, before, after)
    assert list(found) == ["q0", "sin_q1", "cos_q1", "change_of_q0", "change_of_q1"]
    np.testing.assert_allclose(found["q0"], before[:, 0])
    np.testing.assert_allclose(found["sin_q1"], np.sin(before[:, 1]))
    np.testing.assert_allclose(found["cos_q1"], np.cos(before[:, 1]))
    np.testing.assert_allclose(found["change_of_q1"], (after - before)[:, 1] / system.step_size)


def test_default_features_of_more_than_a_configuration_have_names():
    class Plain(Odometer):
        features = System.features

    before, after = (np.column_stack([rows, np.arange(40.0)]) for rows in steps())
    found = columns(Plain(), before, after)
    assert list(found) == ["q0", "q1", "b2", "change_of_q0", "change_of_q1", "change_of_b2"]
    np.testing.assert_array_equal(found["b2"], np.arange(40.0))


def test_the_arms_features_have_names():
    rng = np.random.default_rng(0)
    before = rng.uniform(-3, 3, (20, 3))
    after = before + rng.uniform(-0.1, 0.1, (20, 3))
    found = columns(PlanarArm(), before, after)
    np.testing.assert_array_equal(found["q1"], before[:, 1])
    np.testing.assert_allclose(found["sin_of_link2"], np.sin(before.sum(axis=1)))
    np.testing.assert_allclose(found["cos_of_link0"], np.cos(before[:, 0]))
    change = (after - before)[:, 2] / PlanarArm.step_size
    np.testing.assert_allclose(found["change_of_q2"], change)


def test_the_cars_features_have_names():
    car = Car("slalom")
    pose, step = np.array([[5.0, 3.0, np.pi / 2]]), np.array([[-0.2, 0.5, 0.1]])
    found = columns(car, pose, pose + step)
    assert found["ahead"][0] == pytest.approx(0.5)
    assert found["left"][0] == pytest.approx(0.2)
    assert found["turn"][0] == pytest.approx(0.1)
    end = columns(car, pose + step, pose)["clearance_at_0%_of_arc"]
    assert found["clearance_at_end"] == pytest.approx(end)
    # The same place, once seen from here and once from 0.6 m further back.
    back = columns(car, pose - [[0, 0.6, 0]], pose)
    assert found["distance_-0.45_ahead_+0.5_left"] == pytest.approx(
        back["distance_+0.15_ahead_+0.5_left"]
    )


@pytest.mark.parametrize("kind", ["vector", "clearance"])
def test_the_ropes_features_have_names(kind):
    rope = Rope("simple_hook", features=kind)
    start = rope.reduce(rope.scene_problem().start)[None]
    way = start[:, 3:6] - start[:, :3]
    nearer = np.hstack([np.zeros((1, 3)), -0.024 * way / np.linalg.norm(way)])
    for _ in range(4):  # until the rope hangs through
        start, _ = rope.propagate(start, nearer)
    after, valid = rope.propagate(start, np.array([[0.01, 0.0, 0.02, 0.0, 0.0, 0.0]]))
    assert valid.all()
    found = columns(rope, start, after)
    apart = np.linalg.norm(start[0, 3:6] - start[0, :3])
    longest = rope.scene.max_band_length if kind == "vector" else rope.scene.rope_length
    assert found["gripper_separation_before"][0] == pytest.approx(apart / longest)
    again = columns(rope, after, after)
    for name in ("gripper_separation", "band_length"):
        assert found[f"{name}_after"] == pytest.approx(again[f"{name}_before"])
    if kind == "vector":
        changed = found["free_parts_after"] - found["free_parts_before"]
        assert found["free_parts_change"] == changed
        free, occupied = found["free_parts_before"][0], found["occupied_parts_before"][0]
        assert found["parts_before"][0] == free + occupied > max(free, occupied)
        return
    assert found["motion_a_up"][0] == pytest.approx(0.8)
    assert found["motion_b_up"][0] == 0
    assert found["pbd1_length"][0] > 0.5
    assert found["depth_of_rope_before"][0] > 0
    # The rope hangs below the middle of the band.
    assert found["pbd0_offset8_up"][0] < -1
    assert max(abs(found[f"pbd0_offset8_{way}"][0]) for way in ("along", "left")) < 0.5


def test_voxels_have_no_names():
    assert Rope().feature_names_out is None


@pytest.mark.parametrize("make", [SuspendedLoad, TractorTrailer])
def test_the_example_systems_features_have_names(make):
    system = make()
    start = system.reduce(system.sample_problem(0).start)[None]
    after, _ = system.propagate(start, system.steer(start, system.bounds[1:]))
    found = columns(system, start, after)
    motion = (after - start)[0] / system.step_size
    if make is SuspendedLoad:
        assert found["height"][0] == start[0, 2]
        assert found["motion_z"][0] == pytest.approx(motion[2])
    else:
        length = np.hypot(found["ahead"], found["left"])[0]
        assert length == pytest.approx(np.linalg.norm(motion[:2]))


def test_a_class_with_features_of_its_own_has_no_names_of_its_base_class(data):
    class Fewer(PlanarArm):
        def features(self, reduced, next_reduced):
            return super().features(reduced, next_reduced)[:, ::-1]

    class FewerNamed(Fewer):
        feature_names_out = PlanarArm.feature_names_out[::-1]

    assert Disc().feature_names_out is None
    with pytest.raises(ValueError, match="give it feature_names_out"):
        arm_rows().features(Fewer(), as_frame=True)
    named = arm_rows().features(FewerNamed(), as_frame=True)
    expected = arm_rows().features(PlanarArm(), as_frame=True)
    pd.testing.assert_frame_equal(named[expected.columns], expected)


def arm_rows():
    arm = PlanarArm()
    return collect_transitions(arm, BiasedRRTConnect(arm), 2, random_state=0)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("x", "y"), "must be a sequence of 4 strings.*got 2: "),
        (("x", "y", "z", 3), "must be a sequence of 4 strings"),
        ("abcd", "must be a sequence of 4 strings"),
        (("x", "y", "x", "north"), "must be different names, got 'x' 2 times"),
        (4, "must be a sequence of 4 strings.*got 4"),
    ],
)
def test_unfit_names_are_refused(names, told, data):
    disc = Disc()
    disc.feature_names_out = names
    with pytest.raises(SystemContractError, match=rf"Disc.feature_names_out {told}"):
        check_system(disc)
    with pytest.raises(ValueError, match=rf"Disc.feature_names_out {told}"):
        data.features(disc, as_frame=True)


@pytest.mark.parametrize("names", [list(NAMES), NAMES, np.array(NAMES), np.array(NAMES, object)])
def test_names_may_be_any_sequence_and_an_instances_own(names, data):
    disc = Disc()
    disc.feature_names_out = names
    check_system(disc)
    assert list(data.features(disc, as_frame=True)) == list(NAMES)


# Tables


def test_features_can_be_had_as_a_table(data):
    frame = data.features(NamedDisc(), as_frame=True)
    assert list(frame.columns) == list(NAMES)
    np.testing.assert_array_equal(frame.to_numpy(), data.features(NamedDisc()))
    assert isinstance(data.features(NamedDisc()), np.ndarray)
    assert data[:0].features(NamedDisc(), as_frame=True).shape == (0, 4)


def test_scenes_must_agree_on_names(data):
    two = collect_transitions(
        [NamedDisc(), NamedDisc()], BiasedRRTConnect(None, max_iterations=2000), 6, random_state=0
    )
    assert list(two.features([NamedDisc(), NamedDisc()], as_frame=True)) == list(NAMES)
    other = NamedDisc()
    other.feature_names_out = NAMES[::-1]
    with pytest.raises(ValueError, match="scenes 0 and 1 by different names"):
        two.features([NamedDisc(), other], as_frame=True)


def test_a_table_needs_pandas(data, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(ImportError, match="install pandas"):
        data.features(NamedDisc(), as_frame=True)
    assert data.features(NamedDisc()).shape[1] == 4


# Planning with estimators that were fitted on tables

BY_NAME = make_pipeline(
    make_column_transformer((StandardScaler(), ["north", "x"]), remainder="passthrough"),
    LogisticRegression(),
)
ESTIMATORS = [
    LogisticRegression(),
    RandomForestClassifier(5, random_state=0),
    HistGradientBoostingClassifier(max_iter=5, random_state=0),
    make_pipeline(StandardScaler(), RandomForestClassifier(5, random_state=0)),
    TransitionReliabilityClassifier(max_epochs=2, random_state=0),
    GridSearchCV(LogisticRegression(), {"C": [1.0, 2.0]}, cv=2),
    BY_NAME,
]
some_columns = pytest.mark.parametrize(
    "chosen", [NAMES, ("north", "y", "x", "east"), ("north", "x")], ids=len
)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda one: type(one).__name__)
@some_columns
def test_estimators_are_asked_with_the_columns_that_they_were_fitted_on(
    estimator, chosen, data, no_warnings
):
    system = NamedDisc()
    estimator.fit(data.features(system, as_frame=True)[list(chosen)], data.y)
    before, after = steps()
    asked = pd.DataFrame(system.features(before, after), columns=NAMES)[list(chosen)]
    check = checker(estimator, system)
    reliable, probability = check.evaluate(before, after)
    np.testing.assert_array_equal(reliable, estimator.predict(asked) == 1)
    np.testing.assert_allclose(probability, estimator.predict_proba(asked)[:, 1], atol=1e-6)
    assert 0 < reliable.mean() < 1
    planner = BiasedRRT(system, estimator, k=10, accuracy=0.9, random_state=0)
    assert planner.plan([-0.9, 0.1], [-0.5, 0.8]).success


def test_without_names_answers_are_the_same_to_the_bit(data):
    X, named = data.features(Disc()), data.features(NamedDisc(), as_frame=True)
    for estimator in ESTIMATORS[1:4]:
        inference = compile_inference(estimator.fit(X, data.y))
        before, after = steps()
        plain = checker(estimator, Disc()).evaluate(before, after)
        scores = inference.score(Disc().features(before, after))
        np.testing.assert_array_equal(plain[1], inference.probability(scores, 1))
        by_name = checker(estimator.fit(named, data.y), NamedDisc()).evaluate(before, after)
        np.testing.assert_array_equal(plain, by_name)


@pytest.mark.parametrize("system", [Disc(), NamedDisc()], ids=["no names", "names"])
def test_names_of_a_users_own_stand_for_all_columns_in_order(system, data, no_warnings):
    own = pd.DataFrame(data.features(system), columns=["a", "b", "c", "d"])
    estimator = LogisticRegression().fit(own, data.y)
    before, after = steps()
    asked = pd.DataFrame(system.features(before, after), columns=own.columns)
    reliable = checker(estimator, system).classify(before, after)
    np.testing.assert_array_equal(reliable, estimator.predict(asked) == 1)


def test_missing_names_are_told_at_the_door(data):
    frame = data.features(NamedDisc(), as_frame=True).assign(speed=1.0, wind=2.0)
    estimator = LogisticRegression().fit(frame[["x", "speed", "wind", "y"]], data.y)
    with pytest.raises(ValueError, match=r"NamedDisc does not have: speed, wind. Fit it"):
        BiasedRRT(NamedDisc(), estimator, k=10, accuracy=0.9).plan([-0.9, 0.1], [-0.5, 0.8])
    few = LogisticRegression().fit(frame[["x", "y"]], data.y)
    with pytest.raises(ValueError, match=r"2 features \(x, y\), and Disc gives 4; say what these"):
        BiasedRRT(Disc(), few, k=10, accuracy=0.9).plan([-0.9, 0.1], [-0.5, 0.8])


# Judging and learning by name


def test_diagnose_and_comparisons_name_features(rng):
    class NamedTable(Table):
        feature_names_out = ("weight", "height", "width")

    labels = executed_steps(rng).y.reshape(120, 8)
    noise = rng.normal(size=(960, 1))
    X = np.column_stack([noise, np.ones(960), noise])
    data = table(X, labels, executed=True)
    diagnosis = diagnose(DummyClassifier(), data, NamedTable(3))
    assert diagnosis.feature_names == NamedTable.feature_names_out
    assert diagnosis.to_dict()["feature_names"] == ["weight", "height", "width"]
    told = ("Feature height has the same value", "(width equals weight)")
    for part in told:
        assert part in str(diagnosis)
    frame = pd.DataFrame(X, columns=NamedTable.feature_names_out)
    sets = {"system": NamedTable(3), "frame": frame, "array": X}
    compared = compare_features(DummyClassifier(), data, sets).diagnoses
    for part in told:
        assert all(part in str(compared[name]) for name in ("system", "frame"))
    assert "Feature 1 has the same value" in str(compared["array"])
    assert compared["array"].feature_names is None


def test_diagnose_asks_by_name_where_it_must(data, no_warnings):
    by_name = diagnose(BY_NAME, data, NamedDisc(), cv=2)
    scaled = ColumnTransformer([("", StandardScaler(), [3, 0])], remainder="passthrough")
    by_number = diagnose(make_pipeline(scaled, LogisticRegression()), data, NamedDisc(), cv=2)
    assert by_name.accuracy == by_number.accuracy > 0.7
    fitted = LogisticRegression().fit(
        data.features(NamedDisc(), as_frame=True)[["north", "x"]], data.y
    )
    frozen = diagnose(FrozenEstimator(fitted), data, NamedDisc())
    X = data.features(NamedDisc(), as_frame=True)[["north", "x"]]
    assert frozen.accuracy == fitted.score(X, data.y)


@pytest.mark.parametrize("columns", ["x", slice("x", "y"), make_column_selector("x")])
def test_selections_by_name_need_names(columns, data):
    chosen = make_column_transformer((StandardScaler(), columns))
    if columns == "x":
        chosen = make_column_transformer((StandardScaler(), ["x"]))
    with pytest.raises(ValueError, match=r"by name.*give it feature_names_out"):
        diagnose(make_pipeline(chosen, LogisticRegression()), data, Disc())
    assert diagnose(make_pipeline(chosen, LogisticRegression()), data, NamedDisc()).n_folds == 5


def test_rounds_learn_by_name(no_warnings):
    def learned(estimator):
        planner = BiasedRRTConnect(NamedDisc(), max_iterations=200)
        rounds = {"n_rounds": 2, "n_plans": 20, "n_validation": 4, "random_state": 0}
        return learn_in_rounds(estimator, planner, NamedDisc(), **rounds)

    result = learned(BY_NAME)
    assert list(result.estimator.feature_names_in_) == list(NAMES)
    scaled = ColumnTransformer([("", StandardScaler(), [3, 0])], remainder="passthrough")
    by_number = learned(make_pipeline(scaled, LogisticRegression()))
    assert [r.n_validation_succeeded for r in result.rounds] == [
        r.n_validation_succeeded for r in by_number.rounds
    ]
    assert not hasattr(by_number.estimator, "feature_names_in_")
