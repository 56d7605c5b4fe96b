"""A car, planned for as if it could move in any direction (the paper's illustrative example)."""
