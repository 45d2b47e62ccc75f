"""Images made by other programs: the convention that fits each, and what is right in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.exact.intersection import intersect_pixels
from atra.exact.rounding import ROUNDINGS
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import Agreement, Verdict, compare
from atra.judge.conventions import OFFSETS, Convention
from atra.prim_ids import MISS
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer

SAME_DEPTH = 1e-5
"""Relative difference up to which two depths agree, where a convention is looked for."""

SURE_SHARE = 0.5
"""Share of pixels that agree, below which the convention that fits best is not believed."""

_SAMPLED = 1 << 16
"""Pixels, about, that are looked at to find the convention."""


@dataclass(frozen=True, eq=False)
class ForeignImage:
    """An image of another program, checked.

    Parameters
    ----------
    depth : (H, W) array of float
        Scene units.
    prim_id : (H, W) array of int, optional
        In the mesh's numbering, -1 or `MISS` for a miss. None: the program stores none, and a depth that is not finite
        or not above 0 is a miss.
    rounding : float
        By how much the file may have rounded a depth, scene units; 0 for float32.

    Raises
    ------
    InputError
        For other shapes, and for depths that are no numbers.

    Examples
    --------
    >>> import atra
    >>> import numpy as np
    >>> atra.ForeignImage(np.ones((3, 4))).depth.dtype
    dtype('float32')
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32] | None = None
    rounding: float = 0.0

    def __post_init__(self) -> None:
        depth = np.asarray(self.depth)
        if depth.ndim != 2 or not np.issubdtype(depth.dtype, np.number):
            raise InputError(f"depth is {depth.dtype} of shape {depth.shape}, expected numbers of shape (H, W)")
        depth = depth.astype(np.float32)
        ids = None if self.prim_id is None else np.asarray(self.prim_id)
        if ids is not None:
            if ids.shape != depth.shape or not np.issubdtype(ids.dtype, np.number):
                raise InputError(f"prim_id is {ids.dtype} of shape {ids.shape}, expected integers of {depth.shape}")
            ids = ids.astype(np.int64)
            ids = np.where((ids < 0) | (ids > int(MISS)), int(MISS), ids).astype(np.uint32)
        misses = ~np.isfinite(depth) | (depth <= 0.0) if ids is None else ids == MISS
        object.__setattr__(self, "depth", np.where(misses, np.float32(np.inf), depth))
        object.__setattr__(self, "prim_id", ids)
        if not self.rounding >= 0.0:
            raise InputError(f"rounding is {self.rounding!r}, expected a number of at least 0")


@dataclass(frozen=True, eq=False)
class ForeignJudgement:
    """What `judge_image` finds.

    Attributes
    ----------
    agreement : Agreement
        The verdict on every pixel.
    convention : Convention
        Of the image.
    agreeing, own_agreeing : float
        Shares of pixels whose depths fit this convention, and atra's own, to 1e-5.
    hits : Hits
        The image in atra's convention; without ids of its own it names the triangle whose plane its depth fits.
    reference : Hits
        What it is compared with.
    """

    agreement: Agreement
    convention: Convention
    agreeing: float
    own_agreeing: float
    hits: Hits
    reference: Hits

    @property
    def is_right(self) -> bool:
        """Whether no pixel is wrong; a hole is wrong, too."""
        return self.agreement.pixels_wrong == 0

    def explained(self, most: int = 5) -> Iterator[str]:
        """A sentence on each of the first wrong pixels, by its column and row in atra's convention."""
        holes = self.agreement.holes
        for y, x in np.argwhere(self.agreement.verdict == Verdict.WRONG)[:most]:
            kind = "hole" if holes is not None and holes[y, x] else "wrong"
            shown, expected = _shown(self.hits, y, x), _shown(self.reference, y, x)
            yield f"({x}, {y}) {kind}: the image shows {shown}, expected {expected}"


