"""Data, labels, classifiers and files with odd arguments."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

import numpy as np
import pytest
from fuzzing import (
    Door,
    arrays,
    cases,
    choices,
    counts,
    numbers,
    rows,
    st,
    try_numpy_numbers,
    try_odd_values,
)
from matplotlib.figure import Figure
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import (
    MLP,
    FastHistGradientBoostingClassifier,
    Item,
    Job,
    ResumableStore,
    Summary,
    TransitionReliabilityClassifier,
    Transitions,
    VoxNet,
    code_digest,
    collect_transitions,
    compare_features,
    compile_inference,
    describe,
    diagnose,
    label_executed_transitions,
    label_transitions,
    learn_in_rounds,
    load_estimator,
    run_jobs,
    save_estimator,
)
from systems import PlanarArm

ARM, DISC = PlanarArm(), Disc()
PLANNER = BiasedRRTConnect(DISC, max_iterations=100)
no_functions = choices.filter(lambda value: not callable(value))
LABELS = np.array([1, 0, 1, 0])
COLUMNS = {
    "reduced": np.arange(8.0).reshape(4, 2),
    "command": np.ones((4, 2)),
    "next_reduced": np.arange(8.0).reshape(4, 2) + 2,
    "y": LABELS,
    "plan": np.array([0, 0, 1, 1]),
    "step": np.array([0, 1, 0, 1]),
    "scene": np.zeros(4, dtype=int),
    "executed": np.zeros(4, dtype=bool),
}
DATA = Transitions(**COLUMNS)
X = np.random.default_rng(0).normal(size=(16, 3))
Y = np.tile([0, 1], 8)
PLANS = np.repeat(np.arange(8), 2)
pytest.importorskip("torch", reason="needs the extra [torch]")
CLASSIFIER = TransitionReliabilityClassifier(MLP((4,)), max_epochs=1, random_state=0).fit(X, Y)
BOOSTING = FastHistGradientBoostingClassifier(max_iter=2, min_samples_leaf=2).fit(X, Y)
MADE = DATA[[0, 1, 2, 3] * 4]
MADE.plan = np.repeat(np.arange(4), 4)
# What scikit-learn's checks say without the argument's name.
OF_SKLEARN = (
    r"(X|y|[Ii]nput|array|[Ff]ound|features|sample|complex|Complex|float|string|dtype|numeric"
    r"|target)"
)


def transitions(**given):
    made = Transitions(**given)
    return made.reduced, made.next_reduced


def trained(**given):
    data = {name: given.pop(name) for name in ("X", "y", "groups", "sample_weight")}
    backend = MLP(given.pop("hidden_layer_sizes"))
    return TransitionReliabilityClassifier(backend, **given).fit(**data).predict_proba(X)


def saved(estimator, name):
    with tempfile.TemporaryDirectory() as folder:
        save_estimator(estimator, Path(folder) / name)
        return load_estimator(Path(folder) / name).predict(X)


def stored(**given):
    with tempfile.TemporaryDirectory() as folder:
        store = ResumableStore(Path(folder) / "store", given["kind"], given["description"])
        item = Item(given["facts"], {"a": np.zeros(1)})
        run_jobs([Job("job", lambda: item, store)], n_jobs=1)
        return store.read("job").arrays["a"]


def file_door(function):
    return Door(
        function,
        lambda: {"path": "nowhere"},
        {"path": choices},
        (ValueError, OSError),
        1.0,
        {"path": "(path|file)"},
    )


def kept_door(argument, function, share=0.4):
    """A door that writes a file or a folder, some of which can't be."""

    def call(**given):
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            Path("file").write_bytes(b"")
            function(**given)

    odd = st.sampled_from(["file", ".", "file/inside", "new/folder/deep", "\0", "a" * 300])
    return Door(
        call,
        lambda: {argument: "new.skops"},
        {argument: choices | odd},
        (ValueError, OSError),
        share,
        {argument: f"({argument}|path|file|whole|manifest)"},
    )


