"""Collecting labelled transitions by executing plans."""

from __future__ import annotations

import copy
import json
import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import joblib
import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from reliability.labels import label_transitions
from reliability.summary import Summary
from reliability.transitions import Transitions
from systems.errors import SimulationDivergedError
from systems.system import System
from systems.validation import RandomState, as_seed, check_count

FORMAT_VERSION = 1
PLANS_PER_SHARD = 50


class Planner(Protocol):
    """What collection asks of a planner: those of :mod:`planners` have it."""

    random_state: Any

    def plan(self, start_reduced: NDArray[np.float64], goal: NDArray[np.float64]) -> Any:
        """Return a result with ``success``, ``reduced`` and ``commands``."""


@dataclass(frozen=True)
class _Shard:
    """What a run of consecutive plans gave; None where no plan gave a transition."""

    transitions: Transitions | None
    n_unsolved: int
    n_diverged: int


def collect_transitions(
    system: System,
    planner: Planner,
    n_plans: int,
    *,
    n_jobs: int | None = None,
    random_state: RandomState = None,
    path: str | os.PathLike[str] | None = None,
    verbose: int = 0,
) -> Transitions:
    """Plan, execute and label, many times over.

    Each plan has a problem and a planner seed of its own, which follow from ``random_state`` and
    the plan's number alone. Transitions that the execution never came to are left out; plans
    that the planner doesn't solve or on which the simulator diverges are dropped, the latter
    with a warning.

    Parameters
    ----------
    system : System
    planner : BiasedRRT, BiasedRRTConnect or alike
        Without an estimator, for data as in the paper. Its own ``random_state`` is not used.
    n_plans : int
    n_jobs : int, default=None
        Processes, or whatever the active joblib backend has; the data do not depend on it.
    random_state : int, Generator, RandomState, SeedSequence or None
    path : path-like, default=None
        Folder to write to as plans are executed. A folder that an earlier, interrupted call with
        the same arguments wrote is completed.
    verbose : int, default=0
        1 shows a progress bar and prints a :class:`reliability.summary.Summary`, which can also
        be drawn.

    Returns
    -------
    Transitions
        In the order of the plans' numbers, which are their group ids.

    Raises
    ------
    ValueError
        If ``path`` holds data collected with other arguments, or no plan gave a transition.

    References
    ----------
    McConachie et al. 2020, "Data Generation and Labeling".
    """
    check_count(n_plans, "n_plans")
    store = None if path is None else _ShardFolder(Path(path))
    seed = as_seed(random_state)
    if store is not None:
        seed = store.open(_describe(system, planner, int(n_plans), seed), random_state is None)
    starts = range(0, n_plans, PLANS_PER_SHARD)
    done = {} if store is None else store.read(len(starts))
    missing = [i for i in range(len(starts)) if i not in done]
    tasks = (
        joblib.delayed(_collect_shard)(
            system, planner, seed, i, range(starts[i], min(starts[i] + PLANS_PER_SHARD, n_plans))
        )
        for i in missing
    )
    finished: Iterable[tuple[int, _Shard]] = joblib.Parallel(
        n_jobs=n_jobs, return_as="generator_unordered"
    )(tasks)
    with tqdm(total=len(starts), initial=len(done), unit="shard", disable=not verbose) as bar:
        for i, shard in finished:
            if store is not None:
                store.write(i, shard)
            done[i] = shard
            bar.update()
    return _joined([done[i] for i in range(len(starts))], int(n_plans), verbose)


def _describe(system: System, planner: Planner, n_plans: int, seed: int) -> dict[str, Any]:
    def named(thing: Any) -> str:
        return f"{type(thing).__module__}.{type(thing).__qualname__} {joblib.hash(thing)}"

    unseeded = copy.copy(planner)
    unseeded.random_state = None
    return {
        "format_version": FORMAT_VERSION,
        "system": named(system),
        "planner": named(unseeded),
        "n_plans": n_plans,
        "random_state": seed,
        "plans_per_shard": PLANS_PER_SHARD,
    }


