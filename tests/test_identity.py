"""Descriptions: what is the same stays the same, and what differs is told apart."""

import importlib
import json
import subprocess
import sys
from functools import cached_property, partial

import joblib
import numpy as np
import pytest
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import (
    GradientBoostingClassifier,
    HistGradientBoostingClassifier,
    RandomForestClassifier,
)
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import (
    FastHistGradientBoostingClassifier,
    TransitionReliabilityClassifier,
    code_digest,
    describe,
    load_estimator,
    save_estimator,
)
from systems import Car, PlanarArm, Rope, random_car_scene


@pytest.fixture(scope="module")
def data():
    X = np.random.default_rng(0).normal(size=(200, 4))
    return X, (X[:, 0] + X[:, 1] > 0).astype(int)


ESTIMATORS = {
    "logistic regression": LogisticRegression(),
    "pipeline": make_pipeline(StandardScaler(), LogisticRegression()),
    "forest": RandomForestClassifier(5, random_state=0),
    "boosting": HistGradientBoostingClassifier(max_iter=3, random_state=0),
    "fast boosting": FastHistGradientBoostingClassifier(max_iter=3, random_state=0),
    "calibrated": CalibratedClassifierCV(LogisticRegression(), cv=2),
    "neighbours": KNeighborsClassifier(),
    "support vectors": SVC(),
    "stages": GradientBoostingClassifier(n_estimators=2, random_state=0),
    "search": GridSearchCV(LogisticRegression(), {"C": [0.1, 1.0]}, cv=2),
    "ours": TransitionReliabilityClassifier(max_epochs=1, random_state=0),
}


@pytest.mark.parametrize("name", ESTIMATORS)
def test_an_estimator_is_the_same_after_a_file_and_another_with_other_weights(name, data, tmp_path):
    X, y = data
    fitted = ESTIMATORS[name].fit(X, y)
    described = describe(fitted)
    fitted.predict(X)
    joblib.dump(fitted, tmp_path / "model.joblib")
    loaded = joblib.load(tmp_path / "model.joblib")
    assert describe(loaded) == described
    loaded.predict(X[:1])
    joblib.dump(loaded, tmp_path / "model.joblib")
    assert describe(joblib.load(tmp_path / "model.joblib")) == described
    assert json.loads(json.dumps(described)) == described, "fits into a manifest"
    flipped = describe(ESTIMATORS[name].fit(X, 1 - y))
    assert flipped != described


@pytest.mark.parametrize("name", ["logistic regression", "stages", "boosting", "search", "ours"])
def test_an_estimator_is_the_same_after_it_was_saved_without_code(name, data, tmp_path):
    X, y = data
    fitted = ESTIMATORS[name].fit(X, y)
    described = json.dumps(describe(fitted))
    save_estimator(fitted, tmp_path / "model.skops")
    assert json.dumps(describe(fitted)) == described, "saving it changes nothing"
    assert json.dumps(describe(load_estimator(tmp_path / "model.skops"))) == described


def test_parameters_are_described_in_words_but_for_those_that_change_no_answer():
    described = describe(RandomForestClassifier(5, n_jobs=2, random_state=3, verbose=1))
    assert described["class"] == "RandomForestClassifier"
    assert described["parameters"]["n_estimators"] == 5
    assert described == describe(RandomForestClassifier(5))
    assert described != describe(RandomForestClassifier(6))


def test_a_planner_is_described_with_its_estimators_weights(data):
    arm = PlanarArm()
    one, other = (LogisticRegression(C=c).fit(*data) for c in (1.0, 1.0))
    described = [describe(BiasedRRTConnect(arm, estimator, k=2)) for estimator in (one, other)]
    assert described[0] == described[1]
    assert described[0]["parameters"]["k"] == 2
    other.coef_[0, 0] += 1e-9
    assert describe(BiasedRRTConnect(arm, other, k=2)) != described[0]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1e-3, np.float64(1e-3)),
        (3, np.int64(3)),
        ((1, 2), [1, 2]),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
        (np.arange(3), [0, 1, 2]),
        ({3, 1, 2}, {2, 3, 1}),
        (True, np.bool_(True)),
    ],
)
def test_values_that_mean_the_same_are_described_the_same(one, other):
    assert describe(one) == describe(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1e-3, 1.0000001e-3),
        (1, "1"),
        (0, False),
        (np.zeros(100), np.zeros(101)),
        (np.zeros(100), np.zeros(100, dtype=np.float32)),
        (np.zeros(100), np.append(np.zeros(99), 1e-300)),
        (slice(0, 3), slice(0, 4)),
        (None, "None"),
        (Car("slalom"), Car("open_lot")),
        (Car(random_car_scene(0)), Car(random_car_scene(1))),
        (Rope("simple_hook"), Rope("multi_hook")),
        (Rope(), Rope(features="vector")),
        (Rope(), Rope(engine="pybullet")),
        (Disc(), Disc(sticky=False)),
        (partial(random_car_scene, 1), partial(random_car_scene, 2)),
    ],
)
def test_values_that_differ_are_described_differently(one, other):
    assert json.dumps(describe(one)) != json.dumps(describe(other))