PAIR_OF_PATHS = {"predicted": np.zeros((3, 2)), "executed": np.zeros((2, 2)), "close": DISC.close}
COLLECTING = {
    "system": DISC,
    "planner": PLANNER,
    "n_plans": 1,
    "labels": "plan",
    "on_error": "raise",
    "random_state": 0,
    "verbose": 0,
}
LEARNING = {
    "estimator": LogisticRegression(),
    "planner": BiasedRRTConnect(DISC, accuracy=0.9, max_iterations=50),
    "system": DISC,
    "n_rounds": 1,
    "n_plans": 8,
    "n_validation": 1,
    "labels": "executed",
    "exploring_k": 6.0,
    "n_after": 1,
    "on_error": "raise",
    "random_state": 0,
}
TRAINING = {
    "X": X,
    "y": Y,
    "groups": PLANS,
    "sample_weight": np.ones(16),
    "hidden_layer_sizes": (4,),
    "max_epochs": 1,
    "batch_size": 8,
    "learning_rate": 0.0009765625,
    "learning_rate_decay": 0.5,
    "epochs_per_decay": 1,
    "rows_per_epoch": 8,
    "validation_fraction": 0.25,
    "patience": 1,
    "class_weight": None,
    "balanced_batches": False,
    "device": "cpu",
    "checkpoint": None,
    "random_state": 1,
}
JUDGED = {"estimator": LogisticRegression(), "transitions": MADE, "system": DISC, "cv": 2}
DIAGNOSIS = diagnose(**JUDGED)
GRIDS = np.arange(4096 // 8, dtype=np.uint8)
DOORS = {
    "Transitions": Door(
        transitions,
        lambda: dict(COLUMNS),
        {name: rows(*column.shape) for name, column in COLUMNS.items()},
        names={"reduced": "(reduced|next_reduced)"},
    ),
    "Transitions.trim_unreliable_runs": Door(
        lambda **given: DATA.trim_unreliable_runs(**given).reduced,
        lambda: {"n_after": 1},
        {"n_after": numbers},
    ),
    "Transitions.features": Door(DATA.features, lambda: {"system": DISC}, {"system": choices}),
    "Transitions.concatenate": Door(
        lambda **given: Transitions.concatenate(**given).reduced,
        lambda: {"parts": [DATA, DATA]},
        {"parts": choices | st.sampled_from([[1], [DATA, None], "ab", DATA])},
    ),
    "Transitions.save": file_door(DATA.save),
    "Transitions.load": file_door(Transitions.load),
    "label_transitions": Door(
        label_transitions,
        lambda: dict(PAIR_OF_PATHS),
        {"predicted": rows(3, 2), "executed": rows(2, 2), "close": no_functions},
        names={"predicted": "(predicted|executed)"},
    ),
    "label_executed_transitions": Door(
        label_executed_transitions,
        lambda: {
            "executed": np.zeros((2, 3)),
            "commands": np.zeros((2, 3)),
            "propagate": ARM.propagate,
            "close": ARM.close,
        },
        {
            "executed": rows(2, 3),
            "commands": rows(2, 3),
            "propagate": no_functions,
            "close": no_functions,
        },
        names={
            "commands": "(commands?|propagate|executed)",
            "executed": "(executed|propagate|reduced)",
        },
    ),
    "collect_transitions": Door(
        lambda **given: collect_transitions(**given).reduced,
        lambda: dict(COLLECTING),
        {
            **dict.fromkeys(["system", "planner", "labels", "on_error"], choices),
            "n_plans": counts,
            "random_state": numbers,
        },
        share=0.4,
    ),
    "learn_in_rounds": Door(
        lambda **given: learn_in_rounds(**given).transitions.reduced,
        lambda: dict(LEARNING),
        {
            **dict.fromkeys(["estimator", "planner", "system", "labels", "on_error"], choices),
            **dict.fromkeys(["n_rounds", "n_plans", "n_validation"], counts),
            **dict.fromkeys(["exploring_k", "n_after", "random_state"], numbers),
        },
        share=0.2,
        names={"random_state": "(random_state|n_plans)"},  # since few plans are drawn here
    ),
    "diagnose": Door(
        lambda **given: diagnose(**given).accuracy,
        lambda: dict(JUDGED),
        {**dict.fromkeys(["estimator", "transitions", "system"], choices), "cv": counts},
        share=0.4,
    ),
    "compare_features": Door(
        compare_features,
        lambda: {
            "estimator": LogisticRegression(),
            "transitions": MADE,
            "feature_sets": {"a": np.ones((16, 2)), "b": DISC},
            "cv": 2,
        },
        {
            "estimator": choices,
            "transitions": choices,
            "feature_sets": choices | st.fixed_dictionaries({"a": rows(16, 2), "b": choices}),
            "cv": counts,
        },
        share=0.2,
        names={"feature_sets": "(feature_sets|system|X|Input)"},
    ),
    "Classifier.fit": Door(
        trained,
        lambda: dict(TRAINING),
        {
            **dict.fromkeys(TRAINING, choices | numbers),
            "X": rows(16, 3),
            "y": rows(16),
            "groups": rows(16),
            "sample_weight": rows(16),
            "max_epochs": counts,
            "rows_per_epoch": counts,  # an epoch of 2**64 rows is long, and not wrong
            "hidden_layer_sizes": choices | arrays(1),
        },
        # scikit-learn's checks raise TypeErrors.
        errors=(ValueError, TypeError, FloatingPointError, OverflowError, OSError),
        share=0.4,
        names=dict.fromkeys(["X", "y"], OF_SKLEARN),
    ),
    "VoxNet": Door(
        lambda X, y, **given: (
            TransitionReliabilityClassifier(
                VoxNet(**given), max_epochs=1, validation_fraction=0.0, random_state=0
            )
            .fit(X, y)
            .predict_proba(X)
        ),
        lambda: {
            "X": np.tile(GRIDS, (2, 1)),
            "y": [0, 1],
            "pooling": 1,
            "mixed_precision": True,
            "augment": False,
        },
        {
            "X": arrays(2, GRIDS.size),
            **dict.fromkeys(["pooling", "mixed_precision", "augment"], choices | counts),
        },
        errors=(ValueError, TypeError, OverflowError),
        share=0.2,
        names={"X": OF_SKLEARN},
    ),
    "Classifier.fit (checkpoint)": kept_door(
        "checkpoint",
        lambda checkpoint: TransitionReliabilityClassifier(
            MLP((4,)), max_epochs=1, checkpoint=checkpoint, random_state=0
        ).fit(X, Y),
    ),
    "collect_transitions (path)": kept_door(
        "path", lambda path: collect_transitions(**COLLECTING, path=path)
    ),
    "learn_in_rounds (path)": kept_door(
        "path", lambda path: learn_in_rounds(**LEARNING, path=path), share=0.1
    ),
    "ResumableStore (folder)": kept_door("path", lambda path: ResumableStore(path, "a", {})),
    "ResumableStore.at": kept_door("folder", ResumableStore.at),
    "Transitions.save (path)": kept_door("path", DATA.save),
    "save_estimator (path)": kept_door("path", lambda path: save_estimator(CLASSIFIER, path)),
    "Diagnosis.plot": Door(
        lambda **given: str(DIAGNOSIS.plot(**given)),
        lambda: {"axes": Figure().subplots(1, 3)},
        {"axes": choices},
        share=0.4,
    ),
    "Summary.plot": Door(
        lambda **given: str(Summary.of(DATA).plot(**given)),
        lambda: {"axes": Figure().subplots(1, 2)},
        {"axes": choices},
        share=0.4,
    ),
    **{
        f"{name}.{method}": Door(
            getattr(estimator, method),
            lambda: {"X": X.copy()},
            {"X": rows(4, 3)},
            errors=(ValueError, TypeError, OverflowError),
            names={"X": OF_SKLEARN},
        )
        for name, estimator in (("Classifier", CLASSIFIER), ("FastHistGradientBoosting", BOOSTING))
        for method in ("predict", "predict_proba", "decision_function")
    },
    "save_estimator": Door(
        saved,
        lambda: {"estimator": CLASSIFIER, "name": "model.skops"},
        {"estimator": choices, "name": st.sampled_from(["model", "model.joblib", ".skops", ""])},
        names={"name": "path"},
    ),
    "load_estimator": file_door(load_estimator),
    "Summary.of": Door(Summary.of, lambda: {"transitions": DATA}, {"transitions": choices}),
    "ResumableStore": Door(
        stored,
        lambda: {"kind": "a test", "description": {"a": 1}, "facts": {"b": 2}},
        {"kind": choices, "description": choices, "facts": choices},
        share=0.4,
    ),
    "run_jobs": Door(
        run_jobs,
        lambda: {"jobs": [Job("a", lambda: Item({}))], "n_jobs": 1},
        {"jobs": choices | st.sampled_from([[1], [None]])},
    ),
    "compile_inference": Door(
        compile_inference, lambda: {"estimator": CLASSIFIER}, {"estimator": choices}
    ),
    "describe": Door(describe, lambda: {"thing": 1}, {"thing": choices | rows(2, 2)}),
    "code_digest": Door(code_digest, lambda: {"thing": Disc}, {"thing": choices}),
}


@cases(DOORS)
def test_an_odd_argument_gives_a_sane_result_or_an_error_that_names_it(
    name, argument, tmp_path, monkeypatch
):
    # Some paths are good ones.
    monkeypatch.chdir(tmp_path)
    try_odd_values(DOORS, name, argument)


@pytest.mark.parametrize("name", [n for n in DOORS if not n.endswith((".load", "load_estimator"))])
def test_numpy_scalars_are_numbers(name):
    try_numpy_numbers(DOORS[name])
