"""The methods by name, and one image in one line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from atra.alignment.aligned import AlignedTracer
from atra.alignment.visible_first import VisibleFirstTracer
from atra.choices import check_choice
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.packets.pixel import PixelTracer
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer

METHODS: Mapping[str, Callable[..., Tracer]] = {
    "raster": RasterTracer,
    "pixel": PixelTracer,
    "aligned": AlignedTracer,
    "visible_first": VisibleFirstTracer,
}
"""Makers of tracers by the method's name."""


def trace(
    mesh: Mesh, camera: View, method: str = "raster", *, offset: tuple[float, float] = (0.5, 0.5), **options: Any
) -> Hits:
    """Find the nearest hit of every pixel's ray of one image.

    Parameters
    ----------
    mesh, camera :
        What is seen, and by which rays.
    method : {"raster", "pixel", "aligned", "visible_first"}
        How; the images agree. "raster" is the fastest and takes every camera.
    offset : (float, float)
        All rays go through this sub-pixel position of their pixels, in [0, 1) x [0, 1).
    options :
        Keyword arguments of the method's tracer, such as `threads`, `ties`, or `split` for aligned rays.

    Returns
    -------
    Hits
        Depth (H, W) float32 and `prim_id` (H, W) uint32.

    Raises
    ------
    InputError
        For an unknown method, and what the tracer refuses.
    TypeError
        For an option that the method does not have.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera(eye=(0.2, 0.2, 2), target=(0.2, 0.2, 0), width=3, height=3)
    >>> float(atra.trace(mesh, camera).depth[1, 1])
    2.0
    """
    check_choice("method", method, tuple(METHODS))
    with METHODS[method](mesh, camera, **options) as tracer:
        return tracer.trace(offset)
