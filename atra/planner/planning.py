"""Plan a view: the entry to the planner."""

from __future__ import annotations

from math import inf

import numpy as np

from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.exact.ties import coplanar_overlaps
from atra.geometry.camera import Camera
from atra.geometry.lenses.models import bends_rays
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import as_number
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.view import View
from atra.planner.choice import Choice, candidates
from atra.planner.measuring import clock_for, measure
from atra.planner.plan import MOST, Plan
from atra.tracing.options import check_ties
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number

FEWEST_FRAMES = 16
"""Below so many, nothing can pay that is built: a BVH takes as long as the rasteriser's frames, however small triangles
are."""


def plan(
    mesh: Mesh,
    camera: View,
    frames: int = 64,
    budget_s: float = 2.0,
    threads: int | None = None,
    ties: str = "lowest",
    memory_budget_bytes: int | None = None,
) -> Plan:
    """The method, split, packets and build quality that trace so many frames of a view soonest, by measurement.

    Builds and times candidates, the rasteriser first, for about budget_s seconds and no longer than that may save;
    another method must gain 2 %. Below `FEWEST_FRAMES` frames it is the rasteriser, and nothing is tried.

    threads: None takes every core. With one thread budget_s is of its processor time, so that what other processes do
    does not count, else of the wall clock (`clock_for`). Not on the budget: compiling kernels, and finding what is
    kept with the mesh, which are the triangles that overlap in one plane or have no area.
    ties: as for the tracers; the plan's tracer takes the same. memory_budget_bytes: leave out what needs more (None:
    the memory that is free).

    Raises InputError for a camera with a lens, frames below 1 or above 2^53, a budget that is not positive, threads
    below 1 and unknown ties; MemoryBudgetError, for "lowest", where more triangles overlap than can be kept.
    Source: after FFTW's planner (Frigo, Johnson 2005).
    """
    if not is_whole_number(frames) or not 1 <= frames <= MOST:
        raise InputError(f"frames is {frames!r}, expected a whole number of at least 1 and at most 2^53")
    if not 0 < as_number(budget_s) < inf:
        raise InputError(f"budget_s is {budget_s!r}, expected a positive number of seconds")
    check_ties(ties)
    if camera.lens is not None:
        raise InputError(f"a plan is for rays through a regular grid on a plane, but {bends_rays(camera.lens)}")
    frames, threads = int(frames), resolve_threads(threads)
    choices = candidates(camera)
    if frames < FEWEST_FRAMES:
        return Plan(frames, threads, camera.width, camera.height, choices[0], ties=ties)
    # No choice is to pay for what is kept with the mesh.
    _ = mesh.without_area
    if ties == "lowest":
        coplanar_overlaps(mesh)

    def make(choice: Choice) -> Tracer:
        warm_up(choice, camera, threads, ties)
        return choice.tracer(mesh, camera, threads, ties, memory_budget_bytes)

    tried = measure(choices, make, frames=frames, budget_s=as_number(budget_s), clock=clock_for(threads))
    return Plan(frames, threads, camera.width, camera.height, tried[0].choice, tuple(tried), ties)


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
