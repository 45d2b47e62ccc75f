"""A film: sums of an image's samples, plane by plane; and its pixels as kernels read them: their rays and hits."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.threads import WorkerPool
from atra.errors import AtraError, InputError
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.pictures.files_kernels import place_pixels
from atra.light.pictures.gbuffer_kernels import LANES
from atra.light.pictures.path_kernels import TILE, Pixels
from atra.tracing.budgets import check_needed_bytes
from atra.tracing.lens_rays import world_directions

MOST_PIXELS_A_SIDE = 1 << 16

_EXACT_SAMPLES = 32
"""Samples summed in float32, which halves memory traffic, before they are added to float64 sums."""

_PLACE_BYTES, _PIXEL_BYTES = 4, 12

_NOTHING = np.zeros(0, np.uint32)

NO_DIRECTIONS = np.zeros((3, 0, 0), np.float32)
"""Directions of a camera without a lens."""


class Film:
    """Sums of several numbers per pixel.

    shape: numbers per pixel, width and height of the image. is_set: a sample that `is_first` overwrites the sums, which
    then need not be zeroed. places: (pixels,) uint32, x + y 2^16 of each pixel in the film's order. sums: (planes,
    pixels) float32, which samples are added to; rows are aligned to cache lines. Both have room for LANES more entries.
    samples: samples so far. Raises InputError for an image of more than 65,536 pixels a side, MemoryBudgetError.
    """

    def __init__(self, shape: tuple[int, int, int], is_set: bool = False) -> None:
        self.shape = planes, width, height = shape
        self._is_set = is_set
        if max(width, height) > MOST_PIXELS_A_SIDE:
            raise InputError(f"the image is {width} x {height} pixels, expected at most {MOST_PIXELS_A_SIDE:,} a side")
        pixels = width * height
        needed = pixels * (_PIXEL_BYTES * (planes + 1) + _PLACE_BYTES)
        check_needed_bytes(needed, None, f"sums of {pixels:,} pixels", "use fewer pixels")
        self.places = _places(width, height)
        self.sums = aligned_empty((planes, (pixels // LANES + 1) * LANES), np.float32)[:, :pixels]
        self._earlier = np.zeros((planes, pixels))
        self._before: NDArray[np.float32] | None = None
        self.samples = 0
        self._clear()

    def _clear(self) -> None:
        if not self._is_set:
            self.sums.fill(0.0)

    @property
    def is_first(self) -> bool:
        """Whether the next sample is the first in the float32 sums."""
        return self.samples % _EXACT_SAMPLES == 0

    def begin_sample(self) -> None:
        """Remember the sums, so that `drop_sample` can go back to them."""
        if not self.is_first:
            self._before = self.sums.copy() if self._before is None else self._before
            self._before[:] = self.sums

    def drop_sample(self) -> None:
        """Remove what was added since `begin_sample`."""
        if self.is_first:
            self._clear()
        else:
            assert self._before is not None
            self.sums[:] = self._before

    def restart(self) -> None:
        """Drop all samples."""
        self._clear()
        if self.samples >= _EXACT_SAMPLES:
            self._earlier.fill(0.0)
        self.samples = 0

    def end_sample(self) -> None:
        """Count a sample that all pixels have got."""
        self.samples += 1
        if self.is_first:
            self._earlier += self.sums
            self._clear()

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of all that `restore` needs: the sums, and the number of samples."""
        return {"samples": np.array(self.samples), "sums": self.sums.copy(), "earlier": self._earlier.copy()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the `state` of a film of the same shape. Raises InputError for another shape."""
        for name, own in (("sums", self.sums), ("earlier", self._earlier)):
            if state[name].shape != own.shape or state[name].dtype != own.dtype:
                raise InputError(f"{name} of the state have shape {state[name].shape}, expected {own.shape}")
        self.sums[:], self._earlier[:], self.samples = state["sums"], state["earlier"], int(state["samples"])

    def mean(self, planes: slice) -> NDArray[np.float64]:
        """(planes, pixels), over all samples. Raises InputError if there is none yet."""
        if not self.samples:
            raise InputError("there is no sample yet, expected at least one; call add(1) first")
        latest = 0.0 if self.is_first else self.sums[planes]
        return (self._earlier[planes] + latest) / self.samples

    def as_image(self, planes: NDArray[np.floating]) -> NDArray[np.float32]:
        """(planes, pixels) in the film's order -> (H, W, planes) float32."""
        _, width, height = self.shape
        image = np.empty((height, width, len(planes)), np.float32)
        place_pixels(self.places, planes, image)
        return image

    def not_finite(self, first: int, count: int) -> AtraError:
        """The error that names a sum, of `count` pixels from number `first` on, which is not finite."""
        plane, pixel = np.argwhere(~np.isfinite(self.sums[:, first : first + count]))[0].tolist()
        place = int(self.places[first + pixel])
        return AtraError(
            f"sample {self.samples} of pixel {(place & 0xFFFF, place >> 16)} is {self.sums[plane, first + pixel]}, "
            "expected a finite number; look for texels beyond 1e30 in the sky, and report this if there are none"
        )


@lru_cache(maxsize=4)
def _places(width: int, height: int) -> NDArray[np.uint32]:
    """Pixels in rows of tiles, and row by row within each."""
    columns, rows = (-(-side // TILE) * TILE for side in (width, height))
    tiled = np.arange(columns, dtype=np.uint32) + (np.arange(rows, dtype=np.uint32)[:, None] << np.uint32(16))
    tiled = tiled.reshape(rows // TILE, TILE, columns // TILE, TILE).swapaxes(1, 2).ravel()
    inside = tiled[((tiled & 0xFFFF) < width) & (tiled >> 16 < height)]
    places = np.append(inside, np.zeros(LANES, np.uint32))  # vectors read past the last pixel
    places.setflags(write=False)
    return places[: width * height]


class LensPixels:
    """Rays of all pixels through a lens; those of the last offset are kept. Without a lens there are none."""

    def __init__(self) -> None:
        self._offset: tuple[float, float] | None = None
        self._directions, self._blind = NO_DIRECTIONS, np.zeros((0, 0), np.bool_)

    def directions(self, camera: View, offset: tuple[float, float], threads: int) -> NDArray[np.float32]:
        """`directions` of `Pixels`. Pixels without a ray look along the view axis."""
        if isinstance(camera, LensView) and offset != self._offset:
            with closing(WorkerPool(threads)) as pool:
                self._offset, self._directions = offset, world_directions(camera, offset, pool)
            self._blind = np.isnan(self._directions[0])
            self._directions[:, self._blind] = camera.axes[2].astype(np.float32)[:, None]
        return self._directions

    def blackened(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (..., H, W, 3), changed in place: black where the last offset gave no ray."""
        if self._blind.any():
            image[..., self._blind, :] = 0.0
        return image


def pixels_of(
    camera: View,
    film: Film,
    offset: tuple[float, float],
    hits: Hits | None,
    directions: NDArray[np.float32] = NO_DIRECTIONS,
) -> Pixels:
    """The next sample of all pixels, at this sub-pixel offset. hits: what they see there; None: unknown, and each pixel
    has an offset of its own. directions: of `Pixels`."""
    if hits is None:
        return Pixels(_lines(camera, (0.0, 0.0)), film.places, True, _NOTHING, 0, film.samples, NO_DIRECTIONS)
    stride, (height, width) = hits.prim_id.strides[0] // 4, hits.prim_id.shape
    prim_ids = np.lib.stride_tricks.as_strided(hits.prim_id, ((height - 1) * stride + width,), (4,))
    return Pixels(_lines(camera, offset), film.places, False, prim_ids, stride, film.samples, directions)


def _lines(camera: View, offset: tuple[float, float]) -> NDArray[np.float64]:
    """(6, 3) float64, `lines` of `Pixels`: rays are linear in the pixel's position."""
    if camera.lens is not None:  # all start at the eye
        return np.concatenate([[camera.eye], np.zeros((5, 3))])
    origins, directions = camera.rays(np.array([0, 1, 0]), np.array([0, 0, 1]), offset)
    origins, directions = origins @ camera.axes + camera.eye, directions @ camera.axes
    steps = [values[k] - values[0] for k in (1, 2) for values in (origins, directions)]
    return np.array([origins[0], directions[0], *steps])
