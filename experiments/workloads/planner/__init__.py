"""Workload `planner`: how much a plan loses against the best of all candidates, timed in the same rounds."""

from __future__ import annotations

from atra.planner.choice import PACKETS
from experiments.harness.column import REAL, TEXT, WHOLE, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload
from experiments.harness.records import Record


def _headline(record: Record) -> str:
    return f"{record.results['plan']}, regret {record.results['regret']:.2f}"


PLANNER = Workload(
    name="planner",
    options=NoOptions,
    columns=(
        Column("plan", TEXT, "what was chosen"),
        Column("regret", REAL, "its total of plan, build and all frames / that of the best candidate"),
        Column("regret_with_planning", REAL, "the same, with the time that choosing took added to the choice's total"),
        Column("pays_from_frames", WHOLE, "frames from which on planning and its choice take less time than packets"),
        Column("frame_regret", REAL, "its frame / the shortest of any"),
        Column("vs_packets", REAL, "its total / that of packets"),
        Column("predicted_time_s", REAL, "the total that was predicted"),
        Column("planning_time_s", REAL, "how long choosing took"),
        Column("best_plan", TEXT, "the candidate with the smallest total"),
        Column("best_frame_plan", TEXT, "the candidate with the shortest frame"),
        Column("packets_regret", REAL, "total of packets / that of the best candidate"),
    ),
    headline=_headline,
    room=__name__,
    samples=None,
    judged=PACKETS,
)
