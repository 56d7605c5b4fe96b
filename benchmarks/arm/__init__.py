"""The paper's arm experiment: run ``python -m benchmarks.arm``."""
