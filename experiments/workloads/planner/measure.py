"""Plans, and every candidate beside them in the same rounds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from statistics import median
from typing import Any

from atra.errors import MemoryBudgetError
from atra.planner.choice import Choice, choices_of_quality
from atra.planner.measuring import clock_for
from atra.planner.plan import EFFORTS, Plan
from atra.planner.planning import plan, warm_up
from atra.tracers import Tracer
from experiments.harness.point import Point
from experiments.harness.rounds import measure_rounds
from experiments.workloads.rounds import load_mesh, measured
from experiments.workloads.workload import Measured

FRAMES = 64
"""What a view is planned for."""

BUILDS = 2
"""How often every candidate plans and builds; the later ones find memory that has been used before."""


def measure(point: Point) -> Measured:
    """Plan with every effort, then time every candidate.

    Times are those of the planner's own clock, `atra.planner.measuring.clock_for`. Candidates that do not fit into the
    point's memory budget are left out, as the planner does; raises MemoryBudgetError if one that was planned does not.
    """
    mesh, camera = load_mesh(point), point.camera
    plans, planning_s = {}, {}
    threads = plan(mesh, camera, FRAMES, threads=point.threads).threads
    options: dict[str, Any] = {"ties": point.ties, "memory_budget_bytes": point.tracing.memory_budget_bytes}
    clock = clock_for(threads)
    for choice in choices_of_quality(camera, "medium"):  # compiled before any clock starts
        warm_up(choice, camera, threads, point.ties)
    for effort in EFFORTS:
        begin = clock()
        plans[effort] = plan(mesh, camera, FRAMES, effort, threads=threads, **options)
        planning_s[effort] = clock() - begin
    with ExitStack() as stack:
        first_s, frames = {}, {}
        for choice in timed_choices(point, plans):
            try:
                tracer = stack.enter_context(choice.tracer(mesh, camera, threads, **options))
            except MemoryBudgetError:
                if any(choice == one.choice for one in plans.values()):
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
    packets = choices[0]
    first = {str(choice): median(samples) for choice, samples in first_s.items()}
    results: dict[str, Any] = {
        "threads": threads,
        "packet_width": packets.packet_width,
        "candidates": [asdict(choice) | {"name": str(choice), "first_s": first_s[choice]} for choice in choices],
        "plans": {effort: asdict(one) for effort, one in plans.items()},
    }
    frame = {name: median(samples) for name, samples in timed.samples.items()}
    results |= regrets(first, frame, str(packets), {effort: str(one.choice) for effort, one in plans.items()})
    for effort in EFFORTS:
        results |= {
            f"{effort}_planning_time_s": planning_s[effort],
            f"{effort}_predicted_time_s": plans[effort].predicted_time_s,
        }
    return measured(results, timed)


def timed_choices(point: Point, plans: dict[str, Plan]) -> list[Choice]:
    """Packets first, then everything of medium build quality, and of the point's quality where that is another, from
    which the model learns what it changes."""
    qualities = dict.fromkeys(["medium", point.build_quality])
    choices = [choice for quality in qualities for choice in choices_of_quality(point.camera, quality)]
    return list(dict.fromkeys([*choices, *(one.choice for one in plans.values())]))


def regrets(
    first_s: dict[str, float], frame_time_s: dict[str, float], packets: str, planned: dict[str, str]
) -> dict[str, Any]:
    """How the choices of plans compare with the best and with packets.

    first_s, frame_time_s: by name of the choice. planned: the name that each effort chose.
    Returns, for each effort, `<effort>_plan`, and the ratios `_frame_regret` (frame time / the shortest of any),
    `_regret` (total of `FRAMES` frames / the smallest of any), `_vs_packets` (total / that of packets), and, of both
    kinds, which choice was best.
    """
    total_s = {name: first_s[name] + (FRAMES - 1) * frame_time_s[name] for name in first_s}
    best, best_frame = min(total_s, key=total_s.__getitem__), min(frame_time_s, key=frame_time_s.__getitem__)
    results: dict[str, Any] = {
        "best_plan": best,
        "best_frame_plan": best_frame,
        "packets_regret": total_s[packets] / total_s[best],
    }
    for effort, name in planned.items():
        results |= {
            f"{effort}_plan": name,
            f"{effort}_frame_regret": frame_time_s[name] / frame_time_s[best_frame],
            f"{effort}_regret": total_s[name] / total_s[best],
            f"{effort}_vs_packets": total_s[name] / total_s[packets],
        }
    return results


def _repeated(tracer: Tracer, clock: Callable[[], float]) -> tuple[list[float], Callable[[], object]]:
    """Samples of plan, build and first frame together, and a call that traces another frame."""
    samples = []
    image = None
    for _ in range(BUILDS):
        begin = clock()
        tracer.plan()
        tracer.build()
        image = tracer.trace()
        samples.append(clock() - begin)

    def frame() -> None:
        tracer.trace(out=image)

    return samples, frame
