"""Tracers: mesh and camera in, hits out. One protocol, so that harness and comparison know only `Tracer`."""

from atra.tracers.aligned import AlignedTracer, FramesTracer
from atra.tracers.pixel import PixelTracer
from atra.tracers.raster import RasterTracer
from atra.tracers.reference_rays import choose_packet_shape
from atra.tracers.tiles import TiledTracer
from atra.tracers.tracer import Tracer
from atra.tracers.visible_first import VisibleFirstTracer

__all__ = [
    "AlignedTracer",
    "FramesTracer",
    "PixelTracer",
    "RasterTracer",
    "TiledTracer",
    "Tracer",
    "VisibleFirstTracer",
    "choose_packet_shape",
]
