"""Workload `planner`: how much a plan loses against the best of all candidates, timed in the same rounds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from math import floor
from statistics import median
from typing import Any

from atra.compiled.threads import resolve_threads
from atra.errors import MemoryBudgetError
from atra.exact.ties import coplanar_overlaps
from atra.planner.choice import PACKETS, candidates
from atra.planner.measuring import clock_for
from atra.planner.planning import plan, warm_up
from atra.tracing.tracer import Tracer
from experiments.harness.column import REAL, TEXT, WHOLE, Column
from experiments.harness.options import NoOptions
from experiments.harness.point import Measured, Point, Workload
from experiments.harness.records import Record
from experiments.harness.rounds import measure_rounds
from experiments.workloads.rounds import load_mesh, measured


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


FRAMES = 64
"""What a view is planned for."""

BUILDS = 2
"""How often every candidate plans and builds; the later ones find memory that has been used before."""


def measure(point: Point) -> Measured:
    """Plan, then time every candidate.

    Times are those of the planner's own clock, `atra.planner.measuring.clock_for`. Candidates that do not fit into the
    point's memory budget are left out, as the planner does; raises MemoryBudgetError if one that was planned does not.
    """
    mesh, camera = load_mesh(point), point.camera
    threads = resolve_threads(point.threads)
    options: dict[str, Any] = {"ties": point.ties, "memory_budget_bytes": point.tracing.memory_budget_bytes}
    if point.ties == "lowest":
        coplanar_overlaps(mesh)  # kept with the mesh, whoever traces it; no part of planning
    clock = clock_for(threads)
    for choice in candidates(camera):  # compiled before any clock starts
        warm_up(choice, camera, threads, point.ties)
    begin = clock()
    planned = plan(mesh, camera, FRAMES, threads=threads, **options)
    planning_s = clock() - begin
    with ExitStack() as stack:
        first_s, frames = {}, {}
        for choice in candidates(camera):
            try:
                tracer = stack.enter_context(choice.tracer(mesh, camera, threads, **options))
            except MemoryBudgetError:
                if choice == planned.choice:
                    raise
                continue
            first_s[choice], frames[choice] = _repeated(tracer, clock)
        choices = list(frames)
        timed = measure_rounds(
            {str(choice): frames[choice] for choice in choices},
            rounds=point.rounds,
            warmup=point.warmup,
            budget_s=point.frame_budget_s,
            clock=clock,
        )
    packets = next(choice for choice in choices if choice.method == PACKETS)
    first = {str(choice): median(samples) for choice, samples in first_s.items()}
    results: dict[str, Any] = {
        "threads": threads,
        "packet_width": packets.packet_width,
        "candidates": [asdict(choice) | {"name": str(choice), "first_s": first_s[choice]} for choice in choices],
        "planned": asdict(planned),
        "planning_time_s": planning_s,
        "predicted_time_s": planned.predicted_time_s,
    }
    frame = {name: median(samples) for name, samples in timed.samples.items()}
    return measured(results | regrets(first, frame, str(packets), str(planned.choice), planning_s), timed)


def regrets(
    first_s: dict[str, float], frame_time_s: dict[str, float], packets: str, planned: str, planning_s: float
) -> dict[str, Any]:
    """How the choice of a plan compares with the best and with packets.

    first_s, frame_time_s: by name of the choice. planned: the name of the one chosen. planning_s: what choosing took.
    Returns `plan`, which is that name, the ratios `frame_regret` (frame time / the shortest of any), `regret` (total of
    `FRAMES` frames / the smallest of any), `regret_with_planning` (planning counted, too), `packets_regret` (the same
    of packets), `vs_packets` (total / that of packets), of both kinds which choice was best, and `pays_from_frames`:
    from how many frames on planning and what was planned have taken less time than packets, None = never.
    """
    total_s = {name: first_s[name] + (FRAMES - 1) * frame_time_s[name] for name in first_s}
    best, best_frame = min(total_s, key=total_s.__getitem__), min(frame_time_s, key=frame_time_s.__getitem__)
    return {
        "best_plan": best,
        "best_frame_plan": best_frame,
        "packets_regret": total_s[packets] / total_s[best],
        "plan": planned,
        "frame_regret": frame_time_s[planned] / frame_time_s[best_frame],
        "regret": total_s[planned] / total_s[best],
        "regret_with_planning": (planning_s + total_s[planned]) / total_s[best],
        "pays_from_frames": _pays_from(
            planning_s + first_s[planned] - first_s[packets], frame_time_s[packets] - frame_time_s[planned]
        ),
        "vs_packets": total_s[planned] / total_s[packets],
    }


def _pays_from(behind_s: float, gain_s: float) -> int | None:
    """The frames from which on it is ahead, `behind_s` after the first one and gaining so much with every further."""
    if gain_s <= 0:
        return None
    return 1 if behind_s < 0 else floor(behind_s / gain_s) + 2


def _repeated(tracer: Tracer, clock: Callable[[], float]) -> tuple[list[float], Callable[[], object]]:
    """Samples of plan, build and first frame together, and a call that traces another frame."""
    samples = []
    image = None
    for _ in range(BUILDS):
        begin = clock()
        tracer.build()
        image = tracer.trace()
        samples.append(clock() - begin)

    def frame() -> None:
        tracer.trace(out=image)

    return samples, frame
