"""Workload `surface`: frames with barycentric weights and normals, which Embree returns with every packet and aligned
tracers compute on demand."""

from __future__ import annotations

from statistics import median

from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, over, series
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_ms

OWN_SURFACE, PLAIN_PACKETS, PACKETS_SURFACE = "own_surface", "packets", "packets_surface"
"""Names in the samples: the point's own method and then u, v and normals on demand; packets per pixel without them, and
with those that Embree returns stored beside."""


def _headline(record: Record) -> str:
    own, surface = (median(record.samples[name]) for name in (OWN, OWN_SURFACE))
    packets, stored = (median(record.samples[name]) for name in (PLAIN_PACKETS, PACKETS_SURFACE))
    return f"{say_ms(own)}, with u, v and normals {say_ms(surface)}; packets {say_ms(packets)} and {say_ms(stored)}"


_own, _surface, _packets, _stored = map(series, (OWN, OWN_SURFACE, PLAIN_PACKETS, PACKETS_SURFACE))

SURFACE = Workload(
    name="surface",
    options=NoOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *statistics_columns("render_time{}_s", "one frame", _own),
        *statistics_columns("surface_time{}_s", "one frame, and u, v and normals on demand", _surface),
        *statistics_columns("packets_time{}_s", "the widest packets per pixel", _packets),
        *statistics_columns("packets_surface_time{}_s", "the widest packets, storing u, v and normals", _stored),
        *statistics_columns("surface_over_frame{}", "with u, v and normals / without", over(_surface, _own)),
        *statistics_columns("packets_surface_over_frame{}", "the same of packets per pixel", over(_stored, _packets)),
        *statistics_columns(
            "speedup_vs_packets_with_surface{}", "packets / this, both with u, v and normals", over(_stored, _surface)
        ),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, OWN_SURFACE, PLAIN_PACKETS, PACKETS_SURFACE)),
    judged=OWN_SURFACE,
    needs=RESOURCES,
)  # fmt: skip
