"""One ray per pixel, each from the list of its shaft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.classification.bvh.images import Start
from experiments.classification.bvh.starts import Shafts
from experiments.classification.bvh.tracer import OwnBvh, PreparedBvh
from experiments.classification.shafts.options import OF_RAYS, ShaftOptions
from experiments.classification.shafts.shafts import ShaftLists, build_shafts


class PreparedShafts(PreparedBvh):
    """A BVH, and lists of its nodes by shaft."""

    start: ClassVar[Start] = Start.shaft
    lists: ShaftLists

    def _build(self) -> None:
        super()._build()
        self.lists = build_shafts(self.bvh, self.options, self._pool)

    @property
    def _shafts(self) -> Shafts:
        return self.lists.shafts

    @property
    def counters(self) -> Mapping[str, float]:
        """Counters of the BVH and of the shafts."""
        return {**super().counters, **self.lists.counters}


@dataclass(frozen=True)
class Classified(OwnBvh):
    """Rays that start from the lists of their shafts as a method."""

    prepared: ClassVar[type[PreparedBvh]] = PreparedShafts


def ClassifiedTracer(mesh: Mesh, camera: View, **options: Any) -> Tracer:
    """A `BvhTracer` with single rays, each of which starts from the list of its shaft (ray classification).

    options: fields of `ShaftOptions`. Subsets that depend on rays are for batches (`shafts.scene`).
    Raises what `BvhTracer` does; InputError for packets and for those subsets; MemoryBudgetError, when building, for
    shafts that do not fit. Source: J. Hendrich et al., "Ray classification for accelerated BVH traversal", 2019.
    """
    given = ShaftOptions(**options)
    if given.packet_width != 1:
        raise InputError(f"packet_width is {given.packet_width}, expected 1: pixels of a packet share no shaft")
    if given.subset in OF_RAYS:
        raise InputError(f"subset is {given.subset!r}, which depends on rays; expected another one for a camera")
    return Classified(given).tracer(mesh, camera)
