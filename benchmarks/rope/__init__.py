"""The paper's rope: ``python -m benchmarks.rope`` and ``python -m benchmarks.rope.table1``."""
