"""One ray per pixel, each from the list of its shaft."""

from __future__ import annotations

from typing import Any, ClassVar

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.classification.bvh.images import Start
from experiments.classification.bvh.options import BvhOptions
from experiments.classification.bvh.tracer import BvhTracer
from experiments.classification.shafts.options import OF_RAYS, ShaftOptions
from experiments.classification.shafts.shafts import HasShafts


class ClassifiedTracer(HasShafts, BvhTracer):
    """A `BvhTracer` with single rays, each of which starts from the list of its shaft (ray classification).

    options: see `shafts.options.ShaftOptions`. Subsets that depend on rays are for batches (`shafts.scene`).
    Raises what `BvhTracer` does; InputError for packets and for those subsets; MemoryBudgetError, when building, for
    shafts that do not fit. Source: J. Hendrich et al., "Ray classification for accelerated BVH traversal", 2019.
    """

    options_type: ClassVar[type[BvhOptions]] = ShaftOptions
    _start = Start.shaft

    def __init__(self, mesh: Mesh, camera: View, **options: Any) -> None:
        self._set_up(mesh, camera, options)
        if self.packet_width != 1:
            raise InputError(f"packet_width is {self.packet_width}, expected 1: pixels of a packet share no shaft")
        if self.options.subset in OF_RAYS:
            raise InputError(
                f"subset is {self.options.subset!r}, which depends on rays; expected another one for a camera"
            )