def _shown(image: Hits, y: int, x: int) -> str:
    if image.prim_id[y, x] == MISS:
        return "nothing" if image.depth[y, x] == np.inf else f"no triangle, with depth {image.depth[y, x]:.7g}"
    return f"triangle {image.prim_id[y, x]} at depth {image.depth[y, x]:.7g}"


def judge_image(
    mesh: Mesh,
    camera: View,
    image: ForeignImage,
    *,
    against: ForeignImage | None = None,
    convention: Convention | None = None,
    threads: int | None = None,
) -> ForeignJudgement:
    """Judge an image that another program has made of `mesh`, pixel by pixel, in float64, as `compare` does.

    Parameters
    ----------
    mesh, camera :
        What the image shows, and by which rays.
    image : ForeignImage
    against : ForeignImage, optional
        Compare with this image, in the convention that fits it, rather than with what the rasteriser finds.
    convention : Convention, optional
        Of the image, or of both. None: the one that most pixels speak for, by depths and by the ids that the image has;
        of several the nearest to atra's own.
    threads : int, optional
        None takes every core.

    Returns
    -------
    ForeignJudgement

    Raises
    ------
    InputError
        For an image of another size, for ids that the mesh does not have, and for two images whose rays pass through
        other places of their pixels.
    MemoryBudgetError
        As `RasterTracer`.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> image = atra.ForeignImage(atra.trace(mesh, camera).depth[::-1])  # upside down
    >>> found = atra.judge_image(mesh, camera, image)
    >>> found.is_right, found.convention.flips_rows
    (True, True)
    """
    with RasterTracer(mesh, camera, threads=threads) as tracer:
        found, agreeing, own, right = _fitting(image, tracer, convention)
        hits, reference = _in_own_words(image, found, right), right
        if against is not None:
            other = _fitting(against, tracer, convention)[0]
            if other.offset != found.offset:
                raise InputError(
                    f"one image has its rays through {OFFSETS[found.offset]}, the other through "
                    f"{OFFSETS[other.offset]}; expected the same rays"
                )
            reference = _in_own_words(against, other, right)
    return ForeignJudgement(compare(hits, reference), found, agreeing, own, hits, reference)


def _fitting(image: ForeignImage, tracer: Tracer, given: Convention | None) -> tuple[Convention, float, float, Hits]:
    """Return the convention that fits best, the shares of depths that agree with it and with atra's own, and the right
    image with its rays."""
    shape = (tracer.camera.height, tracer.camera.width)
    allowed = (False, True) if given is None else (given.swaps_axes,)
    swapped = [swaps for swaps in allowed if (image.depth.T if swaps else image.depth).shape == shape]
    if not swapped:
        raise InputError(f"the image is {image.depth.shape}, expected the camera's {shape} (height, width)")
    own = given or replace(Convention.own(tracer.camera), swaps_axes=swapped[0])
    right = tracer.trace(own.offset)
    shares = {own: _shares(image, own, right)}
    for offset in OFFSETS if given is None else ():
        right = tracer.trace(offset)
        for swaps, columns, rows, ray in product(swapped, *((False, True),) * 3):
            convention = Convention(offset, rows, columns, swaps, ray)
            shares[convention] = _shares(image, convention, right)
    believed = [convention for convention, share in shares.items() if share[0] >= SURE_SHARE] or [own]
    best = max(believed, key=lambda convention: (sum(shares[convention]), -_departures(convention, own)))
    return best, shares[best][0], shares[own][0], tracer.trace(best.offset)


def _departures(one: Convention, other: Convention) -> int:
    return sum(getattr(one, name.name) != getattr(other, name.name) for name in fields(one))


def _shares(image: ForeignImage, convention: Convention, right: Hits) -> tuple[float, float]:
    """The shares of pixels whose depth is the right image's, and whose id is; ids tell apart what depths do not, such
    as a ball and its mirror image. 0 for an image without ids."""
    step = max(1, int((right.depth.size / _SAMPLED) ** 0.5))
    sampled = np.s_[::step, ::step]
    expected = np.where(right.hit, right.depth.astype(np.float64) * _ratios(right, convention), np.inf)[sampled]
    depth = convention.ordered(image.depth)[sampled]
    with np.errstate(invalid="ignore"):
        is_near = np.abs(depth - expected) <= np.maximum(image.rounding, SAME_DEPTH * np.abs(expected))
    by_depth = float((is_near | (np.isinf(depth) & np.isinf(expected))).mean())
    if image.prim_id is None:
        return by_depth, 0.0
    return by_depth, float((convention.ordered(image.prim_id)[sampled] == right.prim_id[sampled]).mean())


