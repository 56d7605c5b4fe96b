"""The paper's car, from no data to tables and pictures, in scenes never trained on.

Collects transitions in random scenes, in rounds, trains a classifier, and compares planners on
random queries in other random scenes: without the classifier, with it, and one that may execute
every transition that it considers. Then measures how noisy the labels are that the reduced state
allows. Everything goes to ``--out``; a run that was interrupted goes on after its last round.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from scipy.stats import binomtest

from benchmarks.car.compared_planners import BETA, PLANNERS, execute, plan_query
from benchmarks.car.label_noise import measure_noise, print_noise
from benchmarks.car.learning import learn
from benchmarks.car.pictures import draw_all, draw_calibration
from reliability import load_estimator
from systems import Car, CarScene, random_car_scene

TEST_SCENE_SEED, QUERY_SEED = 11, 12
# Per scene: a plan takes seconds.
CEILING_QUERIES = 2
SHIPPED = ("open_lot", "slalom", "narrow_gate")


def main(arguments: list[str] | None = None) -> None:
    """Run the experiment."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--plans", type=int, default=1500, help="of a round; four times in the first"
    )
    parser.add_argument("--validation", type=int, default=100, help="problems that compare rounds")
    parser.add_argument("--rounds", type=int, default=4, help="rounds of collecting, at most")
    parser.add_argument("--scenes", type=int, default=50, help="to look for pictures and noise in")
    parser.add_argument("--test-scenes", type=int, default=20, help="scenes to test in")
    parser.add_argument("--queries", type=int, default=10, help="queries per test scene")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--model", type=Path, help="an earlier run's car.joblib, to learn nothing")
    parser.add_argument("--out", type=Path, default=Path("build/car"))
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)

    classifier = load_estimator(options.model) if options.model else learned(options)
    joblib.dump(classifier, options.out / "car.joblib")
    draw_all(classifier, options.out, options.scenes)
    print(f"Pictures are in {options.out}.")
    unseen = [
        random_car_scene(np.random.SeedSequence([TEST_SCENE_SEED, i]))
        for i in range(options.test_scenes)
    ]
    results = {
        "Random scenes": experiment(unseen, classifier, options),
        "The three shipped scenes": experiment(
            [Car(name).scene for name in SHIPPED], classifier, options
        ),
    }
    for title, records in results.items():
        print_table(title, records)
    (options.out / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    noise = measure_noise(classifier, unseen, options.scenes)
    print_noise(noise, classifier.validation_accuracy_)
    draw_calibration(noise, options.out / "calibration.png")


def learned(options: argparse.Namespace) -> Any:
    """Learn in rounds."""
    path = options.out / "rounds"
    return learn(options.rounds, options.plans, options.validation, options.jobs, path)


def experiment(
    scenes: list[CarScene], classifier: Any, options: argparse.Namespace
) -> dict[str, list[dict[str, float]]]:
    """Answer the same queries with every planner; return a record per query and planner."""
    answered = joblib.Parallel(n_jobs=options.jobs)(
        joblib.delayed(answer)(scene, i, classifier, options.queries)
        for i, scene in enumerate(scenes)
    )
    return {name: [row for part in answered for row in part[name]] for name in PLANNERS}


def answer(
    scene: CarScene, number: int, classifier: Any, n_queries: int
) -> dict[str, list[dict[str, float]]]:
    """Plan and execute the queries of one scene."""
    car = Car(scene)
    records: dict[str, list[dict[str, float]]] = {name: [] for name in PLANNERS}
    for name in PLANNERS[:-1]:
        # Compiled code is loaded on first use, which is no part of planning.
        plan_query(name, scene, classifier, car.sample_problem(0), 0)
    for query in range(n_queries):
        problem = car.sample_problem(np.random.SeedSequence([QUERY_SEED, number, query]))
        for name in PLANNERS:
            if name == "ceiling" and query >= CEILING_QUERIES:
                continue
            result = plan_query(name, scene, classifier, problem, 1000 * number + query)
            records[name].append({"query": query, **execute(scene, problem, result)})
    return records


def print_table(title: str, results: dict[str, list[dict[str, float]]]) -> None:
    """Print successes with intervals, what became of the rest, and times."""
    print(f"\n{title}: success is within {BETA} (m, rad) of the goal")
    print(
        f"{'':15s} queries  success   95 % interval   hit  astray  no plan  transitions"
        "  median (ms)"
    )
    shared = [record for record in results["ours"] if record["query"] < CEILING_QUERIES]
    for name, records in (results | {"ours, same": shared}).items():
        n = len(records)
        hits = sum(record["hit"] for record in records)
        unsolved = sum(not record["solved"] for record in records)
        good = sum(record["distance"] < BETA for record in records)
        interval = binomtest(good, n).proportion_ci(method="wilson")
        length = sum(record["n_transitions"] for record in records) / max(1, n - unsolved)
        spent = np.median([record["milliseconds"] for record in records])
        print(
            f"{name:15s} {n:7d} {good / n:8.1%}  {interval.low:6.1%} - {interval.high:6.1%}"
            f" {hits:5d} {n - good - hits - unsolved:7d} {unsolved:8d} {length:12.1f}"
            f" {spent:12.1f}"
        )


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)
    main()
