"""Method `pixel`: one ray per pixel, single or in packets; what every other method is measured against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.packets.pixel import PixelTracer
from experiments.drawing.style import GREEN, TIMES
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.common_options import check_packet_width, robust_option


class TileOrder(Enum):
    """Tiles of 32 x 16 pixels row by row; tiles as wide as the image; tiles of 16 x 16 pixels along a Morton curve."""

    blocks = "blocks"
    rows = "rows"
    morton = "morton"


class OwnBuildQuality(Enum):
    """Of its own BVH; same = `build_quality`, which is that of the baselines beside it, too."""

    same = "same"
    low = "low"
    medium = "medium"
    high = "high"


@dataclass(frozen=True)
class PixelOptions:
    """What an expert would try. packet_width: None = the widest native packets. packet_rows: None = the squarest."""

    packet_width: int | None = option(None, "rays in a packet; 1 = rtcIntersect1, null = the widest native packets")
    packet_rows: int | None = option(None, "rows of pixels in a packet; null = what suits the cell", "automatic")
    coherent: bool = option(True, "Embree takes the rays of a packet through its tree together")
    compact: bool = option(False, "a BVH that saves memory")
    robust: bool = robust_option()
    tile_order: TileOrder = option(TileOrder.blocks, "which pixels follow each other: blocks, rows or morton")
    own_build_quality: OwnBuildQuality = option(OwnBuildQuality.same, "of its own BVH; same = build_quality")

    def __post_init__(self) -> None:
        check_packet_width(self.packet_width)


def make_pixel(mesh: Mesh, view: View, options: PixelOptions, tracing: Tracing) -> PixelTracer:
    """One ray per pixel; packets of 1 are `rtcIntersect1`."""
    changed = (
        {} if options.own_build_quality is OwnBuildQuality.same else {"build_quality": options.own_build_quality.value}
    )
    return PixelTracer(
        mesh,
        view,
        packet_width=options.packet_width,
        packet_rows=options.packet_rows,
        coherent=options.coherent,
        compact=options.compact,
        tile_order=options.tile_order.value,
        **(tracing.ours | {"robust": options.robust} | changed),
    )


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
    words += [f"tiles in {order}" for order in _unusual(row, "tile_order", TileOrder.blocks)]
    words += [f"{quality} build quality" for quality in _unusual(row, "own_build_quality", OwnBuildQuality.same)]
    return ", ".join(words)


def _unusual(row: Mapping[str, Any], name: str, usual: Enum) -> list[str]:
    value = row.get(name)
    return [] if value in (None, usual.value) else [str(value)]


PIXEL = Method(
    "pixel", "one ray per pixel", Style(GREEN, "v"), PixelOptions, make_pixel, __name__, variant=_variant, words=_words
)
