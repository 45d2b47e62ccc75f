"""What the pages quote of sweep=views."""

from experiments.methods import find_method
from tests.quotations.quotation import TIMES, interval, of, table_row

_JOBS = {"camera_rays": "of a camera", "random_rays": "from anywhere to anywhere"}


def twenty_views(kept):
    """A mesh a row: triangles, how many times as fast the library is as each tracer of others, and the least share of
    pixels with the same triangle."""
    table = of(kept.points, job="views")
    methods = tuple(table["method"].unique())
    for triangles, of_mesh in table.groupby("triangles"):
        gains = (interval(of(of_mesh, method=method).iloc[0], "library_gain") for method in methods)
        yield table_row(f"{triangles:,}", *gains, f"{of_mesh['ids_equal'].min():.5f}")
    yield from (f"{TIMES} {find_method(method).label}" for method in methods)


def million_rays(kept):
    """A mesh a row: triangles, and for rays of every kind how many times as fast the library is as embreex."""
    for triangles, of_mesh in of(kept.points, method="embreex").groupby("triangles"):
        gains = (interval(of(of_mesh, job=job).iloc[0], "library_gain") for job in _JOBS)
        yield table_row(f"{triangles:,}", *gains)
    yield from _JOBS.values()
