"""Memory of a point's own method, read while nothing else is in the process, and its preparation."""

from __future__ import annotations

from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.records import Record

RESOURCES = ("triangles_traced", "packet_width", "threads", "rss_bytes", "peak_rss_bytes")
"""Results of every point whose own method was built."""

RESOURCE_COLUMNS = (
    Column("packet_width", WHOLE, "rays in a packet; 0 where another's tracer does not tell"),
    Column("triangles_traced", WHOLE, "triangles in the method's scenes, copies included"),
    Column("rss_start_bytes", WHOLE, "resident memory before the mesh"),
    Column("rss_mesh_bytes", WHOLE, "resident memory with the mesh"),
    Column("rss_bytes", WHOLE, "resident memory after the build"),
    Column("peak_rss_bytes", WHOLE, "largest resident memory since the mesh was loaded (Linux only)"),
    Column("embree_bytes", WHOLE, "Embree's memory, by its own account"),
)


PREPARATION = ("plan_time_s", "build_time_s", "baseline_build_time_s")
"""Results of a workload whose preparation is timed."""

PREPARATION_COLUMNS = (
    Column("plan_time_s", REAL, "plan: culling and shear"),
    Column("build_time_s", REAL, "BVH build"),
    Column("baseline_build_time_s", REAL, "BVH build of the plain mesh"),
)


def say_ms(seconds: float) -> str:
    return f"{seconds * 1e3:,.1f} ms"


def say_mib(count: float) -> str:
    return f"{count / 2**20:,.1f} MiB"


def say_memory(record: Record) -> str:
    """ "12.3 MiB in Embree", or what is resident where a peer does not tell, and wrong pixels if images were
    compared."""
    stored, wrong = record.results.get("embree_bytes"), record.results.get("pixels_wrong")
    parts = [] if stored is None else [f"{say_mib(stored)} in Embree"]
    parts += [] if wrong is None else [f"{wrong} pixels wrong"]
    return ", ".join(parts) or f"{say_mib(record.results['rss_bytes'])} resident"
