"""Systems that data come from: one, several, or as many as one draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.identity import describe
from reliability.item_files import canonical_json, digest_of
from reliability.reachable_code import code_digest
from systems.system import System

# Of more systems a manifest holds a digest each: those of thousands of scenes fill megabytes.
_MOST_IN_WORDS = 50

SceneArgument = System | Sequence[System] | Callable[[int], System]


class SceneFamily:
    """A system in one scene, in each of several, or in any scene that a seed gives.

    Each scene has an id: 0 for a single system, the position in a sequence, or the seed that is
    given to a callable.

    Parameters
    ----------
    system : System, sequence of Systems, or callable ``random_state -> System``
        A callable must return the same system for the same seed.

    Raises
    ------
    ValueError
        If ``system`` is none of these.
    """

    def __init__(self, system: SceneArgument) -> None:
        self._given = system
        self._systems: Sequence[System] | None = None
        if isinstance(system, System):
            self._systems = [system]
        elif isinstance(system, Sequence) and not isinstance(system, str):
            self._systems = system
            if not len(system) or not all(isinstance(one, System) for one in system):
                raise ValueError(
                    "system must be a sequence of at least one System and nothing else."
                )
        elif not callable(system):
            raise ValueError(
                "system must be a System, a sequence of Systems or a callable that returns a "
                f"System for a random_state, got {system!r}."
            )

    @property
    def is_single(self) -> bool:
        """Whether there is only one system."""
        return isinstance(self._given, System)

    def id_of_plan(self, plan: int, seed: int, purpose: tuple[int, ...] = ()) -> int:
        """Return the id of the scene that a plan with this seed and purpose is made in.

        The systems of a sequence take turns. To a callable each plan's scene is a new one.
        """
        if self._systems is not None:
            return plan % len(self._systems)
        of_scene = plan_seeds(seed, plan, purpose)[2]
        # Ids are stored as int64.
        return int(of_scene.generate_state(1, np.uint64)[0] >> np.uint64(1))

    def source(self, scene: int) -> System | Callable[[int], System]:
        """Return the system of a scene, or the callable that makes it of the scene's id."""
        if self._systems is None:
            return self._given  # type: ignore[return-value]
        return self._systems[0 if self.is_single else scene]

    def system(self, scene: int) -> System:
        """Return the system of a scene."""
        source = self.source(scene)
        if isinstance(source, System):
            return source
        made = source(scene)
        if not isinstance(made, System):
            raise ValueError(
                f"system must return a System for the random_state {scene}, got {made!r}."
            )
        return made

    def check_ids(self, scenes: NDArray[np.int64]) -> None:
        """Raise ``ValueError`` if there are no systems for some ids."""
        if self.is_single and len(scenes) > 1:
            raise ValueError(
                f"The transitions are of {len(scenes)} scenes and system is one System. Give the "
                "sequence or the callable that they were collected from, or select one scene's."
            )
        if self._systems is not None and not self.is_single:
            unknown = scenes[(scenes < 0) | (scenes >= len(self._systems))]
            if len(unknown):
                raise ValueError(
                    f"The transitions are of scene {unknown[0]}, and system is a sequence of "
                    f"{len(self._systems)}."
                )

    def describe(self) -> Any:
        """Describe the family for a manifest."""
        if self._systems is None:
            return {"system": describe(self._given), "code": code_digest(type(self._given))}
        described = [describe(one) for one in self._systems]
        if len(described) > _MOST_IN_WORDS:
            described = [digest_of(canonical_json(one)) for one in described]
        kinds = dict.fromkeys(type(one) for one in self._systems)
        code = {kind.__qualname__: code_digest(kind) for kind in kinds}
        return {"system": described[0] if self.is_single else described, "code": code}

    def check_planner(self, planner: Any) -> None:
        """Raise ``ValueError`` if a planner can't plan, or has a system of another family."""
        if isinstance(planner, type) or not callable(getattr(planner, "plan", None)):
            raise ValueError(f"planner must have the method plan, got {planner!r}.")
        own = getattr(planner, "system", None)
        if own is not None and not self.has(own):
            raise ValueError(
                f"planner has the system {own!r}, which is not one of those that system gives. "
                "Make it with one of these, or with None: each plan's system is set."
            )

    def has(self, system: System) -> bool:
        """Say whether a system is one of the family, as far as can be told.

        Of a callable, any system of the class that it returns may be.
        """
        if self._systems is None:
            return type(self.system(0)) is type(system)
        if any(one is system for one in self._systems):
            return True
        alike = [one for one in self._systems if type(one) is type(system)]
        return bool(alike) and describe(system) in [describe(one) for one in alike]


def plan_seeds(seed: int, plan: int, purpose: tuple[int, ...] = ()) -> list[np.random.SeedSequence]:
    """Return the seeds of a plan's problem, of its planner and of its scene.

    Parameters
    ----------
    seed : int
    plan : int
        The plan's number.
    purpose : tuple of int, default=()
        Plans for another purpose than collection, such as evaluation, have other seeds.
    """
    return np.random.SeedSequence(seed, spawn_key=(*purpose, plan)).spawn(3)
