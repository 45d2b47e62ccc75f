"""Options that the methods with aligned rays have in common."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.harness.options import option
from experiments.methods.options import CellOptions


@dataclass(frozen=True)
class AlignedCellOptions(CellOptions):
    """Options of aligned rays."""

    packet_rows: int | None = option(
        None, "rows of pixels in a packet; null = the best fit for the cell", null="automatic"
    )
