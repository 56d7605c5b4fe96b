"""Learning which transitions of a reduced model can be trusted."""

import lazy_loader

import _transition_reliability  # noqa: F401

__version__ = "0.1.0"

# Public names stand in __init__.pyi; each is imported when it is first used, because
# scikit-learn takes a second to import, which labelling alone need not pay.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
