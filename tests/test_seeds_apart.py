"""Collection, learning in rounds and evaluation with one random_state have different problems."""

from sklearn.linear_model import LogisticRegression
from toy_systems import Disc

from planners import BiasedRRTConnect, evaluate
from reliability import collect_transitions, learn_in_rounds


class Recording(Disc):
    """Remembers the problems that it drew."""

    def __init__(self):
        super().__init__()
        self.starts = []

    def sample_problem(self, random_state=None):
        problem = super().sample_problem(random_state)
        self.starts.append(tuple(problem.start))
        return problem


def drawn_by(work):
    system = Recording()
    work(system, BiasedRRTConnect(None))
    return system.starts


def test_one_random_state_gives_each_other_problems():
    def collect(system, planner):
        collect_transitions(system, planner, 12, random_state=5)

    def learn(system, planner):
        learn_in_rounds(
            LogisticRegression(), planner, system, n_rounds=2, n_plans=12, random_state=5
        )

    def judge(system, planner):
        evaluate(system, planner, 12, tolerance=0.1, random_state=5)

    drawn = [drawn_by(work) for work in (collect, learn, judge)]
    collected, learned, judged = map(set, drawn)
    assert len(collected) == len(judged) == 12
    assert len(learned) >= 24
    assert not collected & learned | collected & judged | learned & judged
    assert drawn_by(collect) == drawn[0], "each draws the same again"
    assert drawn_by(judge) == drawn[2]
