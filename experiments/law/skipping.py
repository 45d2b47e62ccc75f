"""Points of a scene that are predicted to be slow; `sweep.skip_slower` skips them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from atra.embree.scene import resolve_packet_width
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from experiments.harness.point import Point
from experiments.harness.processes.worker import Unpromising
from experiments.law.model.choice import Choice
from experiments.law.model.forecasting import forecast, known_constants
from experiments.law.model.formulas import WANTS, family
from experiments.law.model.looking import Look, look_at
from experiments.methods.options import split_of

METHODS = ("raster", "pixel", "bvh", "tiles", "visible_first", "aligned")
"""Methods of the harness whose points are predicted."""


def choice_of(point: Point) -> Choice | None:
    """What the cost model knows a point's method as; None where it knows nothing of it."""
    name, options = point.method.name, point.options
    if name not in METHODS or (name == "raster" and options != type(options)()):
        return None
    known_as = "instanced" if getattr(options, "geometry", None) == "instanced" else name
    width = resolve_packet_width(getattr(options, "packet_width", 1))
    split = split_of(options) if hasattr(options, "split_x") else (1, 1)
    return Choice(known_as, split, width, getattr(options, "culling", True))


def slow_points(points: Mapping[int, Point], mesh: Mesh, limit: float) -> dict[int, Unpromising]:
    """Those points of a scene that are predicted to take more than `limit` times as long a frame as the fastest of
    their view and workload, and why. What the model does not know is not among them.

    points: those that can be measured. Raises InputError for a limit below 1.
    """
    if not limit >= 1:
        raise InputError(f"sweep.skip_slower is {limit}, expected null or a number of at least 1")
    constants, looks = known_constants(), dict[Any, Look]()
    frames_s: dict[Any, dict[int, float]] = {}
    for place, point in points.items():
        camera, workload, choice = point.camera, point.workload.name, choice_of(point)
        want = WANTS.get(workload)
        if choice is None or want is None or family(choice, want) not in constants:
            continue
        if camera not in looks:
            looks[camera] = look_at(mesh, camera)
        predicted = forecast(looks[camera], choice, want, constants)
        frames_s.setdefault((camera, workload), {})[place] = predicted.frame_time_s
    return {
        place: Unpromising(
            f"predicted to take {1e3 * time_s:.3g} ms a frame, {time_s / min(of_view.values()):.3g} times as long as "
            f"the fastest of this view; sweep.skip_slower is {limit:g}"
        )
        for of_view in frames_s.values()
        for place, time_s in of_view.items()
        if time_s > limit * min(of_view.values())
    }
