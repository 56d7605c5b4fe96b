"""Errors that belong to systems."""


class SystemContractError(ValueError):
    """A system breaks the contract of :class:`systems.System`; the message says where."""


class SimulationDivergedError(RuntimeError):
    """The simulator behind a rollout diverged, so the rollout has no meaning and no label."""