def _collect_shard(
    system: System, planner: Planner, seed: int, shard: int, plans: range
) -> tuple[int, _Shard]:
    collected, n_unsolved, n_diverged = [], 0, 0
    for plan in plans:
        try:
            transitions = _execute_plan(system, planner, seed, plan)
        except SimulationDivergedError:
            n_diverged += 1
            continue
        if transitions is None:
            n_unsolved += 1
        else:
            collected.append(transitions)
    joined = Transitions.concatenate(collected) if collected else None
    return shard, _Shard(joined, n_unsolved, n_diverged)


def _execute_plan(system: System, planner: Planner, seed: int, plan: int) -> Transitions | None:
    problem_seed, planner_seed = np.random.SeedSequence(seed, spawn_key=(plan,)).spawn(2)
    problem = system.sample_problem(problem_seed)
    seeded = copy.copy(planner)
    seeded.random_state = int(planner_seed.generate_state(1)[0])
    result = seeded.plan(system.reduce(problem.start), problem.goal)
    if not result.success:
        return None
    rollout = system.rollout(problem.start, result.commands)
    executed = np.array([system.reduce(state) for state in rollout.states])
    n_attempted = len(executed) - 1
    return Transitions(
        reduced=result.reduced[:n_attempted],
        command=result.commands[:n_attempted],
        next_reduced=result.reduced[1 : n_attempted + 1],
        y=label_transitions(result.reduced, executed, system.close)[:n_attempted],
        plan=np.full(n_attempted, plan),
        step=np.arange(n_attempted),
    )


def _joined(shards: list[_Shard], n_plans: int, verbose: int) -> Transitions:
    n_unsolved = sum(shard.n_unsolved for shard in shards)
    n_diverged = sum(shard.n_diverged for shard in shards)
    if n_diverged:
        warnings.warn(
            f"{n_diverged} of {n_plans} plans were dropped because the simulator diverged.",
            stacklevel=3,
        )
    parts = [shard.transitions for shard in shards if shard.transitions is not None]
    if not parts:
        raise ValueError(
            f"None of {n_plans} plans gave a transition: {n_unsolved} were not solved and "
            f"{n_diverged} diverged. Give the planner more iterations, or look at the problems "
            "that the system samples."
        )
    transitions = Transitions.concatenate(parts)
    if verbose:
        print(
            f"{Summary.of(transitions)}\n"
            f"{n_unsolved} of {n_plans:,} plans were not solved, {n_diverged} diverged."
        )
    return transitions


class _ShardFolder:
    """A folder with a manifest and one file per finished shard."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def open(self, description: dict[str, Any], any_seed: bool) -> int:
        """Claim the folder for a description, or check it; return the seed to go on with."""
        manifest = self._folder / "manifest.json"
        if not manifest.exists():
            self._folder.mkdir(parents=True, exist_ok=True)
            partial = manifest.with_suffix(".partial")
            partial.write_text(json.dumps(description, indent=2) + "\n")
            os.replace(partial, manifest)
            return int(description["random_state"])
        found = json.loads(manifest.read_text())
        if any_seed:
            description = description | {"random_state": found.get("random_state")}
        differing = [key for key in description if found.get(key) != description[key]]
        if differing:
            changes = "; ".join(
                f"{key}: {found.get(key)} then, {description[key]} now" for key in differing
            )
            raise ValueError(
                f"path {self._folder} holds data collected with other arguments ({changes}); "
                "choose another path, or remove this one."
            )
        return int(found["random_state"])

    def read(self, n_shards: int) -> dict[int, _Shard]:
        """Read the finished shards."""
        found = {}
        for i in range(n_shards):
            if self._counts(i).exists():
                counts = json.loads(self._counts(i).read_text())
                rows = Transitions.load(self._rows(i)) if self._rows(i).exists() else None
                found[i] = _Shard(rows, **counts)
        return found

    def write(self, i: int, shard: _Shard) -> None:
        """Write one shard; its counts come last and mark it as finished."""
        if shard.transitions is not None:
            shard.transitions.save(self._rows(i))
        partial = self._counts(i).with_suffix(".partial")
        partial.write_text(
            json.dumps({"n_unsolved": shard.n_unsolved, "n_diverged": shard.n_diverged})
        )
        os.replace(partial, self._counts(i))

    def _rows(self, i: int) -> Path:
        return self._folder / f"shard-{i:05d}.npz"

    def _counts(self, i: int) -> Path:
        return self._folder / f"shard-{i:05d}.json"