class Cached(Disc):
    @cached_property
    def area(self):
        return np.pi * self.radius**2


class Privately(Disc):
    """Keeps what the constructor is given under other names."""

    def __init__(self, mass, reach=1.0):
        super().__init__()
        self._kept = [mass]
        self._reach = reach


class InItsOwnWords(Disc):
    def __init__(self, handle, gain):
        super().__init__()
        self.handle, self.gain = handle, gain

    def describe(self):
        return {"gain": self.gain}


def test_a_system_is_described_by_what_its_constructor_was_given():
    assert describe(Disc(sticky=False)) == {"class": "Disc", "sticky": False}
    assert describe(Car("slalom"))["scene"]["class"] == "CarScene"
    described = describe(Privately(2.0, reach=3.0))
    assert described["reach"] == 3.0
    assert described != describe(Privately(2.5, reach=3.0)), "a parameter that can't be found"
    disc = Disc()
    disc.radius = 0.3
    assert describe(disc)["radius"] == 0.3


def test_what_a_system_did_does_not_change_it():
    cached = Cached()
    before = describe(cached)
    assert cached.area > 0
    assert describe(cached) == before
    for system in (PlanarArm(), Rope("simple_hook")):
        before = describe(system)
        problem = system.sample_problem(0)
        command = system.steer(system.reduce(problem.start)[None], problem.goal[:1])
        system.rollout(problem.start, command)
        assert describe(system) == before


def test_a_system_that_does_not_pickle_can_describe_itself():
    handle = (line for line in ())
    with pytest.raises(ValueError, match=r"does not pickle .* or give the class a method describe"):
        describe(
            type("Bare", (Disc,), {"__init__": lambda self, x: setattr(self, "_h", handle)})(1)
        )
    assert describe(InItsOwnWords(handle, 2.0)) == {
        "class": "InItsOwnWords",
        "described": {"gain": 2.0},
    }


MODULE = '''
"""A system of a user's own."""
import numpy as np
from toy_systems import Disc
import helpers_of_mine

GRAVITY = 9.81
LIMITS = {"low": [0.0, 1.0]}
unused = 1

def pull(x):
    return GRAVITY * x

class Mine(Disc):
    """Falls."""
    scale = 2.0
    def rollout(self, state, commands):
        """Fall."""
        return [pull(c) + helpers_of_mine.friction(c) + LIMITS["low"][0] for c in commands]
    def close(self, predicted, executed):
        return {x in {"a", "b", "c"} for x in predicted}
    def reduce(self, state):
        class Reader:
            """Reads."""
            last = 1
            def read(self):
                """Read the end."""
                return state[-self.last:]
        return Reader().read()
    def features(self, reduced, next_reduced):
        return not self.steer(reduced, "fast")

if __name__ == "__main__":
    n_plans = 120
'''
HELPERS = '''
MU = 0.3
class Surface:
    """What the wheels are on."""
    def __init__(self, name):
        self.name = name
    @property
    def slip(self):
        """Nothing."""
        return 0.5
    def grip(self):
        """Hold."""
        try:
            found = float(self.slip)
        except ValueError:
            found = 0.0
        return found
SURFACE = Surface("wet")
def friction(c):
    """Brake."""
    if c is None:
        return None
    return (lambda v: -MU * v)(c) + SURFACE.grip()
def never_used():
    return 1
'''


