"""Memory of a point's own method, read while nothing else is in the process, and its preparation."""

from __future__ import annotations

from typing import NotRequired, TypedDict

from experiments.harness.records import Record
from experiments.workloads.typed import Mean, Unlisted


class Resources(TypedDict):
    """What every point tells whose own method was built."""

    packet_width: int
    triangles_traced: int
    rss_start_bytes: int
    rss_mesh_bytes: int
    rss_bytes: int
    peak_rss_bytes: int
    embree_bytes: NotRequired[int]
    threads: Unlisted


class Prepared(TypedDict):
    """Medians and samples of plan and build; the first samples are those of the first build."""

    plan_time_s: Mean
    build_time_s: Mean
    plan_samples_s: NotRequired[list[float]]
    build_samples_s: NotRequired[list[float]]


class Preparation(Prepared):
    """The same beside the build of single rays."""

    baseline_build_time_s: Mean


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
