"""Planners that avoid Unreliable transitions: biased RRT and RRT-Connect, for any estimator."""

import lazy_loader

# Public names stand in __init__.pyi; each is imported when it is first used, because OMPL, numba
# and scikit-learn are slow to import.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
