"""check_system says what a user's system got wrong."""

import numpy as np
import pytest
from toy_systems import Disc, Odometer

from systems import Rollout, StopReason, SystemContractError, check_system


def test_systems_that_keep_the_contract_pass():
    check_system(Disc())
    check_system(Odometer())


class Unpicklable(Disc):
    def __init__(self):
        super().__init__()
        self.handle = lambda: None


class InPlace(Disc):
    def propagate(self, reduced, command):
        reduced += command
        return reduced, np.ones(len(reduced), dtype=bool)


class Restless(Disc):
    def __init__(self):
        super().__init__()
        self.rng = np.random.default_rng(0)

    def features(self, reduced, next_reduced):
        return reduced + self.rng.normal(size=reduced.shape)


class OneByOne(Disc):
    def steer(self, reduced, configuration):
        return super().steer(reduced, configuration[:1])


class BatchDependent(Disc):
    def features(self, reduced, next_reduced):
        return reduced - reduced.mean(axis=0)


class Overshooting(Disc):
    def steer(self, reduced, configuration):
        return 3 * super().steer(reduced, configuration)


class Imprecise(Disc):
    def steer(self, reduced, configuration):
        return 0.5 * super().steer(reduced, configuration)


class Silent(Disc):
    def rollout(self, state, commands):
        rollout = super().rollout(state, commands)
        return Rollout(rollout.states[1:], rollout.n_completed, rollout.stop_reason)


class Optimist(Disc):
    def rollout(self, state, commands):
        rollout = super().rollout(state, commands)
        return Rollout(rollout.states, rollout.n_completed, StopReason.CONSTRAINT)


class Raising(Disc):
    def close(self, predicted, executed):
        raise KeyError("threshold")


class Wandering(Disc):
    def sample_configurations(self, rng, n):
        return super().sample_configurations(np.random.default_rng(), n)


class Narrow(Disc):
    def sample_configurations(self, rng, n):
        return super().sample_configurations(rng, n)[:, :1]


def changed(**attributes):
    return type("Changed", (Disc,), attributes | {"__reduce__": lambda self: (Disc, ())})()


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (changed(reduced_dim=0), "reduced_dim must be a positive integer, got 0"),
        (changed(configuration_dim=3), "configuration_dim must be at most reduced_dim = 2"),
        (changed(step_size=np.inf), "step_size must be a positive number, got inf"),
        (changed(bounds=np.zeros((2, 3))), r"bounds must be an array of shape \(2, 2\)"),
        (changed(bounds=np.zeros((2, 2))), "bounds must be finite, lower < upper"),
        (changed(bounds=None), "bounds must be an array"),
        (Wandering(), "sample_configurations must draw from nothing but the given"),
        (Narrow(), r"sample_configurations must return an array of shape \(16, 2\)"),
        (Unpicklable(), "does not pickle .* leave simulators"),
        (InPlace(), "propagate changed its arguments in place"),
        (Restless(), "features gave two results for the same arguments"),
        (OneByOne(), "steer gives other results for rows alone than in a batch"),
        (BatchDependent(), "features gives other results for rows alone"),
        (Overshooting(), "steer commanded a motion of 0.3, more than step_size = 0.1"),
        (Imprecise(), "steer misses a configuration within one step"),
        (Silent(), "rollout must return the start"),
        (Optimist(), r"rollout completed \d of \d commands, which does not go with"),
        (Raising(), "Raising.close raised KeyError: 'threshold'"),
        (changed(close=lambda s, p, e: True), "close must return one bool per row"),
        (changed(close=lambda s, p, e: np.zeros(len(p), bool)), "not close to itself"),
        (changed(reduce=lambda s, x: x[:1]), r"reduce must return an array of shape \(2,\)"),
        (changed(reduce=lambda s, x: x * np.nan), "reduce returned NaN or infinity"),
        (changed(reduce=lambda s, x: np.float32(x)), "reduce must return a float64 array"),
        (changed(sample_problem=lambda s, r: (0, 1)), "sample_problem must return a Problem"),
        (changed(propagate=lambda s, b, u: b + u), r"must return \(next_reduced, valid\)"),
        (changed(features=lambda s, b, c: b[0]), "features must return a row per transition"),
        (changed(features=lambda s, b, c: b * np.inf), "features must return finite numbers"),
        (
            changed(features=lambda s, b, c: np.array(list(b))),
            r"features of no transitions must return an array of shape \(0, 2\), got \(0,\)",
        ),
        (changed(goal_reached=lambda s, b, g: 0), "goal_reached must return one bool per row"),
        (changed(succeeded=lambda s, x, g, t: False), "succeeded says False at an infinite"),
        (changed(succeeded=lambda s, x, g, t: None), "succeeded must return a bool, got None"),
        (object(), "must be a subclass of System"),
    ],
)
def test_breaches_are_named(system, message):
    with pytest.raises(SystemContractError, match=message):
        check_system(system)
