"""Plan a view: the entry to the planner."""

from __future__ import annotations

from math import inf

import numpy as np

from atra.alignment.culling import check_memory_budget
from atra.errors import InputError, MemoryBudgetError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.view import View, as_number
from atra.judge.ties import coplanar_overlaps
from atra.options import CellOptions, check_ties
from atra.parallel import resolve_threads
from atra.planner.choice import ALIGNED, PACKETS, Choice, candidates
from atra.planner.estimate import estimate
from atra.planner.features import SceneStatistics, scene_statistics
from atra.planner.measuring import Clock, clock_for, measure
from atra.planner.plan import EFFORTS, MOST, Plan
from atra.tracers import Tracer
from atra.whole_numbers import is_whole_number

DEFAULT_BUDGET_S = 2.0


def plan(
    mesh: Mesh,
    camera: View,
    frames: int = 64,
    effort: str = "estimate",
    budget_s: float = DEFAULT_BUDGET_S,
    threads: int | None = 1,
    clock: Clock | None = None,
    ties: str = "lowest",
    memory_budget_bytes: int | None = None,
) -> Plan:
    """The method, split, packets and build quality that are expected to trace so many frames of a view soonest.

    effort: "estimate" looks at the triangles and builds nothing; "measure" builds and times candidates, packets first,
    for about budget_s seconds. Packets are chosen unless another method gains more than the estimate's uncertainty, or
    something by measurement. threads: None takes every core; an estimate knows one thread and trusts the ratios.
    clock: seconds, None takes the processor time of this thread where `threads` is 1, so that what other processes do
    does not count, and the wall clock otherwise (`clock_for`). Not on the budget: compiling kernels, and finding
    what is kept with the mesh, which are the triangles that overlap in one plane or have no area.
    ties: as for the tracers; the plan's tracer takes the same. Estimates are those of "lowest" always.
    memory_budget_bytes: leave out what is likely to need more (None: the memory that is free).

    Raises InputError for frames below 1 or above 2^53, an unknown effort, a budget that is not positive, threads below
    1 and unknown ties; MemoryBudgetError, when measuring "lowest", for more overlaps than can be kept.
    Source: the efforts are those of FFTW's planner (Frigo, Johnson 2005).
    """
    if not is_whole_number(frames) or not 1 <= frames <= MOST:
        raise InputError(f"frames is {frames!r}, expected a whole number of at least 1 and at most 2^53")
    if effort not in EFFORTS:
        raise InputError(f"effort is {effort!r}, expected one of {', '.join(EFFORTS)}")
    if not 0 < as_number(budget_s) < inf:
        raise InputError(f"budget_s is {budget_s!r}, expected a positive number of seconds")
    check_ties(ties)
    frames, threads = int(frames), resolve_threads(threads)
    choices = candidates(camera, frames)
    statistics = scene_statistics(mesh, camera, {choice.split[0] for choice in choices}, threads)
    choices = tuple(choice for choice in choices if _fits_into_memory(statistics, choice, memory_budget_bytes))
    forecasts = estimate(statistics, choices, frames)
    if effort == "measure":
        clock = clock or clock_for(threads)
        # No choice is to pay for what is kept with the mesh; the statistics have asked for triangles without area.
        if ties == "lowest":
            coplanar_overlaps(mesh)

        def make(choice: Choice) -> Tracer:
            warm_up(choice, camera, threads, ties)
            return choice.tracer(mesh, camera, threads, ties, memory_budget_bytes)

        forecasts = measure(forecasts, choices[0], make, frames=frames, budget_s=as_number(budget_s), clock=clock)
    return Plan(frames, effort, threads, camera.width, camera.height, tuple(forecasts), ties)


def _fits_into_memory(statistics: SceneStatistics, choice: Choice, budget_bytes: int | None) -> bool:
    """Whether the copies that a choice is likely to need fit into the budget and the memory that is free; packets
    always count."""
    if choice.method == PACKETS:
        return True
    nx, ny = choice.split
    copies = (statistics.copies if choice.method == ALIGNED else statistics.visible_copies)[nx]
    try:
        options = CellOptions(build_quality=choice.build_quality, memory_budget_bytes=budget_bytes)
        check_memory_budget(copies, nx * ny, options)
    except MemoryBudgetError:
        return False
    return True


def warm_up(choice: Choice, camera: View, threads: int, ties: str) -> None:
    """Trace a few triangles with the kernels that `choice` uses, so that none is compiled under the clock."""
    vertices = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    mesh = Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3), (0, 1, 3)], np.uint32))  # the last one ties with both
    nx, ny = choice.split
    # One cell of the image's own size: how packets fit into a cell decides which kernel is compiled.
    small: View = Camera(
        (0.0, 0.0, 2.0), (0.0, 0.0, 0.0), width=camera.width // nx, height=min(camera.height // ny, 16)
    )
    if camera.is_parallel:
        small = OrthographicCamera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), width=small.width, height=small.height)
    one_cell = Choice(choice.method, (1, 1), choice.packet_width, choice.packet_rows, choice.build_quality)
    with one_cell.tracer(mesh, small, threads, ties) as tracer:
        tracer.trace()
