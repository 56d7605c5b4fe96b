"""Without torch, PyBullet and matplotlib, what needs them says which extra brings them."""

import configparser
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from systems.extras import MODULES, needing

ROOT = Path(__file__).parents[1]
BLOCKED = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in {modules}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""


def run_without(modules, code, folder):
    """Run code in a process where importing the modules raises ModuleNotFoundError."""
    code = BLOCKED.format(modules=modules) + textwrap.dedent(code)
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


def test_the_whole_road_needs_no_extra(tmp_path):
    """Quickstart's road with scikit-learn's trees; also files, rounds and the pretrained trees."""
    every = sorted(set().union(*MODULES.values()))
    road = """
        import numpy as np
        import planners, reliability, systems
        for package in (systems, reliability, planners):
            for name in package.__all__:
                getattr(package, name)
        from planners import BiasedRRTConnect, evaluate
        from sklearn.ensemble import RandomForestClassifier
        arm = systems.PlanarArm()
        systems.check_system(arm)
        without = BiasedRRTConnect(arm)
        data = reliability.collect_transitions(arm, without, 100, random_state=0, path="plans")
        forest = RandomForestClassifier(20, random_state=0)
        reliability.diagnose(forest, data, arm)
        learned = reliability.learn_in_rounds(
            reliability.FastHistGradientBoostingClassifier(max_iter=20), without, arm,
            n_rounds=1, n_plans=60, n_validation=5, labels="plan", random_state=0)
        forest.fit(data.features(arm), data.y)
        reliability.save_estimator(forest, "forest.skops")
        forest = reliability.load_estimator("forest.skops")
        planner = BiasedRRTConnect(arm, forest, k=10, accuracy=0.9, random_state=0)
        plan = planner.plan(np.array([-np.pi / 2, 0, 0]), np.array([np.pi / 2, 0, 0]))
        print(plan.status.value)
        print(evaluate(arm, planner, 2, tolerance=0.1, random_state=0).n_solved, "solved")
        trees = reliability.load_pretrained("rope")
        print(trees.predict(np.zeros((1, trees.n_features_in_))))
    """
    done = run_without(every, road, tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines == ["The plan reaches the goal.", "2 solved", "[0]"]


NEEDS = {
    "torch": [
        "TransitionReliabilityClassifier().fit([[0.0], [1.0]], [0, 1])",
        "load_pretrained('rope_paper')",
    ],
    "pybullet": ["Rope('simple_hook', 'pybullet').rollout(problem.start, np.zeros((1, 6)))"],
    "examples": ["Summary.of(data).plot()"],
}
SETTING = """
    import numpy as np
    from planners import *
    from reliability import *
    from systems import *
    problem = Rope("simple_hook").scene_problem()
    data = Transitions(
        reduced=np.zeros((2, 1)), command=np.zeros((2, 1)), next_reduced=np.zeros((2, 1)),
        y=np.array([0, 1]), plan=np.arange(2), step=np.zeros(2, int))
    try:
        {call}
    except ModuleNotFoundError as error:
        print(error)
"""


@pytest.mark.parametrize(
    ("extra", "call"), [(extra, call) for extra, calls in NEEDS.items() for call in calls]
)
def test_what_needs_an_extra_says_which(extra, call, tmp_path):
    done = run_without(sorted(MODULES[extra]), SETTING.format(call=call), tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"needs \w+, which is not installed. Install it with: ", done.stdout)
    assert f"pip install 'transition-reliability[{extra}]'" in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_other_missing_modules_are_not_blamed_on_an_extra():
    alone = r"^No module named 'of_nobody'$"
    with pytest.raises(ModuleNotFoundError, match=alone), needing("torch", "This"):
        import of_nobody  # noqa: F401


def test_extras_are_those_of_the_distribution():
    found = configparser.ConfigParser()
    found.read(ROOT / "setup.cfg")
    extras = found["options.extras_require"]
    for extra, modules in MODULES.items():
        brought = re.findall(r"^[\w-]+", extras[extra], flags=re.M)
        assert set(brought) == modules
    together = re.search(r"\[(.*?)\]", extras["all"])[1].split(",")
    assert {*together, "pybullet"} == set(MODULES)
