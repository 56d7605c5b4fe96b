"""Whether plans are as likely to go well as their ``success_probability`` says.

Run as ``python -m benchmarks.plan_worth``. For each system, some plans are executed to fit
:class:`planners.SuccessCalibration`, others to choose ``min_success`` so that 80 % and 90 % of the
accepted plans succeed, and others again to measure on. It prints a table and draws a reliability
diagram for each system. With ``--restarts`` it also counts what planning again, up to that many
times, does for success. Each executed plan is kept in ``--out``, so that a run that was interrupted
goes on. The car's classifier is the one that ``make car`` trains.
"""

from __future__ import annotations

import argparse
import copy
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.calibration_error import N_BINS, bin_of, calibration_error
from benchmarks.plan_worth.executed_plans import Outcome, executed_plans
from benchmarks.plan_worth.measured_systems import SYSTEMS
from benchmarks.plan_worth.measures import HEAD, Worth, split
from planners import Share, SuccessCalibration

# Plans less likely to go well are made again.
ENOUGH = 0.9
N_RESTART_PROBLEMS = 100


def main(arguments: list[str] | None = None) -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", nargs="+", choices=SYSTEMS, default=list(SYSTEMS))
    parser.add_argument("--plans", type=int, nargs=3, help="to fit, for a threshold, to measure")
    parser.add_argument("--restarts", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("build/plan_worth"))
    options = parser.parse_args(arguments)
    worth = {name: measure(name, options) for name in options.systems}
    print("\n".join([HEAD, *(one.row(name) for name, one in worth.items())]))
    draw(worth, options.out / "plan_worth.png")
    print(f"The picture is in {options.out}.")
    if options.restarts:
        for name in options.systems:
            compare_restarts(name, options)


def measure(name: str, options: argparse.Namespace) -> Worth:
    """Fit a calibration to a system's plans, and measure it on others."""
    n_fit, n_threshold, n_unseen = options.plans or SYSTEMS[name].n_plans
    n_seen = n_fit + n_threshold
    outcomes = _outcomes(name, options, range(n_seen + n_unseen))
    calibration = SuccessCalibration().fit(*split(outcomes[:n_fit]))
    return Worth.of(calibration, outcomes[n_fit:n_seen], outcomes[n_seen:])


def compare_restarts(name: str, options: argparse.Namespace) -> None:
    """Print how many plans succeed without and with planning again, distrusted ones as well."""
    n_fit, *others = options.plans or SYSTEMS[name].n_plans
    numbers = range(n_fit + sum(others), n_fit + sum(others) + N_RESTART_PROBLEMS)
    calibration = SuccessCalibration().fit(*split(_outcomes(name, options, range(n_fit))))
    once = _outcomes(name, options, numbers)
    again = _outcomes(
        name,
        options,
        numbers,
        calibration=calibration,
        min_success=ENOUGH,
        restarts=options.restarts,
    )
    for label, outcomes in (("once", once), ("with restarts", again)):
        share = Share.of(sum(one.succeeded for one in outcomes), len(outcomes))
        trusted = [one.succeeded for one in outcomes if one.plan.success]
        times = [one.plan.planning_time + one.plan.simplification_time for one in outcomes]
        print(
            f"{name}, {label}: {share} succeed; of those that the planner trusts "
            f"{Share.of(sum(trusted), len(trusted))}; {np.mean(times):.2f} s a problem"
        )
    won = sum(b.succeeded and not a.succeeded for a, b in zip(once, again, strict=True))
    lost = sum(a.succeeded and not b.succeeded for a, b in zip(once, again, strict=True))
    print(f"{name}: restarts win {won} problems and lose {lost}.")


def _outcomes(
    name: str, options: argparse.Namespace, numbers: range, **parameters: Any
) -> list[Outcome]:
    measured, folder = SYSTEMS[name], options.out / name
    folder.mkdir(parents=True, exist_ok=True)
    planner = copy.copy(measured.planner)
    planner.set_params(estimator=measured.classifier(folder, options.jobs), **parameters)
    plans = folder / ("plans-with-restarts" if parameters else "plans")
    return executed_plans(name, planner, numbers, plans, options.jobs)


def draw(worth: dict[str, Worth], path: Path) -> None:
    """Draw a reliability diagram for each system."""
    figure, axes = plt.subplots(
        1, len(worth), figsize=(2.9 * len(worth), 3.3), layout="constrained", squeeze=False
    )
    for axis, (name, one) in zip(axes[0], worth.items(), strict=True):
        axis.plot([0, 1], [0, 1], ":", color="0.6")
        for label, probability, color in (
            ("product of reliabilities", one.product, "tab:orange"),
            ("calibrated", one.probability, "tab:blue"),
        ):
            _draw_curve(axis, probability, one.succeeded, label, color)
        error = calibration_error(one.probability, one.succeeded)
        axis.set(title=f"{name}: {len(one.succeeded)} plans, ECE {error:.3f}")
        axis.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.06), xlabel="probability of success")
        axis.title.set_fontsize("medium")
    axes[0, 0].set_ylabel("share that succeeds")
    axes[0, 0].legend(fontsize="small", loc="lower right")
    figure.savefig(path, dpi=110)


def _draw_curve(
    axis: Any, probability: np.ndarray, succeeded: np.ndarray, label: str, color: str
) -> None:
    bins = bin_of(probability)
    middles, shares = [], []
    for number in range(N_BINS):
        inside = bins == number
        if inside.any():
            middles.append(float(probability[inside].mean()))
            shares.append(Share.of(int(succeeded[inside].sum()), int(inside.sum())))
    observed = np.array([share.n / share.total for share in shares])
    # Rounding may put an interval's end a hair inside the share itself.
    below = np.maximum(observed - [share.low for share in shares], 0)
    above = np.maximum([share.high for share in shares] - observed, 0)
    axis.errorbar(
        middles, observed, [below, above], fmt="o-", ms=4, lw=1, capsize=2, color=color, label=label
    )


if __name__ == "__main__":
    main()
