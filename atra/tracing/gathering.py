"""Memory of gathered images: arrays with room beside them, for packets and vectors that reach past the border."""

from __future__ import annotations

from collections.abc import Iterable
from math import prod
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Gathered, Reduction
from atra.all_hits.target_kernels import Target
from atra.compiled.aligned_memory import aligned_empty, aligned_part
from atra.errors import InputError
from atra.geometry.view import View
from atra.tracing.budgets import check_needed_bytes

ROOM = 16
"""Rows below an image: as high as the highest packet."""


_unchanged: WeakSet[Any] = WeakSet()
"""Results whose arrays nobody has written to. Unused layers of such a result are still empty, so clearing them is
skipped when it is reused."""


def keep_unchanged(result: Any) -> None:
    """Remember that a result holds what was gathered; its arrays are read-only."""
    _unchanged.add(result)


def take_unchanged(out: Any, names: Iterable[str]) -> bool:
    """Whether an earlier result still holds what was gathered. It is forgotten, as it will be overwritten."""
    if out not in _unchanged:
        return False
    _unchanged.discard(out)
    return not any(getattr(out, name).flags.writeable for name in names)


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


def check_rays_without_lens(camera: View) -> None:
    """Raise InputError for a camera with a lens, along whose rays tracers gather no hits."""
    if camera.lens is not None:
        raise InputError(
            f"the camera has the lens {camera.lens}, along whose rays tracers gather no hits; use "
            "RayScene(mesh).gather(what, *camera.rays_world()), or camera.undistorted(), which has no lens"
        )
