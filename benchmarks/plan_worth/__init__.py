"""What a plan is worth: run ``python -m benchmarks.plan_worth``."""
