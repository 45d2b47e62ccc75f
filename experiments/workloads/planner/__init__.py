"""Workload `planner`: how much a plan loses against the best of all candidates, timed in the same rounds."""

from __future__ import annotations

from atra.planner.choice import PACKETS
from experiments.harness.column import REAL, TEXT, Column
from experiments.harness.records import Record
from experiments.workloads.workload import NoOptions, Workload

EFFORTS = ("estimate", "measure")


def _headline(record: Record) -> str:
    measured, estimated = (f"{record.results[f'{effort}_regret']:.2f}" for effort in ("measure", "estimate"))
    return f"{record.results['measure_plan']}, regret {measured}; estimated {estimated}"


PLANNER = Workload(
    name="planner",
    options=NoOptions,
    columns=(
        Column("best_plan", TEXT, "the candidate with the smallest total of plan, build and all frames"),
        Column("best_frame_plan", TEXT, "the candidate with the shortest frame"),
        Column("packets_regret", REAL, "total of packets / that of the best candidate"),
        *(
            column
            for effort in EFFORTS
            for column in (
                Column(f"{effort}_plan", TEXT, "what was chosen"),
                Column(f"{effort}_regret", REAL, "its total / that of the best candidate"),
                Column(f"{effort}_frame_regret", REAL, "its frame / the shortest of any"),
                Column(f"{effort}_vs_packets", REAL, "its total / that of packets"),
                Column(f"{effort}_predicted_time_s", REAL, "the total that was predicted"),
                Column(f"{effort}_planning_time_s", REAL, "how long choosing took"),
            )
        ),
    ),
    headline=_headline,
    room=__name__,
    samples=None,
    judged=PACKETS,
)
