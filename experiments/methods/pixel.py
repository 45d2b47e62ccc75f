"""Method `pixel`: one ray per pixel, single or in packets; what every other method is measured against."""

from __future__ import annotations

from dataclasses import dataclass

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracers import PixelTracer
from experiments.drawing.style import GREEN
from experiments.methods.method import Method, Style, Tracing, check_packet_width, option


@dataclass(frozen=True)
class PixelOptions:
    """packet_width: None = the widest native packets."""

    packet_width: int | None = option(None, "rays in a packet; 1 = rtcIntersect1, null = the widest native packets")

    def __post_init__(self) -> None:
        check_packet_width(self.packet_width)


def make_pixel(mesh: Mesh, view: View, options: PixelOptions, tracing: Tracing) -> PixelTracer:
    """One ray per pixel; packets of 1 are `rtcIntersect1`."""
    return PixelTracer(mesh, view, packet_width=options.packet_width, **tracing.ours)


def _words(packet_width: int | None) -> str:
    if packet_width is None:
        return "one ray per pixel"
    return "rtcIntersect1 per pixel" if packet_width == 1 else f"packets of {packet_width} per pixel"


PIXEL = Method("pixel", "one ray per pixel", Style(GREEN, "v"), PixelOptions, make_pixel, words=_words)