def _ratios(reference: Hits, convention: Convention) -> NDArray[np.float64]:
    """(H, W) depth in the convention of a point on each pixel's ray whose depth in atra's is 1."""
    height, width = reference.depth.shape
    camera: View = reference.camera
    if camera.is_parallel or convention.along_ray == camera.depth_is_along_ray:
        return np.ones((height, width))
    directions = camera.rays(*np.meshgrid(np.arange(width), np.arange(height)), reference.offset)[1]
    along = np.linalg.norm(directions, axis=-1) if convention.along_ray else directions[..., 2]
    return np.where(np.isnan(along), 1.0, along)  # NaN where a lens gives no ray


def _in_own_words(image: ForeignImage, convention: Convention, reference: Hits) -> Hits:
    """The image as hits: depths in atra's convention, a triangle named for each hit, and depths that the file has
    rounded replaced by those of the triangle's plane."""
    stored, ratios = convention.ordered(image.depth).astype(np.float64), _ratios(reference, convention)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth, rounding = np.where(np.isinf(stored), np.inf, stored / ratios), image.rounding / np.abs(ratios)
    if image.prim_id is not None:
        prim_id = convention.ordered(image.prim_id)
        y, x = np.nonzero(prim_id != MISS)
        plane = np.full(depth.shape, np.inf)
        plane[y, x] = intersect_pixels(reference.mesh, reference.camera, x, y, prim_id[y, x], reference.offset).depth
    else:
        prim_id, plane = _named(depth, rounding, reference)
    # Depths along the axis are coordinates: rays that leave sideways round them relative to the distance.
    is_coordinate = reference.camera.depth_is_along_ray and not convention.along_ray
    with np.errstate(invalid="ignore"):
        allowed = image.rounding + (ROUNDINGS * plane if is_coordinate else 0.0)
        is_rounded = np.abs(stored - plane * ratios) <= allowed
    settled = np.where(is_rounded, plane, depth).astype(np.float32)
    return Hits(settled, prim_id, reference.offset, reference.mesh, reference.camera, reference.threads)


def _named(
    depth: NDArray[np.float64], rounding: NDArray[np.float64], reference: Hits
) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
    """Triangles, (H, W), that an image without ids may show, and the depths of their planes: of those that the right
    image shows in the pixel and around it, the one whose plane's depth is nearest to the image's."""
    height, width = depth.shape
    has_hit = np.isfinite(depth)
    named, plane = np.full((height, width), MISS, np.uint32), np.full((height, width), np.inf)
    around = np.pad(reference.prim_id, 1, constant_values=MISS)
    shifts = sorted(product((0, 1, 2), repeat=2), key=lambda shift: abs(shift[0] - 1) + abs(shift[1] - 1))
    for down, right in shifts:
        triangle = around[down : down + height, right : right + width]
        with np.errstate(invalid="ignore"):
            is_named = np.abs(plane - depth) <= np.maximum(rounding, SAME_DEPTH * depth)
        y, x = np.nonzero(has_hit & (triangle != MISS) & ~is_named)
        found = intersect_pixels(reference.mesh, reference.camera, x, y, triangle[y, x], reference.offset).depth
        with np.errstate(invalid="ignore"):
            nearer = ~(np.abs(found - depth[y, x]) >= np.abs(plane[y, x] - depth[y, x]))
        nearer &= np.isfinite(found)
        named[y[nearer], x[nearer]], plane[y[nearer], x[nearer]] = triangle[y, x][nearer], found[nearer]
    return named, plane
