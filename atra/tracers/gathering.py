"""Gathering: the part of a tracer that makes one number, or a few, of all hits along each ray."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.gathering.images import target_images
from atra.gathering.reductions import Gathered, Reduction, check_reduction
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from atra.kernels.gathering.target import band_stride
from atra.lifetime import TracerLifetime

_unchanged: WeakSet[Any] = WeakSet()
"""Results that hold what was gathered: nobody writes to their arrays, so what none was found in need not be cleared."""


def _is_unchanged(out: Any, names: Iterable[str]) -> bool:
    """Whether an earlier result still holds what was gathered; from now on it does not."""
    if out not in _unchanged:
        return False
    _unchanged.discard(out)
    return not any(getattr(out, name).flags.writeable for name in names)


class Gathering(TracerLifetime[Hits]):
    """A tracer of one image whose rays are not stopped by what they hit."""

    mesh: Mesh
    camera: View

    @abstractmethod
    def _gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        """Take all hits. images: of `target_images`, with anything in them, or, if that is known, an earlier result.
        weights: of `what`."""

    def _check_gathering(self) -> None:
        """Raise InputError where the options do not allow it."""

    @property
    def _gathering_row(self) -> int:
        """Pixels from one row of what is gathered into to the next."""
        return int(band_stride(self.camera.width))

    def gather(
        self, what: Reduction[Gathered], offset: tuple[float, float] = (0.5, 0.5), out: Gathered | None = None
    ) -> Gathered:
        """Gather `what`, such as `atra.Count()`, of all hits along the ray of every pixel, each exactly once.

        offset: all rays go through this sub-pixel position of their pixels, in [0, 1) x [0, 1). out: an earlier result
        of this tracer for as much of the same, whose arrays are to be overwritten; it must not be read any more.
        Which triangles a ray crosses at edges and corners: `atra.gathering.reductions`.
        Raises InputError for an offset outside the pixel, an `out` that does not fit, a mesh that `what` is not for,
        and build quality "high", with which Embree finds some triangles twice; MemoryBudgetError for a result that the
        free memory does not hold; EmbreeError when the tracer is not built or already closed.
        """
        check_reduction(what)
        check_offset(offset)
        self._check_gathering()
        weights = what.weights(self.mesh)
        with self._tracing():
            height, width = self.camera.height, self.camera.width
            images = target_images(what, height, width, self._gathering_row, out)
            is_known = _is_unchanged(out, images)
            self._gather(what, offset, images, weights, is_known)
            arrays = {name: image[..., :height, :width] for name, image in images.items()}
            for array in arrays.values():
                array.setflags(write=False)
            result = what.result(**arrays, offset=offset, mesh=self.mesh, camera=self.camera)
            _unchanged.add(result)
            return result


class NoGathering:
    """A tracer that cannot gather all hits; `why_not` says why."""

    why_not: str

    def gather(self, what: Any, offset: tuple[float, float] = (0.5, 0.5), out: Any = None) -> Any:
        """Raises InputError: this tracer never meets all hits along a ray."""
        raise InputError(
            f"{type(self).__name__} cannot gather: {self.why_not}; use PixelTracer, AlignedTracer or RasterTracer"
        )
