"""What there is to choose from: a method, its split, packets and build quality."""

from __future__ import annotations

from dataclasses import dataclass

from atra.alignment.aligned import AlignedTracer
from atra.alignment.reference_rays import choose_packet_shape
from atra.alignment.visible_first import VisibleFirstTracer
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.packets.pixel import PixelTracer
from atra.raster.tracer import RasterTracer
from atra.tracing.options import PacketOptions, native_packet_widths
from atra.tracing.rays import SQUAREST_SHAPE
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number

PACKETS, RASTER, ALIGNED, VISIBLE_FIRST = "packets", "raster", "aligned", "visible_first"
METHODS = (PACKETS, RASTER, ALIGNED, VISIBLE_FIRST)

_WITHOUT_CELLS = (PACKETS, RASTER)

CELL_WIDTHS = {VISIBLE_FIRST: (16, 8, 4, 2), ALIGNED: (8, 4, 2)}
"""Pixels; an image that one of them does not divide takes the next width below twice of it that does."""


@dataclass(frozen=True)
class Choice:
    """A method and all that it is built with.

    method: "packets" (`PixelTracer`), "raster", "aligned" or "visible_first". split: (nx, ny) cells, (1, 1) for packets
    and raster. packet_width, packet_rows: rays of a packet, and the rows of pixels they come from, 1 for raster.
    build_quality: Embree's.
    Raises InputError for an unknown method or quality, packets that are split, and counts below 1.
    """

    method: str
    split: tuple[int, int]
    packet_width: int
    packet_rows: int
    build_quality: str = "medium"

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"method is {self.method!r}, expected one of {', '.join(METHODS)}")
        PacketOptions(build_quality=self.build_quality)  # refuses one that Embree does not have
        for name, value in (
            ("split_x", self.split[0]), ("split_y", self.split[1]),
            ("packet_width", self.packet_width), ("packet_rows", self.packet_rows),
        ):  # fmt: skip
            if not is_whole_number(value) or value < 1:
                raise InputError(f"{name} is {value!r}, expected a whole number of at least 1")
        object.__setattr__(self, "split", (int(self.split[0]), int(self.split[1])))
        object.__setattr__(self, "packet_width", int(self.packet_width))
        object.__setattr__(self, "packet_rows", int(self.packet_rows))
        if self.method in _WITHOUT_CELLS and self.split != (1, 1):
            raise InputError(
                f"method is {self.method!r} with split {self.split}, but {self.method} have no cells; expected (1, 1)"
            )

    def tracer(
        self,
        mesh: Mesh,
        camera: View,
        threads: int | None = None,
        ties: str = "lowest",
        memory_budget_bytes: int | None = None,
    ) -> Tracer:
        """The tracer, neither planned nor built. Arguments as for the tracers, of which those without cells need no
        memory budget.

        Raises InputError as its constructor does.
        """
        if self.method == RASTER:
            return RasterTracer(mesh, camera, threads=threads, ties=ties)
        if self.method == PACKETS:
            return PixelTracer(
                mesh,
                camera,
                packet_width=self.packet_width,
                threads=threads,
                build_quality=self.build_quality,
                ties=ties,
            )
        make = AlignedTracer if self.method == ALIGNED else VisibleFirstTracer
        return make(
            mesh,
            camera,  # type: ignore[arg-type]  # VisibleFirstTracer refuses other cameras than a pinhole itself
            self.split,
            packet_width=self.packet_width,
            packet_rows=self.packet_rows,
            threads=threads,
            build_quality=self.build_quality,
            memory_budget_bytes=memory_budget_bytes,
            ties=ties,
        )

    def __str__(self) -> str:
        cells = "" if self.method in _WITHOUT_CELLS else f" {self.split[0]} x {self.split[1]}"
        quality = "" if self.build_quality == "medium" else f", {self.build_quality} build quality"
        return f"{self.method}{cells}{quality}"


def candidates(camera: View) -> tuple[Choice, ...]:
    """The rasteriser, which builds nothing; packets of the widest native width; then each method at every split worth
    trying, its widest cells first; all of medium build quality."""
    width = native_packet_widths()[-1]
    choices = [Choice(RASTER, (1, 1), 1, 1), Choice(PACKETS, (1, 1), width, SQUAREST_SHAPE[width][1])]
    for method, cell_widths in CELL_WIDTHS.items():
        if method == VISIBLE_FIRST and camera.is_parallel:
            continue
        for nx in _splits(camera.width, cell_widths):
            split = Split(nx, 1, camera.width, camera.height)
            choices.append(Choice(method, (nx, 1), width, choose_packet_shape(width, split)[1]))
    return tuple(choices)


def _splits(width: int, cell_widths: tuple[int, ...]) -> list[int]:
    """Columns of cells about so many pixels wide, where the image can be divided so; the widest cells first."""
    fitting = (
        next((pixels for pixels in range(wanted, 2 * wanted) if width % pixels == 0), None) for wanted in cell_widths
    )
    return sorted({width // pixels for pixels in fitting if pixels is not None})
