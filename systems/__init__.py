"""Systems: a robot in one scene, with a reduced model g and a true execution Γ."""

import lazy_loader

import _transition_reliability  # noqa: F401

# Public names stand in __init__.pyi; each is imported when it is first used, so that one system
# doesn't pay for the others.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
