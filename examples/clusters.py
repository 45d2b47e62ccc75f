"""Executors of Dask and Ray, here on this machine, for `atra.render_views` and whatever else submits to executors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any


class RayExecutor(Executor):
    """Every call is a task of Ray, which must have been started."""

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        import ray

        return ray.remote(call).remote(*arguments, **named).future()  # type: ignore[no-any-return]


@contextmanager
def local_dask(workers: int) -> Iterator[Executor]:
    """A cluster of processes on this machine; of another, `Client("tcp://...")` instead."""
    from dask.distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client.get_executor()


@contextmanager
def local_ray(workers: int) -> Iterator[Executor]:
    """Ray on this machine; of a cluster, `ray.init(address="auto")` instead."""
    import ray

    ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, object_store_memory=1 << 27)
    try:
        yield RayExecutor()
    finally:
        ray.shutdown()


CLUSTERS = {"dask": local_dask, "ray": local_ray}
