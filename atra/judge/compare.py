"""The comparison of two images: do they agree, and if not, who is wrong?

Float32 tracers may differ where float32 cannot decide: on equally deep triangles, or nearly so, and on the rim of a
triangle. Every pixel is therefore judged in float64, and each disagreement is either explained or called wrong. Nothing
is averaged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.intersection import Pairs
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.outline import is_on_outline
from atra.judge.rounding import Rounding
from atra.kernels.rounding import ALLOWED_MULTIPLE, FLOAT32_UNIT
from atra.prim_ids import MISS

TIE_TOLERANCE = 1e-9
"""Relative difference up to which two float64 depths are the same depth."""

_LEAST_ROUNDINGS = 5.0
"""No depth has fewer: the corners, the direction, the volumes and their quotient are rounded once each."""


class Verdict(IntEnum):
    """What is said of one pixel of two images."""

    EQUAL = 0
    """Same triangle (or both miss), and both depths are right."""
    TIED = 1
    """Different triangles, both hit, equally deep."""
    EDGE = 2
    """Float32 cannot decide: the ray passes too close to a rim to say hit or miss, or the depths are too close to say
    which triangle is in front."""
    WRONG = 3
    """No excuse: at least one image is not what a tracer may return."""


@dataclass(frozen=True)
class DepthErrors:
    """Relative errors of the depths that an image stores, against the planes of the triangles it names, in float64.

    largest: of all hits. p999: what 99.9 % of them do not exceed. Both 0 without hits.
    """

    largest: float = 0.0
    p999: float = 0.0

    @classmethod
    def of(cls, errors: NDArray[np.float64]) -> Self:
        """errors: (N,) float64; where a ray never meets the plane, its error is not finite and is left out."""
        errors = errors[np.isfinite(errors)]
        return cls(float(errors.max()), float(np.quantile(errors, 0.999))) if len(errors) else cls()


@dataclass(frozen=True, eq=False)
class Agreement:
    """The verdict on every pixel of two images.

    verdict: (H, W) uint8, values of `Verdict`. The counts are its histogram.
    depth_errors, reference_depth_errors: of either image.
    Raises InputError for another dtype, another number of axes or an unknown code.
    """

    verdict: NDArray[np.uint8]
    depth_errors: DepthErrors = DepthErrors()
    reference_depth_errors: DepthErrors = DepthErrors()
    pixels_equal: int = field(init=False)
    pixels_tied: int = field(init=False)
    pixels_edge: int = field(init=False)
    pixels_wrong: int = field(init=False)

    def __post_init__(self) -> None:
        verdict = self.verdict
        if verdict.dtype != np.uint8 or verdict.ndim != 2:
            raise InputError(f"verdict is {verdict.dtype} of shape {verdict.shape}, expected uint8 of shape (H, W)")
        counts = np.bincount(verdict.reshape(-1), minlength=len(Verdict))
        if len(counts) > len(Verdict):
            raise InputError(f"verdict holds the code {len(counts) - 1}, expected at most {max(Verdict):d}")
        for kind in Verdict:
            object.__setattr__(self, f"pixels_{kind.name.lower()}", int(counts[kind]))

    @property
    def pixels(self) -> int:
        """How many pixels were judged."""
        return self.verdict.size

    def __str__(self) -> str:
        return (
            f"{self.pixels_equal} of {self.pixels} pixels equal, {self.pixels_tied} tied, "
            f"{self.pixels_edge} edge, {self.pixels_wrong} wrong"
        )


def compare(mesh: Mesh, camera: View, hits: Hits, reference: Hits) -> Agreement:
    """Judge every pixel of two images of `mesh` seen by `camera`; symmetric in `hits` and `reference`.

    A candidate is the triangle an image names, or nothing for a miss. In float64 its ray hits it *surely*, misses it
    *surely*, or passes so close to its rim that it is *doubtful*: within a thousandth of a pixel, or so that the
    rounding of float32 could turn the sign of a volume that decides it. A triangle edge-on to the ray or without area
    has no inside: it is doubtful on its outline and surely missed elsewhere, so a tracer may report it where rounding
    gave it some width, and only there.

    Same candidate: EQUAL. Different ones, in this order:
    TIED   neither is surely missed, both have a depth, and the depths are equal to TIE_TOLERANCE;
    WRONG  one is surely missed, or the doubtful one lies entirely behind the sure one, or none is doubtful and their
           depths differ by more than the rounding of float32 can change them;
    EDGE   otherwise.

    Above all that, a pixel is WRONG if either image stores a depth that differs from that of the plane of its triangle,
    in float64, by more than the rounding of float32 can change it. A ray that lies in a plane through the eye has a
    quotient of two zeros for a depth, and any depth will do. A miss must store inf.

    The rounding of float32 is that of one ray of the mesh itself, traced with the eye at the origin, and of its
    triangle test, for this very ray and triangle (`atra.judge.rounding`), times ALLOWED_MULTIPLE. Whoever traces other
    triangles than the mesh's, such as sheared copies of them, has to keep the errors that this brings within it.

    Raises InputError if the images differ in size or offset, from each other or from the camera, or name a triangle
    the mesh does not have.
    """
    _check_same_rays(camera, hits, reference)
    verdict = np.zeros(hits.prim_id.shape, np.uint8)
    y, x = np.nonzero(hits.prim_id != reference.prim_id)
    first, second = (_candidates(Pairs(mesh, camera, x, y, one.prim_id[y, x], one.offset)) for one in (hits, reference))
    verdict[y, x] = _judge(first, second)
    depth_errors = []
    for image in (hits, reference):
        error = _relative_depth_error(mesh, camera, image)
        verdict[_has_wrong_depth(mesh, camera, image, error)] = Verdict.WRONG
        depth_errors.append(DepthErrors.of(error[image.hit]))
    return Agreement(verdict, *depth_errors)


def _check_same_rays(camera: View, hits: Hits, reference: Hits) -> None:
    shape = (camera.height, camera.width)
    for name, image in (("hits", hits), ("reference", reference)):
        if image.prim_id.shape != shape or image.depth.shape != shape:
            raise InputError(
                f"{name} has prim_id of shape {image.prim_id.shape} and depth of shape {image.depth.shape}, "
                f"but the camera's image is {shape} (height, width)"
            )
    if tuple(hits.offset) != tuple(reference.offset):
        raise InputError(
            f"hits were traced at offset {hits.offset}, the reference at {reference.offset}; expected the same rays"
        )


@dataclass(frozen=True, eq=False)
class _Candidates:
    """One candidate per pixel; nothing (a miss) is neither surely missed nor doubtful, and infinitely deep."""

    depth: NDArray[np.float64]
    depth_error: NDArray[np.float64]  # of a depth in float32
    nearest: NDArray[np.float64]  # least depth that a corner may have in float32
    doubtful: NDArray[np.bool_]
    surely_missed: NDArray[np.bool_]


def _judge(a: _Candidates, b: _Candidates) -> NDArray[np.uint8]:
    """(N,) verdicts on pixels whose two candidates differ."""
    missed = a.surely_missed | b.surely_missed
    both = np.isfinite(a.depth) & np.isfinite(b.depth)
    with np.errstate(invalid="ignore"):
        apart = np.abs(a.depth - b.depth)
        tied = both & ~missed & (apart <= TIE_TOLERANCE * np.maximum(a.depth, b.depth))
        close = both & (apart <= a.depth_error + b.depth_error)
    # The sure hit in front decides, whatever happens on the rim of something behind it.
    hidden = _is_sure_and_before(a, b) | _is_sure_and_before(b, a)
    edge = ~missed & ~hidden & (a.doubtful | b.doubtful | close)
    return np.select([tied, edge], [np.uint8(Verdict.TIED), np.uint8(Verdict.EDGE)], np.uint8(Verdict.WRONG))


def _is_sure_and_before(a: _Candidates, b: _Candidates) -> NDArray[np.bool_]:
    return ~a.doubtful & (a.depth + a.depth_error < b.nearest)


def _candidates(pairs: Pairs) -> _Candidates:
    named = pairs.prim_id != MISS
    nothing = {"depth": np.inf, "depth_error": 0.0, "nearest": np.inf, "doubtful": False, "surely_missed": False}
    every = {name: np.full(len(named), value) for name, value in nothing.items()}
    pairs = pairs[named]
    found, rounding = pairs.intersections, Rounding.of(pairs)
    doubtful = is_on_outline(pairs) | _is_undecided(pairs, rounding)
    every["depth"][named] = found.depth
    with np.errstate(invalid="ignore"):
        every["depth_error"][named] = rounding.depth * found.depth
    every["nearest"][named] = pairs.corners[..., 2].min(axis=1) - rounding.corners
    every["doubtful"][named] = doubtful
    every["surely_missed"][named] = ~doubtful & (found.edge_distance < 0.0)
    return _Candidates(**every)


def _is_undecided(pairs: Pairs, rounding: Rounding) -> NDArray[np.bool_]:
    """(N,) bool: with the errors of float32, the signs of the volumes could be those of a hit, and of a miss.

    A hit has the ray on the same side of all edges, and that sign is the one of the plane's distance ahead.
    """
    volumes = pairs.volumes
    unsure = rounding.edges * np.linalg.norm(pairs.rays[1], axis=1)
    sides = np.stack([volumes.u, volumes.v, volumes.facing - volumes.u - volumes.v])
    could_hit = must_hit = np.zeros(len(unsure), bool)
    for sign in (1, -1):
        could_hit = could_hit | ((sign * sides > -unsure).all(axis=0) & (sign * volumes.ahead > -rounding.ahead))
        must_hit = must_hit | ((sign * sides >= unsure).all(axis=0) & (sign * volumes.ahead >= rounding.ahead))
    return could_hit & ~must_hit & (pairs.corners[..., 2].max(axis=1) > -rounding.corners)


def _relative_depth_error(mesh: Mesh, camera: View, image: Hits) -> NDArray[np.float64]:
    """(H, W) float64: |stored depth - t| / t, where the ray meets the plane of the named triangle at t in float64.

    NaN for a miss; inf or NaN where the ray never meets the plane. A few products per pixel, since every pixel of an
    image is looked at: the plane has normal . point = height, the point of depth Z on the ray through (X, Y) on the
    image plane is (X reach, Y reach, Z), and the reach is Z for a pinhole and 1 for parallel rays.
    """
    error = np.full(image.prim_id.shape, np.nan)
    y, x = np.nonzero(image.prim_id != MISS)
    prim_id, depth = image.prim_id[y, x], image.depth[y, x].astype(np.float64)
    used, row = _numbered(mesh, prim_id)
    corners = camera.to_camera_space(mesh.triangles(used).reshape(-1, 3)).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height, along = (normal * corners[:, 0]).sum(axis=1)[row], normal[row, 2]
    plane = camera.plane
    across = (normal[:, 0] * plane.pitch_x)[row] * plane.columns(x, image.offset[0])
    across += (normal[:, 1] * plane.pitch_y)[row] * plane.rows(y, image.offset[1])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (height - across) / along if camera.is_parallel else height / (across + along)
        error[y, x] = np.abs(depth - t) / np.abs(t)
    return error


def _has_wrong_depth(mesh: Mesh, camera: View, image: Hits, error: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(H, W) bool: the stored depth is not one that float32 may find for the named triangle at this pixel.

    error: of `_relative_depth_error`. The few suspects are looked at closely.
    """
    wrong = (image.prim_id == MISS) & (image.depth != np.inf)
    y, x = np.nonzero(image.hit & ~(error <= ALLOWED_MULTIPLE * _LEAST_ROUNDINGS * FLOAT32_UNIT))
    if len(y):
        pairs = Pairs(mesh, camera, x, y, image.prim_id[y, x], image.offset)
        rounding, volumes, depth = Rounding.of(pairs), pairs.volumes, image.depth[y, x].astype(np.float64)
        with np.errstate(invalid="ignore"):  # inf x 0
            off = np.abs(depth * volumes.facing - volumes.ahead)
            excused = (depth >= 0.0) & (depth < np.inf) & (off <= rounding.ahead + depth * rounding.facing)
        wrong[y[~excused], x[~excused]] = True
    return wrong


def _numbered(mesh: Mesh, prim_id: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct `prim_id`, ascending, and each one's place among them; O(F), no sorting of a million pixels."""
    if len(prim_id) and prim_id.max() >= mesh.triangle_count:
        mesh.triangles(prim_id)  # raises, naming it
    is_used = np.zeros(mesh.triangle_count, bool)
    is_used[prim_id] = True
    place = np.cumsum(is_used) - 1
    return np.nonzero(is_used)[0], place[prim_id]
