"""Model files that run no code: what they keep, what they refuse, and what damage does to them."""

import copy
import io
import json
import zipfile

import joblib
import numpy as np
import pytest
from own_modules import TwoLayers
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import (
    ExtraTreesClassifier,
    HistGradientBoostingClassifier,
    RandomForestClassifier,
)
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import FixedThresholdClassifier, GridSearchCV
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC
from sklearn.tree import DecisionTreeClassifier

from reliability import (
    FastHistGradientBoostingClassifier,
    ModelFileError,
    TransitionReliabilityClassifier,
    VoxNet,
    load_estimator,
    save_estimator,
)
from reliability.model_files import model_file, sealed

X = np.random.default_rng(0).normal(size=(300, 4))
y = (X[:, 0] + X[:, 1] > 0).astype(int)
ROWS = np.random.default_rng(1).normal(size=(50, 4))

CLASSIFIERS = {
    "mlp": TransitionReliabilityClassifier(max_epochs=2, random_state=0),
    "fast boosting": FastHistGradientBoostingClassifier(max_iter=5),
    "boosting": HistGradientBoostingClassifier(max_iter=5),
    "forest": RandomForestClassifier(5, random_state=0),
    "extra trees": ExtraTreesClassifier(5, random_state=0),
    "tree": DecisionTreeClassifier(random_state=0),
    "pipeline": make_pipeline(StandardScaler(), LogisticRegression()),
    "calibrated": CalibratedClassifierCV(HistGradientBoostingClassifier(max_iter=5)),
    "isotonic": CalibratedClassifierCV(
        RandomForestClassifier(3, random_state=0), method="isotonic"
    ),
    "threshold": FixedThresholdClassifier(RandomForestClassifier(3, random_state=0), threshold=0.8),
    "search": GridSearchCV(LogisticRegression(), {"C": [0.1, 1.0]}),
}


def fitted(name):
    return copy.deepcopy(CLASSIFIERS[name]).fit(X, y)


@pytest.mark.parametrize("name", CLASSIFIERS)
def test_a_saved_estimator_answers_as_before(name, tmp_path):
    model = fitted(name)
    model.provenance_ = {"features": "own"}
    save_estimator(model, tmp_path / "model.skops")
    loaded = load_estimator(tmp_path / "model.skops")
    assert type(loaded) is type(model)
    assert loaded.provenance_ == model.provenance_
    np.testing.assert_array_equal(loaded.predict_proba(ROWS), model.predict_proba(ROWS))
    np.testing.assert_array_equal(loaded.predict(ROWS), model.predict(ROWS))
    if name == "mlp":
        assert loaded.validation_accuracy_ == model.validation_accuracy_
        assert loaded.history_ == model.history_


def test_a_saved_voxnet_answers_as_before(tmp_path, rng):
    grids = rng.integers(0, 256, size=(12, 12288)).astype(np.uint8)
    labels = np.arange(12) % 2
    model = TransitionReliabilityClassifier(VoxNet(pooling=2), max_epochs=1, random_state=0)
    model.fit(grids, labels)
    save_estimator(model, tmp_path / "model.skops")
    loaded = load_estimator(tmp_path / "model.skops")
    np.testing.assert_array_equal(loaded.predict_proba(grids), model.predict_proba(grids))


@pytest.mark.filterwarnings("ignore:The training rows are all of one class")
def test_one_label_is_kept(tmp_path):
    model = TransitionReliabilityClassifier(random_state=0).fit(X, np.ones(len(X), int))
    save_estimator(model, tmp_path / "model.skops")
    assert load_estimator(tmp_path / "model.skops").predict(ROWS).tolist() == [1] * len(ROWS)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SVC().fit(X, y), "sklearn.svm._classes.SVC.*joblib.dump"),
        (lambda: KNeighborsClassifier().fit(X, y), "KNeighborsClassifier.*joblib.dump"),
        (
            lambda: TransitionReliabilityClassifier(TwoLayers, max_epochs=1).fit(X, y),
            "own_modules.TwoLayers.*joblib.dump",
        ),
        (lambda: RandomForestClassifier(), "not fitted"),
    ],
)
def test_what_could_not_be_loaded_again_is_not_saved(make, words, tmp_path):
    path = tmp_path / "model.skops"
    path.write_text("as it was")
    with pytest.raises(ValueError, match=words):
        save_estimator(make(), path)
    assert path.read_text() == "as it was"
    assert list(tmp_path.iterdir()) == [path]


def test_only_files_of_this_kind_are_written(tmp_path):
    with pytest.raises(ValueError, match=r"path must end in \.skops, got .*model\.joblib"):
        save_estimator(fitted("pipeline"), tmp_path / "model.joblib")


@pytest.mark.parametrize("name", ["mlp", "fast boosting", "forest", "pipeline"])
@pytest.mark.parametrize("n_damages", [60, pytest.param(2000, marks=pytest.mark.slow)])
def test_no_damaged_file_is_believed(name, n_damages, tmp_path, rng):
    path = tmp_path / "model.skops"
    save_estimator(fitted(name), path)
    content = path.read_bytes()
    for number in range(n_damages):
        path.write_bytes(_damaged(content, number % 4, rng))
        with pytest.raises(ModelFileError, match=r"model\.skops can't be used"):
            load_estimator(path)


