"""The paper's car, learned in random scenes: run ``python -m benchmarks.car``."""
