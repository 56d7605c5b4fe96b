"""Collections on Dask's and Ray's joblib backends have the bytes of one in series.

Both start clusters on this machine, and are skipped where they are not installed.
"""

import os
import sys

import joblib
import pytest
from toy_systems import Disc

from planners import BiasedRRTConnect
from reliability import collect_transitions

# What they warn of while they start and stop is theirs.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


def collected(folder, n_jobs=None):
    """Return the files of a collection, by name."""
    collect_transitions(
        Disc(), BiasedRRTConnect(None), 12, n_jobs=n_jobs, random_state=1, path=folder
    )
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture
def in_series(tmp_path):
    return collected(tmp_path / "in-series")


def test_dask_collects_the_same_bytes(tmp_path, in_series):
    distributed = pytest.importorskip("distributed", reason="needs dask[distributed]")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster),
        joblib.parallel_config("dask"),
    ):
        assert collected(tmp_path / "dask", n_jobs=-1) == in_series


def test_ray_collects_the_same_bytes(tmp_path, in_series):
    ray = pytest.importorskip("ray", reason="needs ray")
    from ray.util.joblib import register_ray

    register_ray()
    # Ray's workers do not take over the path that pytest imports from.
    path = os.pathsep.join(filter(None, sys.path))
    environment = {"env_vars": {"PYTHONPATH": path}}
    ray.init(num_cpus=2, include_dashboard=False, runtime_env=environment)
    try:
        with joblib.parallel_config("ray"):
            assert collected(tmp_path / "ray", n_jobs=2) == in_series
    finally:
        ray.shutdown()