def _damaged(content, kind, rng):
    place = int(rng.integers(len(content)))
    if kind == 0:
        flipped = content[place] ^ (1 << int(rng.integers(8)))
        return content[:place] + bytes([flipped]) + content[place + 1 :]
    if kind == 1:
        return content[:place]
    if kind == 2:
        end = place + int(rng.integers(1, 200))
        return content[:place] + content[end:]
    return content[:place] + rng.bytes(16) + content[place:]


def test_a_file_of_skops_alone_is_refused(tmp_path):
    import skops.io

    skops.io.dump(fitted("pipeline"), tmp_path / "model.skops")
    with pytest.raises(ModelFileError, match="not a file that save_estimator wrote"):
        load_estimator(tmp_path / "model.skops")


def leads_out_of_the_tree(model):
    model._predictors[0][0].nodes["left"][0] = 10**6


def leads_in_a_circle(model):
    model._predictors[0][0].nodes["left"][0] = 0
    model._predictors[0][0].nodes["right"][0] = 0


def looks_at_no_feature(model):
    model._predictors[0][0].nodes["feature_idx"][0] = 10**6


def has_fewer_features(model):
    model.n_features_in_ = 1


def has_too_many_features(model):
    model.n_features_in_ = 10**12


def has_no_trees(model):
    model._predictors = []


def splits_by_a_category(model):
    model._predictors[0][0].nodes["is_categorical"][0] = 1


@pytest.mark.parametrize(
    "harm",
    [
        leads_out_of_the_tree,
        leads_in_a_circle,
        looks_at_no_feature,
        has_fewer_features,
        has_too_many_features,
        has_no_trees,
        splits_by_a_category,
    ],
)
def test_boosting_that_was_tampered_with_is_refused(harm, tmp_path):
    model = fitted("boosting")
    harm(model)
    (tmp_path / "model.skops").write_bytes(model_file(model))
    with pytest.raises(ModelFileError, match=r"model\.skops can't be used"):
        load_estimator(tmp_path / "model.skops")


@pytest.mark.parametrize("harm", ["cut", "NaN", "wide", "features"])
def test_a_network_that_was_tampered_with_is_refused(harm, tmp_path):
    model = fitted("mlp")
    inference = model.__getstate__()["_inference"]
    first = next(iter(inference.weights))
    if harm == "cut":
        inference.weights[first] = inference.weights[first][:-1]
    elif harm == "NaN":
        inference.weights[first][0, 0] = np.nan
    elif harm == "wide":
        inference.weights[first] = inference.weights[first].astype(np.float64)
    else:
        model.n_features_in_ = 3
    (tmp_path / "model.skops").write_bytes(model_file(model))
    with pytest.raises(ModelFileError, match="the weights"):
        load_estimator(tmp_path / "model.skops")


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize(
    ("field", "value"), [("left_child", 10**6), ("left_child", 0), ("feature", 10**6)]
)
def test_a_forest_that_was_tampered_with_is_refused(field, value, wrapped, tmp_path):
    model = fitted("isotonic" if wrapped else "forest")
    forest = model.calibrated_classifiers_[0].estimator if wrapped else model
    tree = forest.estimators_[0].tree_
    state = tree.__getstate__()
    state["nodes"][field][0] = value
    tree.__setstate__(state)
    (tmp_path / "model.skops").write_bytes(model_file(model))
    with pytest.raises(ModelFileError, match="a node of a tree refers to"):
        load_estimator(tmp_path / "model.skops")


def test_a_tree_that_looks_beyond_the_rows_of_its_forest_is_refused(tmp_path):
    model = fitted("forest")
    model.n_features_in_ = 1
    (tmp_path / "model.skops").write_bytes(model_file(model))
    with pytest.raises(ModelFileError, match="a node of a tree refers to"):
        load_estimator(tmp_path / "model.skops")


def test_a_file_that_names_code_is_refused(tmp_path):
    """A digest is no signature: whoever writes a file can give it one."""
    path = tmp_path / "model.skops"
    save_estimator(fitted("pipeline"), path)
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    schema = json.loads(parts["schema.json"])
    schema["content"]["content"]["steps"] = {
        "__class__": "system",
        "__module__": "os",
        "__loader__": "FunctionNode",
        "content": {"module_path": "os", "function": "system"},
    }
    parts["schema.json"] = json.dumps(schema).encode()
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    path.write_bytes(sealed(stream.getvalue()))
    with pytest.raises(ModelFileError, match=r"it holds os\.system, which such a file"):
        load_estimator(path)


def test_a_missing_file_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_estimator(tmp_path / "model.skops")


def test_joblib_files_are_still_read(tmp_path):
    model = fitted("mlp")
    joblib.dump(model, tmp_path / "model.joblib")
    loaded = load_estimator(tmp_path / "model.joblib")
    np.testing.assert_array_equal(loaded.predict_proba(ROWS), model.predict_proba(ROWS))