@pytest.fixture
def digest_of(tmp_path, monkeypatch):
    """Digest the code of a user's system as it is after some changes to its text."""
    monkeypatch.syspath_prepend(tmp_path)

    def digest(*changes, name="system_of_mine"):
        texts = {name: MODULE, "helpers_of_mine": HELPERS}
        for old, new in changes:
            assert any(old in text for text in texts.values())
            texts = {module: text.replace(old, new) for module, text in texts.items()}
        for module, text in texts.items():
            (tmp_path / f"{module}.py").write_text(text)
            sys.modules.pop(module, None)
            for compiled in tmp_path.glob("__pycache__/*"):
                compiled.unlink()
        importlib.invalidate_caches()
        found = code_digest(importlib.import_module(name).Mine)
        for module in texts:
            sys.modules.pop(module)
        return found

    return digest


@pytest.mark.parametrize(
    "change",
    [
        ("GRAVITY = 9.81", "GRAVITY = 1.62"),
        ("[0.0, 1.0]", "[0.0, 1.5]"),
        ("GRAVITY * x", "GRAVITY + x"),
        ("scale = 2.0", "scale = 3.0"),
        ("MU = 0.3", "MU = 0.4"),
        ("-MU * v", "MU * v"),
        ("(Disc)", "(Disc, object)"),
        ("def close", "def near"),
        ('{"a", "b", "c"}', '{"a", "b", "d"}'),
        ("last = 1", "last = 2"),
        ("state[-self", "state[self"),
        ('"fast"', '"slow"'),
        ('Surface("wet")', 'Surface("dry")'),
        ("return 0.5", "return 0.4"),
        ("found = 0.0", "found = 0.1"),
        ("ValueError", "TypeError"),
    ],
)
def test_changed_physics_are_other_code(digest_of, change):
    assert digest_of(change) != digest_of()


@pytest.mark.parametrize(
    "change",
    [
        ("unused = 1", "unused = 2"),
        ("A system of a user's own.", "A system of mine."),
        ("n_plans = 120", "n_plans = 240"),
        ('"""Falls."""', '"""Falls freely."""'),
        ('"""Fall."""', '"""Fall freely."""  # by gravity'),
        ("    return 1\n", "    return 2\n"),
        ("GRAVITY = 9.81", "GRAVITY = 9.810  # m/s²"),
        ("        return [pull", "\n\n        # Friction too.\n        return [pull"),
        ('    """Falls."""\n', ""),
        ('        """Fall."""\n', ""),
        ('"""Fall."""', '"""Fall.\n\n        Raises\n        ------\n        OSError\n        """'),
        ("def pull(x):\n", 'def pull(x):\n    """Pull down."""\n'),
        ("        return {x", '        "a"\n        return {x'),
        ('"""Reads."""', '"""Reads on."""'),
        ('            """Reads."""\n', ""),
        ('"""Read the end."""', '"""Read."""'),
        ('                """Read the end."""\n', ""),
        ('    """Brake."""\n', ""),
        ('    """What the wheels are on."""\n', ""),
        ('        """Nothing."""\n', ""),
        ('        """Hold."""\n', '        """Hold on."""\n'),
        ('        """Hold."""\n', ""),
    ],
)
def test_what_the_class_does_not_reach_is_no_other_code(digest_of, change):
    assert digest_of(change) == digest_of()


def test_code_is_the_same_as_a_script_in_another_process_and_under_another_name(
    digest_of, tmp_path
):
    expected = digest_of()
    assert digest_of(name="a_copy_of_mine") == expected
    show = "\n    from reliability import code_digest\n    print(code_digest(Mine))\n"
    (tmp_path / "system_of_mine.py").write_text(MODULE + show)
    environment = {"PYTHONPATH": ":".join(path for path in sys.path if path), "PYTHONHASHSEED": "7"}
    process = subprocess.run(
        [sys.executable, str(tmp_path / "system_of_mine.py")],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert process.stdout.strip() == expected


def test_this_librarys_own_physics_count(monkeypatch):
    before = [code_digest(kind) for kind in (Car, Rope, PlanarArm)]
    import systems.car.car as car
    import systems.rope.simulation.quasistatic as quasistatic

    monkeypatch.setattr(car, "CLOSE_DISTANCE", 0.2)
    monkeypatch.setattr(quasistatic, "rope_length", lambda nodes: 1.0)
    after = [code_digest(kind) for kind in (Car, Rope, PlanarArm)]
    assert [one != other for one, other in zip(before, after, strict=True)] == [True, True, False]
