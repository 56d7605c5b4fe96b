"""Model files: small, complete, and plain about what is wrong with them."""

import joblib
import numpy as np
import pytest
from own_modules import TwoLayers
from sklearn.ensemble import RandomForestClassifier
from test_processes import run

from reliability import MLP, ModelFileError, TransitionReliabilityClassifier, load_estimator


@pytest.fixture
def saved(arm_classifier, tmp_path):
    path = tmp_path / "arm.joblib"
    joblib.dump(arm_classifier, path)
    return path


def test_a_fresh_process_predicts_the_same(saved, arm_classifier, arm, arm_transitions, tmp_path):
    X = arm_transitions.features(arm)
    np.save(tmp_path / "X.npy", X)
    process = run(
        f"""
        import joblib, numpy as np
        model = joblib.load({str(saved)!r})
        X = np.load({str(tmp_path / "X.npy")!r})
        np.save({str(tmp_path / "p.npy")!r}, model.predict_proba(X))
        print(model.validation_accuracy_)
        """
    )
    np.testing.assert_array_equal(np.load(tmp_path / "p.npy"), arm_classifier.predict_proba(X))
    assert float(process.stdout) == arm_classifier.validation_accuracy_


def test_the_file_holds_weights_and_little_else(saved, arm_classifier):
    n_weights = 12 * 256 + 256 + 256 * 128 + 128 + 128 * 64 + 64 + 64 + 1
    assert 4 * n_weights < saved.stat().st_size < 4 * n_weights + 10_000
    state = arm_classifier.__getstate__()
    assert not any("torch" in type(value).__module__ for value in state.values())
    assert {"numpy", "scikit-learn", "skorch", "torch"} <= state["_package_versions"].keys()


def test_using_a_model_does_not_change_its_file(saved, arm_classifier, tmp_path, rng):
    arm_classifier.predict(rng.normal(size=(5000, 12)))
    joblib.dump(arm_classifier, tmp_path / "again.joblib")
    assert (tmp_path / "again.joblib").read_bytes() == saved.read_bytes()


def test_weights_can_be_shared_through_a_memory_map(saved, arm_classifier, rng):
    X = rng.normal(size=(10, 12))
    mapped = joblib.load(saved, mmap_mode="r")
    np.testing.assert_array_equal(mapped.predict_proba(X), arm_classifier.predict_proba(X))


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.3, 0.99, 0.9999])
def test_truncated_files_are_refused(saved, share):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ModelFileError, match=r"arm.joblib is truncated or no joblib file .*again"):
        load_estimator(saved)


def test_files_of_another_format_are_refused(saved, arm_classifier, tmp_path):
    state = arm_classifier.__getstate__() | {"_format_version": 99}
    with pytest.raises(ModelFileError, match=r"saved in format 99 with .* reads format 2. Load it"):
        TransitionReliabilityClassifier().__setstate__(state)


def test_files_that_need_what_is_not_here_are_refused(tmp_path):
    run(
        f"""
        import joblib, sys, types
        module = types.ModuleType("elsewhere")
        class Model: pass
        Model.__module__ = "elsewhere"; module.Model = Model; sys.modules["elsewhere"] = module
        joblib.dump(Model(), {str(tmp_path / "model.joblib")!r})
        """
    )
    with pytest.raises(ModelFileError, match=r"can't be imported here .*elsewhere"):
        load_estimator(tmp_path / "model.joblib")


@pytest.mark.parametrize("module", ["_loss", "sklearn.of_the_past"])
def test_files_of_another_scikit_learn_say_so(module, tmp_path):
    (tmp_path / "model.joblib").write_bytes(f"c{module}\nCyHalfBinomialLoss\n.".encode())
    with pytest.raises(ModelFileError, match="saved with another version of scikit-learn"):
        load_estimator(tmp_path / "model.joblib")


def test_a_missing_file_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_estimator(tmp_path / "absent.joblib")


@pytest.mark.parametrize("content", [3, [1], {"weights": [1.0]}, None])
def test_files_of_something_else_are_refused(tmp_path, content):
    joblib.dump(content, tmp_path / "model.joblib")
    kind = type(content).__name__
    with pytest.raises(ModelFileError, match=f"must hold an estimator, .* got {kind}"):
        load_estimator(tmp_path / "model.joblib")


def test_estimators_of_other_libraries_are_loaded(tmp_path, rng):
    X = rng.normal(size=(30, 2))
    forest = RandomForestClassifier(3, random_state=0).fit(X, X[:, 0] > 0)
    joblib.dump(forest, tmp_path / "forest.joblib", compress=3)
    loaded = load_estimator(str(tmp_path / "forest.joblib"))
    np.testing.assert_array_equal(loaded.predict_proba(X), forest.predict_proba(X))


@pytest.mark.parametrize("backend", [MLP((8,)), "voxnet", TwoLayers], ids=str)
def test_a_loaded_model_answers_as_before_in_batches_of_any_size(backend, tmp_path, rng):
    X = rng.normal(size=(2500, 3))
    classifier = TransitionReliabilityClassifier(
        backend, max_epochs=1, rows_per_epoch=64, random_state=0
    ).fit(X[:100], X[:100, 0] > 0)
    joblib.dump(classifier, tmp_path / "model.joblib")
    loaded = load_estimator(tmp_path / "model.joblib")
    for n_rows in (1, 7, 2500 if backend != "voxnet" else 70):
        before = classifier.decision_function(X[:n_rows])
        np.testing.assert_array_equal(loaded.decision_function(X[:n_rows]), before)
        before = classifier.fast_decision_function(X[:n_rows])
        np.testing.assert_array_equal(loaded.fast_decision_function(X[:n_rows]), before)
    assert loaded.history_ == classifier.history_
    assert loaded.validation_accuracy_ == classifier.validation_accuracy_
    assert repr(loaded) == repr(classifier)


def test_a_constant_answer_is_kept(tmp_path):
    X = np.zeros((20, 2))
    with pytest.warns(UserWarning, match="all of one class"):
        constant = TransitionReliabilityClassifier().fit(X, np.ones(20, dtype=int))
    joblib.dump(constant, tmp_path / "model.joblib")
    assert load_estimator(tmp_path / "model.joblib").predict(X).tolist() == [1] * 20
