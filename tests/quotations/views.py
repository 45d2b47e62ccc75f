"""What the pages quote of sweep=views."""

from __future__ import annotations

from experiments.methods import find_method
from tests.quotations.quotation import TIMES, Kept, Quoted, interval, of, table_row

_JOBS = {"camera_rays": "of a camera", "random_rays": "from anywhere to anywhere"}


def twenty_views(kept: Kept) -> Quoted:
    """A mesh a row: triangles, how many times as fast the library is as each tracer of others, and the least share of
    pixels with the same triangle."""
    table, rows = of(kept.points, job="views"), []
    methods = tuple(table["method"].unique())
    for triangles, of_mesh in table.groupby("triangles"):
        gains = (interval(of(of_mesh, method=method).iloc[0], "library_gain") for method in methods)
        rows.append(table_row(f"{triangles:,}", *gains, f"{of_mesh['ids_equal'].min():.5f}"))
    heads = tuple(f"{TIMES} {find_method(method).label}" for method in methods)
    return Quoted(rows=tuple(rows), phrases=heads)


def million_rays(kept: Kept) -> Quoted:
    """A mesh a row: triangles, and for rays of every kind how many times as fast the library is as embreex."""
    rows = []
    for triangles, of_mesh in of(kept.points, method="embreex").groupby("triangles"):
        gains = (interval(of(of_mesh, job=job).iloc[0], "library_gain") for job in _JOBS)
        rows.append(table_row(f"{triangles:,}", *gains))
    return Quoted(rows=tuple(rows), phrases=tuple(_JOBS.values()))
