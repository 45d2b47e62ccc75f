"""Gathering: the part of a tracer that makes one number, or a few, of all hits along each ray, and the images that it
gathers into: arrays with room beside them, for packets and vectors that reach past the border."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from math import prod
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Gathered, Reduction, check_reduction
from atra.all_hits.target_kernels import Target, band_stride
from atra.compiled.aligned_memory import aligned_empty, aligned_part
from atra.errors import InputError
from atra.geometry.view import check_offset
from atra.hits import Hits
from atra.tracing.budgets import check_needed_bytes
from atra.tracing.lifetime import TracerLifetime

ROOM = 16
"""Rows below an image: as high as the highest packet."""


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
        return int(band_stride.py_func(self.camera.width))

    def gather(
        self, what: Reduction[Gathered], offset: tuple[float, float] = (0.5, 0.5), out: Gathered | None = None
    ) -> Gathered:
        """Gather `what`, such as `atra.Count()`, of all hits along the ray of every pixel, each exactly once.

        offset: all rays go through this sub-pixel position of their pixels, in [0, 1) x [0, 1). out: an earlier result
        of this tracer for as much of the same, whose arrays are to be overwritten; it must not be read any more.
        Which triangles a ray crosses at edges and corners: `atra.all_hits.reductions`.
        Raises InputError for an offset outside the pixel, an `out` that does not fit, a mesh that `what` is not for,
        and build quality "high", with which Embree finds some triangles twice; MemoryBudgetError for a result that the
        free memory does not hold; ClosedError after `close`.
        """
        check_reduction(what)
        check_offset(offset)
        self._check_gathering()
        with self._in_use():
            weights = what.weights(self.mesh)
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


def target_images(
    what: Reduction[Gathered], height: int, width: int, row: int, out: Gathered | None
) -> dict[str, NDArray]:
    """Memory of the arrays of a result by name, (..., height + ROOM, row), with anything in it.

    out: an earlier result, whose memory it is then. Raises InputError for one that does not fit, MemoryBudgetError for
    more than the memory that is free.
    """
    if out is not None and type(out) is not what.result:
        raise InputError(f"out is {out!r:.100}, expected {what.result.__name__} of this tracer, or None")
    if out is None:
        needed = sum(prod(one.before) * (height + ROOM) * row * 4 for one in what.planes().values())
        check_needed_bytes(
            needed, None, f"results of {height:,} rows of {width:,} pixels", "use fewer pixels or layers"
        )
    images = {}
    for name, plane in what.planes().items():
        shape = (*plane.before, height + ROOM, row)
        if out is None:
            images[name] = aligned_empty(shape, plane.kind)
        else:
            given, wanted = getattr(out, name), (*plane.before, height, width)
            if given.shape != wanted:
                raise InputError(f"out has {name} of {given.shape}, expected {wanted}: pass a result of this tracer")
            images[name] = _memory(name, given, shape, plane.kind)
    return images


def _memory(name: str, given: Any, shape: tuple[int, ...], kind: type[np.generic]) -> NDArray:
    """The array that an image of a result is a part of. Raises InputError where it is not."""
    memory = getattr(given, "base", None)
    if isinstance(memory, np.ndarray) and memory.dtype == np.uint8 and given.dtype == kind and memory.flags.writeable:
        try:
            image = aligned_part(memory, shape, kind)
        except ValueError:
            image = None
        if image is not None and (image.ctypes.data, image.strides) == (given.ctypes.data, given.strides):
            return image
    raise InputError(f"out has a {name} that was not made for this tracer and as much of the same: pass its result")


def target_of(
    images: dict[str, NDArray],
    weights: NDArray[np.float32] | None,
    doubts: tuple[NDArray, NDArray, NDArray] | None,
    is_known: bool = False,
) -> Target:
    """doubts: marks, first and listed of `Target`; None where nothing is in doubt. is_known: of `Target`."""
    values, *others = images.values()
    prim_id, count = others or (values, values)
    layers = values.shape[0] if values.ndim == 3 else 1
    row = values.shape[-1]
    marks, first, listed = (0, 0, 0) if doubts is None else (array.ctypes.data for array in doubts)
    return Target(
        values.ctypes.data,
        prim_id.ctypes.data,
        count.ctypes.data,
        row,
        values.shape[-2] * row,
        layers,
        0 if weights is None else weights.ctypes.data,
        marks,
        first,
        listed,
        int(is_known),
    )
