"""Planners for OMPL that avoid transitions which an estimator calls Unreliable."""

import lazy_loader

import _transition_reliability  # noqa: F401

# Public names stand in __init__.pyi; each is imported when it is first used, because OMPL, numba
# and scikit-learn are slow to import.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
