"""Tracers: mesh and camera in, hits out. One protocol, so that harness and comparison know only `Tracer`."""

from atra.tracers.aligned import AlignedTracer, choose_packet_shape
from atra.tracers.base import Tracer
from atra.tracers.pixel import PixelTracer

__all__ = ["AlignedTracer", "PixelTracer", "Tracer", "choose_packet_shape"]
