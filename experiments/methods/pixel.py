"""Method `pixel`: one ray per pixel, single or in packets; what every other method is measured against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from experiments.drawing.style import GREEN, TIMES
from experiments.harness.method import BUILD_QUALITIES, Method, Style, Tracing
from experiments.harness.options import Settings, option
from experiments.methods.options import keywords_of, packet_width_option, robust_option

# The tracer is imported when one is made: the help of the command line has no time for it.
if TYPE_CHECKING:
    from atra.geometry.mesh import Mesh
    from atra.geometry.view import View
    from atra.tracing.tracer import Tracer

SAME = "same"
"""Build quality of its own BVH: that of the point, which the baselines beside it have, too."""


@dataclass(frozen=True)
class PixelOptions(Settings):
    """What an expert would try."""

    section = "method"
    packet_width: int | None = packet_width_option()
    robust: bool = robust_option()
    packet_rows: int | None = option(
        None, "rows of pixels in a packet; null = the squarest packet, and of two the wider", null="automatic"
    )
    coherent: bool = option(True, "Embree takes the rays of a packet through its tree together")
    compact: bool = option(False, "a BVH that saves memory")
    tile_order: str = option(
        "blocks",
        "which pixels follow each other: blocks of 32 x 16 row by row, rows as wide as the image, or 16 x 16 along a "
        "morton curve",
        choices=("blocks", "rows", "morton"),
    )
    own_build_quality: str = option(
        SAME, "build quality of the tracer's own BVH; same = build_quality", choices=(SAME, *BUILD_QUALITIES)
    )


def make_pixel(mesh: Mesh, view: View, options: PixelOptions, tracing: Tracing) -> Tracer:
    """One ray per pixel; packets of 1 are `rtcIntersect1`."""
    from atra.packets.pixel import PixelTracer

    changed = {} if options.own_build_quality == SAME else {"build_quality": options.own_build_quality}
    return PixelTracer(mesh, view, **keywords_of(PixelTracer, options, tracing) | changed)


def _words(packet_width: int | None) -> str:
    if packet_width is None:
        return "one ray per pixel"
    return "rtcIntersect1 per pixel" if packet_width == 1 else f"packets of {packet_width} per pixel"


def _variant(row: Mapping[str, Any]) -> str:
    """Whatever is not as it is by default."""
    rows, width = row.get("packet_rows"), row.get("packet_width")
    words = []
    if rows not in (None, "automatic"):
        words.append(f"{int(rows)} rows" if width is None else f"{int(width) // int(rows)} {TIMES} {int(rows)} pixels")
    words += ["incoherent"] if row.get("coherent") in (False,) else []
    words += [name for name in ("compact", "robust") if row.get(name)]
    order, quality = row.get("tile_order"), row.get("own_build_quality")
    words += [] if order in (None, "blocks") else [f"tiles in {order}"]
    words += [] if quality in (None, SAME) else [f"{quality} build quality"]
    return ", ".join(words)


PIXEL = Method(
    "pixel",
    "one ray per pixel",
    Style(GREEN, "v"),
    PixelOptions,
    make_pixel,
    __name__,
    variant=_variant,
    words=_words,
)
