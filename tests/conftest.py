"""Data and a model that several tests share, made once."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from importlib.util import find_spec

import numpy as np
import pytest
from fuzzing import OUTCOMES
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import TransitionReliabilityClassifier, collect_transitions
from systems import PlanarArm
from systems.extras import MODULES


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup():
    with skipping_without_extras():
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call():
    with skipping_without_extras():
        return (yield)


@contextmanager
def skipping_without_extras():
    """Skip a test that comes upon an extra which is not installed, such as torch."""
    try:
        yield
    except (Exception, pytest.fail.Exception) as error:
        reason = missing_extra(error)
        if reason is not None:
            pytest.skip(reason)
        raise


def missing_extra(error):
    """Return which extra an error, or what led to it, asks for, if it is not installed."""
    while error is not None:
        asked = re.search(r"pip install 'transition-reliability\[(\w+)\]'", str(error))
        if asked and any(find_spec(module) is None for module in MODULES[asked[1]]):
            return f"needs the extra [{asked[1]}]"
        error = error.__cause__ or error.__context__
    return None


def pytest_terminal_summary(terminalreporter):
    if "FUZZ_EXAMPLES" not in os.environ:
        return
    for door, outcomes in OUTCOMES.items():
        told = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
        terminalreporter.write_line(f"{door}: {outcomes.total()} cases, {told}")
    total = sum(outcomes.total() for outcomes in OUTCOMES.values())
    terminalreporter.write_line(f"{total} cases in all")


@pytest.fixture(scope="session")
def arm():
    return PlanarArm()


@pytest.fixture(scope="session")
def arm_transitions(arm):
    return collect_transitions(arm, BiasedRRTConnect(arm), 150, random_state=0)


@pytest.fixture(scope="session")
def arm_classifier(arm, arm_transitions):
    classifier = TransitionReliabilityClassifier(max_epochs=12, random_state=0)
    return classifier.fit(
        arm_transitions.features(arm), arm_transitions.y, groups=arm_transitions.plan
    )


@pytest.fixture(scope="session")
def disc_data():
    """X, y and plan ids of the disc world, whose right edge is Unreliable."""
    disc = Disc()
    transitions = collect_transitions(disc, BiasedRRTConnect(disc), 120, random_state=0)
    return transitions.features(disc), transitions.y, transitions.plan


@pytest.fixture
def rng():
    return np.random.default_rng(0)
