"""Objects are shown in words, and not as an address or as pages of numbers."""

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from toy_systems import Disc, RightOf

import planners
import reliability
import systems
from planners import BiasedRRTConnect, CheckTransition, EdgeChecker, Evaluation, evaluate
from reliability import ResumableStore, learn_in_rounds
from systems import MujocoObstacles, PlanarArm, Problem, Rope, System

CLASSES = [
    pytest.param(getattr(package, name), id=name)
    for package in (systems, reliability, planners)
    for name in package.__all__
    if isinstance(getattr(package, name), type)
]


@pytest.mark.parametrize("kind", CLASSES)
def test_no_public_class_is_shown_as_an_address(kind):
    assert kind.__repr__ is not object.__repr__


def test_systems_are_shown_by_their_class():
    class Unfinished(Disc):
        def __init__(self):
            self.words = repr(self)

    assert repr(PlanarArm()) == "<PlanarArm: reduced_dim 3>"
    assert repr(Disc()) == "<Disc: reduced_dim 2>"
    assert Unfinished().words == "<Unfinished: reduced_dim 2>"
    bare = type("Bare", (Disc,), {"__repr__": System.__repr__})()
    del Disc.reduced_dim
    try:
        assert repr(bare) == "<Bare: reduced_dim unknown>"
    finally:
        Disc.reduced_dim = 2


def test_problems_are_shown_in_a_line():
    small = Problem(np.array([0.25, 0.5]), np.array([[1.0, 2.0]]))
    assert repr(small) == "Problem(start=array([0.25, 0.5 ]), goal=array([[1., 2.]]))"
    rope = repr(Rope("simple_hook").scene_problem())
    assert rope.startswith("Problem(start=<RopeState: ")
    assert "goal=array([[" in rope
    assert "\n" not in rope
    assert len(rope) < 250
    many = repr(Problem(np.zeros(3), np.zeros((40, 3))))
    assert many == "Problem(start=array([0., 0., 0.]), goal=<array of shape (40, 3)>)"
    region = repr(Problem(np.zeros(1), RightOf(0.5)))
    assert region == "Problem(start=array([0.]), goal=<RightOf, a region of goals>)"
    text = repr(Problem("x" * 10**6, np.zeros(1)))
    assert len(text) < 300
    assert text.endswith("…, goal=array([0.]))")


def test_other_objects_are_shown_in_a_line(tmp_path):
    rng = np.random.default_rng(0)
    check = CheckTransition(Disc(), None, k=1.0, accuracy=0.9, rng=rng)
    assert repr(check) == "<CheckTransition: 0 checked, 0 rejected>"
    assert repr(EdgeChecker(Disc(), check)) == "<EdgeChecker of <Disc: reduced_dim 2>>"
    store = ResumableStore(tmp_path, "numbers", {})
    assert repr(store) == f"<ResumableStore of 0 items in '{tmp_path}'>"
    shown = repr(MujocoObstacles("/model.xml", ignore=["floor"], height=0.5))
    assert shown == "MujocoObstacles('/model.xml', ignore=('floor',), height=0.5)"


def test_what_has_a_table_is_shown_as_one():
    planner = BiasedRRTConnect(Disc(), max_iterations=100)
    evaluation = evaluate(Disc(), planner, 2, tolerance=0.1, random_state=0)
    learned = learn_in_rounds(
        LogisticRegression(),
        planner,
        Disc(),
        n_rounds=1,
        n_plans=20,
        n_validation=2,
        random_state=0,
    )
    for thing in (evaluation, Evaluation.compare({"one": evaluation}), learned):
        assert repr(thing) == str(thing)
        assert "object at 0x" not in repr(thing)
