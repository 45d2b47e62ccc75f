"""Options that the methods with aligned rays have in common."""

from __future__ import annotations

from atra.alignment.options import ReferenceRayOptions
from experiments.methods.options import CellOptions, options_of


@options_of(ReferenceRayOptions)
class AlignedCellOptions(CellOptions):
    """Options of aligned rays."""
