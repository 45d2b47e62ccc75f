"""Memory of gathered images: arrays with room beside them, for packets and vectors that reach past the border."""

from __future__ import annotations

from math import prod
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Gathered, Reduction
from atra.all_hits.target_kernels import Target
from atra.compiled.aligned_memory import aligned_empty
from atra.errors import InputError
from atra.geometry.view import View
from atra.tracing.budgets import check_needed_bytes

ROOM = 16
"""Rows below an image: as high as the highest packet."""

_memory: WeakKeyDictionary[Any, dict[str, NDArray]] = WeakKeyDictionary()
"""The arrays of each result with the room beside them."""


def keep_memory(result: Any, images: dict[str, NDArray]) -> None:
    """Remember of which arrays those of a result are parts, for a later call that overwrites them."""
    _memory[result] = images


def target_images(
    what: Reduction[Gathered], height: int, width: int, row: int, out: Gathered | None
) -> tuple[dict[str, NDArray], bool]:
    """Memory of the arrays of a result by name, (..., height + ROOM, row), with anything in it, or that of an earlier
    result, which is then forgotten; and whether the earlier one still holds what was gathered: nobody has made its
    arrays writeable. Unused layers of such a result are still empty, so clearing them is skipped.

    Raises InputError for an `out` that does not fit, MemoryBudgetError for more than the memory that is free.
    """
    shapes = {name: (*plane.before, height + ROOM, row) for name, plane in what.planes().items()}
    if out is None:
        needed = sum(4 * prod(shape) for shape in shapes.values())
        check_needed_bytes(
            needed, None, f"results of {height:,} rows of {width:,} pixels", "use fewer pixels or layers"
        )
        return {name: aligned_empty(shapes[name], plane.kind) for name, plane in what.planes().items()}, False
    if type(out) is not what.result:
        raise InputError(f"out is {out!r:.100}, expected {what.result.__name__} of this tracer, or None")
    for name, plane in what.planes().items():
        given, wanted = getattr(out, name).shape, (*plane.before, height, width)
        if given != wanted:
            raise InputError(f"out has {name} of {given}, expected {wanted}: pass a result of this tracer")
    images = _memory.get(out)
    if images is None or any(images[name].shape != shape for name, shape in shapes.items()):
        raise InputError("out was not made for this tracer and as much of the same: pass its result")
    del _memory[out]
    return images, not any(getattr(out, name).flags.writeable for name in shapes)


def target_of(
    images: dict[str, NDArray],
    weights: NDArray[np.float32] | None,
    undecided: tuple[NDArray, NDArray, NDArray] | None,
    is_known: bool = False,
) -> Target:
    """undecided: marks, first and listed of `Target`; None where nothing is. is_known: of `Target`."""
    values, *others = images.values()
    prim_id, count = others or (values, values)
    layers = values.shape[0] if values.ndim == 3 else 1
    row = values.shape[-1]
    marks, first, listed = (0, 0, 0) if undecided is None else (array.ctypes.data for array in undecided)
    return Target(
        values.ctypes.data, prim_id.ctypes.data, count.ctypes.data, row, values.shape[-2] * row, layers,
        0 if weights is None else weights.ctypes.data, marks, first, listed, int(is_known),
    )  # fmt: skip


def check_rays_without_lens(camera: View) -> None:
    """Raise InputError for a camera with a lens, along whose rays tracers gather no hits."""
    if camera.lens is not None:
        raise InputError(
            f"the camera has the lens {camera.lens}, along whose rays tracers gather no hits; use "
            "RayScene(mesh).gather(what, *camera.rays_world()), or camera.undistorted(), which has no lens"
        )
