"""Options of tracers with aligned rays."""

from __future__ import annotations

from dataclasses import dataclass

from atra.errors import InputError
from atra.tracing.options import CellKeywords, CellOptions, option

REFERENCES = ("off_axis", "first_cell")
"""The reference cell: one a quarter of the image from its centre, or the first cell, as in the paper."""


class ReferenceRayKeywords(CellKeywords, total=False):
    packet_rows: int | None


@dataclass(frozen=True)
class ReferenceRayOptions(CellOptions):
    """Options of `VisibleFirstTracer`, and of all tracers whose packets lie within a cell.

    Rows that a packet or a cell cannot have are refused once the cell is known.
    """

    packet_rows: int | None = option(
        None, "rows of pixels in a packet; null = the best fit for the cell", null="automatic"
    )


class FramesKeywords(ReferenceRayKeywords, total=False):
    geometry: str
    culling: bool


@dataclass(frozen=True)
class FramesOptions(ReferenceRayOptions):
    """Options of `FramesTracer`. Raises InputError for instances with culling: an instance is always the whole mesh."""

    geometry: str = option(
        "copied",
        "copied = a sheared copy of the triangles per cell, instanced = one Embree instance of them per cell",
        choices=("copied", "instanced"),
    )
    culling: bool = option(True, "keep only triangles that a cell's frustum meets")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.geometry == "instanced" and self.culling:
            raise InputError(
                "geometry is 'instanced' and culling is on, but an instance is all of the mesh or nothing; "
                "set culling=False"
            )


class AlignedKeywords(FramesKeywords, total=False):
    reference: str


@dataclass(frozen=True)
class AlignedOptions(FramesOptions):
    """Options of `AlignedTracer`."""

    reference: str = option(
        "off_axis",
        "reference cell: off_axis = a quarter of the image from its centre, first_cell = as in the paper; the image is "
        "the same",
        choices=REFERENCES,
    )
