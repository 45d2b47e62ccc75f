"""Gathering: the part of a tracer that makes one number, or a few, of all hits along each ray."""

from __future__ import annotations

from typing import Any

import numpy as np

from atra.errors import InputError
from atra.gathering.plain import gather_plainly
from atra.gathering.reductions import Gathered, Reduction, check_reduction
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.lifetime import Lifetime


class Gathering(Lifetime):
    """A tracer of one image whose rays are not stopped by what they hit."""

    mesh: Mesh
    camera: View
    options: Any

    def gather(
        self, what: Reduction[Gathered], offset: tuple[float, float] = (0.5, 0.5), out: Gathered | None = None
    ) -> Gathered:
        """Gather `what`, such as `atra.Count()`, of all hits along the ray of every pixel, each exactly once.

        offset: all rays go through this sub-pixel position of their pixels, in [0, 1) x [0, 1). out: an earlier result
        of this tracer for as much of the same, whose arrays are to be overwritten; it must not be read any more.
        Which triangles a ray crosses at edges and corners: `atra.gathering.reductions`.
        Raises InputError for an offset outside the pixel, an `out` that does not fit, a mesh that `what` is not for,
        and build quality "high", with which Embree finds some triangles twice; EmbreeError when the tracer is not built
        or already closed.
        """
        check_reduction(what)
        check_offset(offset)
        if getattr(self.options, "build_quality", "medium") == "high":
            raise InputError(
                "build_quality is 'high', which cuts triangles in two and would count them twice; gather with 'medium'"
            )
        with self._tracing():
            found = gather_plainly(self.mesh, self.camera, what, offset)
            return found if out is None else _moved(found, out, what)


def _moved(found: Gathered, out: Gathered, what: Reduction[Gathered]) -> Gathered:
    if type(out) is not what.result:
        raise InputError(f"out is {out!r:.100}, expected {what.result.__name__} of this tracer, or None")
    for name in what.planes():
        given, wanted = getattr(out, name), getattr(found, name)
        if given.shape != wanted.shape:
            raise InputError(f"out has {name} of {given.shape}, expected {wanted.shape}: pass a result of this tracer")
        np.copyto(given, wanted)
    arrays = {name: getattr(out, name) for name in what.planes()}
    return what.result(**arrays, offset=found.offset, mesh=found.mesh, camera=found.camera)


class NoGathering:
    """A tracer that cannot gather all hits; `why_not` says why."""

    why_not: str

    def gather(self, what: Any, offset: tuple[float, float] = (0.5, 0.5), out: Any = None) -> Any:
        """Raises InputError: this tracer never meets all hits along a ray."""
        raise InputError(
            f"{type(self).__name__} cannot gather: {self.why_not}; use PixelTracer, AlignedTracer or RasterTracer"
        )
