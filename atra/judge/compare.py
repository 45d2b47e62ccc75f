"""The comparison of two images by pixel.

Float32 tracers may differ where float32 cannot decide: between triangles at almost the same depth, and at a triangle's
rim. So every pixel is judged in float64, and each difference is either explained or wrong. At an edge that two
triangles share a tracer may name either one, but must name one: otherwise it has a hole (`atra.judge.holes`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.exact.intersection import Pairs
from atra.exact.outline import is_on_outline
from atra.exact.rounding import Rounding
from atra.exact.ties import TIE_TOLERANCE
from atra.geometry.mesh import Mesh
from atra.hits import Hits
from atra.judge.depths import has_wrong_depth, relative_depth_error
from atra.judge.holes import is_closed_around
from atra.prim_ids import MISS


class Verdict(IntEnum):
    """The verdict on one pixel of two images."""

    EQUAL = 0
    """Same triangle (or both miss), and both depths are right."""
    TIED = 1
    """Different triangles, both hit at the same depth."""
    EDGE = 2
    """Float32 cannot decide whether the ray hits (too close to a rim), or which triangle is in front."""
    WRONG = 3
    """At least one image is not what a tracer may return."""


@dataclass(frozen=True)
class DepthErrors:
    """Relative errors of an image's depths against the planes of its triangles in float64.

    Attributes
    ----------
    largest : float
        Largest error of all hits, 0 without hits.
    p999 : float
        Error that 99.9 % of the hits do not exceed, 0 without hits.
    """

    largest: float = 0.0
    p999: float = 0.0

    @classmethod
    def of(cls, errors: NDArray[np.float64]) -> Self:
        """Summarise errors, (N,) float64; those of rays that never meet the plane are not finite and left out."""
        errors = errors[np.isfinite(errors)]
        return cls(float(errors.max()), float(np.quantile(errors, 0.999))) if len(errors) else cls()


@dataclass(frozen=True, eq=False)
class Agreement:
    """The verdict on every pixel of two images.

    Attributes
    ----------
    verdict : (H, W) uint8
        Values of `Verdict`.
    depth_errors, reference_depth_errors : DepthErrors
        Of the first image, and of the reference.
    holes, reference_holes : (H, W) bool, optional
        Pixels that are WRONG since the first image, or the reference, shows a miss or a triangle behind, where the ray
        hits the triangle that the other names, or passes between it and a neighbour; None = no pixel.
    pixels_equal, pixels_tied, pixels_edge, pixels_wrong : int
        Numbers of pixels by verdict.
    pixels_hole, reference_pixels_hole : int
        Numbers of holes.

    Raises
    ------
    InputError
        For another dtype, number of axes or code, and for holes of another shape or that are not WRONG.
    """

    verdict: NDArray[np.uint8]
    depth_errors: DepthErrors = DepthErrors()
    reference_depth_errors: DepthErrors = DepthErrors()
    holes: NDArray[np.bool_] | None = None
    reference_holes: NDArray[np.bool_] | None = None
    pixels_equal: int = field(init=False)
    pixels_tied: int = field(init=False)
    pixels_edge: int = field(init=False)
    pixels_wrong: int = field(init=False)
    pixels_hole: int = field(init=False)
    reference_pixels_hole: int = field(init=False)

    def __post_init__(self) -> None:
        verdict = self.verdict
        if verdict.dtype != np.uint8 or verdict.ndim != 2:
            raise InputError(f"verdict is {verdict.dtype} of shape {verdict.shape}, expected uint8 of shape (H, W)")
        counts = np.bincount(verdict.reshape(-1), minlength=len(Verdict))
        if len(counts) > len(Verdict):
            raise InputError(f"verdict holds the code {len(counts) - 1}, expected at most {max(Verdict):d}")
        for kind in Verdict:
            object.__setattr__(self, f"pixels_{kind.name.lower()}", int(counts[kind]))
        for name, count in (("holes", "pixels_hole"), ("reference_holes", "reference_pixels_hole")):
            holes = getattr(self, name)
            if holes is not None and (holes.dtype != np.bool_ or holes.shape != verdict.shape):
                raise InputError(f"{name} is {holes.dtype} of {holes.shape}, expected bool of {verdict.shape}")
            if holes is not None and (verdict[holes] != Verdict.WRONG).any():
                raise InputError(f"{name} has pixels whose verdict is not WRONG; expected every hole to be wrong")
            object.__setattr__(self, count, 0 if holes is None else int(holes.sum()))

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.verdict.size

    def __str__(self) -> str:
        holes = self.pixels_hole + self.reference_pixels_hole
        return (
            f"{self.pixels_equal} of {self.pixels} pixels equal, {self.pixels_tied} tied, "
            f"{self.pixels_edge} edge, {self.pixels_wrong} wrong{f', {holes} of them holes' * bool(holes)}"
        )


def compare(hits: Hits, reference: Hits) -> Agreement:
    """Judge every pixel of two images of one mesh by one camera; symmetric in both images.

    A candidate is the triangle that an image names, or none for a miss. In float64 the ray hits it *surely*, misses it
    *surely*, or it is *undecided*: the ray passes within a thousandth of a pixel of its rim, or rounding of float32
    could change the sign of a volume that decides it. A triangle edge-on to the ray or without area is undecided on its
    outline, where rounding may give it some width, and surely missed elsewhere. A plane that contains the eye is
    undecided.

    Same candidate: EQUAL. Different ones, in this order:

    - TIED: neither is surely missed, both have a depth, and the depths are equal to TIE_TOLERANCE;
    - WRONG: one is surely missed, or the undecided one lies entirely behind the sure one, or none is undecided and
      their depths differ by more than rounding of float32;
    - WRONG: a hole: the undecided one is in front of the other, or the other is a miss, and its surface continues all
      around the ray;
    - EDGE: otherwise.

    In any case a pixel is WRONG if an image's depth differs from that of its triangle's plane by more than rounding of
    float32, or if a miss does not store inf. In a plane through the eye any depth is accepted.

    Rounding of float32 is bounded for this ray and triangle of the mesh itself, with the eye at the origin
    (`atra.exact.rounding`), times ALLOWED_MULTIPLE. Methods that trace other triangles, such as sheared copies, must
    keep within this bound.

    Parameters
    ----------
    hits, reference : Hits
        Two images of equal meshes, by equal cameras, at one offset.

    Returns
    -------
    Agreement
        The verdict on every pixel, its counts, and the errors of both images' depths.

    Raises
    ------
    InputError
        For images of other meshes, cameras or offsets, for arrays that do not fit the camera, and for a triangle that
        the mesh does not have.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera(eye=(0.2, 0.2, 2), target=(0.2, 0.2, 0), width=3, height=3)
    >>> print(atra.compare(atra.trace(mesh, camera), atra.trace(mesh, camera, "pixel")))
    9 of 9 pixels equal, 0 tied, 0 edge, 0 wrong
    """
    mesh, camera = hits.mesh, hits.camera
    _check_same_rays(hits, reference)
    verdict = np.zeros(hits.prim_id.shape, np.uint8)
    y, x = np.nonzero(hits.prim_id != reference.prim_id)
    first, second = (_candidates(Pairs(mesh, camera, x, y, one.prim_id[y, x], one.offset)) for one in (hits, reference))
    judged = _judge(first, second)
    holes = []
    for image, lacking, other, seen in ((hits, first, reference, second), (reference, second, hits, first)):
        has_hole = _has_hole(judged, lacking, seen, Pairs(mesh, camera, x, y, other.prim_id[y, x], image.offset))
        holes.append(np.zeros(verdict.shape, np.bool_))
        holes[-1][y, x] = has_hole
    verdict[y, x] = judged
    for image_holes in holes:
        verdict[image_holes] = Verdict.WRONG
    depth_errors = []
    for image in (hits, reference):
        error = relative_depth_error(mesh, camera, image)
        verdict[has_wrong_depth(mesh, camera, image, error)] = Verdict.WRONG
        depth_errors.append(DepthErrors.of(error[image.hit]))
    return Agreement(verdict, depth_errors[0], depth_errors[1], holes[0], holes[1])


def _check_same_rays(hits: Hits, reference: Hits) -> None:
    if not _are_equal(hits.mesh, reference.mesh):
        raise InputError(f"hits show {hits.mesh!r}, the reference {reference.mesh!r}; expected equal meshes")
    if hits.camera != reference.camera:
        raise InputError(f"hits were seen by {hits.camera!r}, the reference by {reference.camera!r}; expected the same")
    shape = (hits.camera.height, hits.camera.width)
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


def _are_equal(one: Mesh, other: Mesh) -> bool:
    """Whether two meshes have the same triangles in the same places."""
    names = ("local_vertices", "faces", "origin")
    return one is other or all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


@dataclass(frozen=True, eq=False)
class _Candidates:
    """One candidate per pixel; a miss is neither surely missed nor undecided, and has infinite depth."""

    depth: NDArray[np.float64]
    depth_error: NDArray[np.float64]  # bound of the depth's error in float32
    nearest: NDArray[np.float64]  # least depth of a corner in float32
    undecided: NDArray[np.bool_]
    surely_missed: NDArray[np.bool_]


def _judge(a: _Candidates, b: _Candidates) -> NDArray[np.uint8]:
    """(N,) verdicts on pixels whose two candidates differ."""
    missed = a.surely_missed | b.surely_missed
    both = np.isfinite(a.depth) & np.isfinite(b.depth)
    with np.errstate(invalid="ignore"):
        apart = np.abs(a.depth - b.depth)
        tied = both & ~missed & (apart <= TIE_TOLERANCE * np.maximum(a.depth, b.depth))
        close = both & (apart <= a.depth_error + b.depth_error)
    # A sure hit in front decides; the rim of a triangle behind it does not matter.
    hidden = _is_sure_and_before(a, b) | _is_sure_and_before(b, a)
    edge = ~missed & ~hidden & (a.undecided | b.undecided | close)
    return np.select([tied, edge], [np.uint8(Verdict.TIED), np.uint8(Verdict.EDGE)], np.uint8(Verdict.WRONG))


def _has_hole(judged: NDArray[np.uint8], lacking: _Candidates, seen: _Candidates, pairs: Pairs) -> NDArray[np.bool_]:
    """(N,) bool, whether the image with candidates `lacking` has a hole at the triangle of `seen`, which `pairs` names.

    judged: from `_judge`. A sure hit in front that is lacking is a hole, too.
    """
    with np.errstate(invalid="ignore"):  # inf - inf
        in_front = np.isfinite(seen.depth) & (seen.depth + seen.depth_error + lacking.depth_error < lacking.depth)
    in_front &= ~seen.surely_missed & (judged >= Verdict.EDGE)
    holes = in_front & ~seen.undecided & (judged == Verdict.WRONG)
    asked = np.flatnonzero(in_front & seen.undecided)
    limit = lacking.depth[asked] - np.where(np.isfinite(lacking.depth[asked]), lacking.depth_error[asked], 0.0)
    holes[asked] = is_closed_around(pairs[asked], limit)
    return holes


def _is_sure_and_before(a: _Candidates, b: _Candidates) -> NDArray[np.bool_]:
    return ~a.undecided & (a.depth + a.depth_error < b.nearest)


def _candidates(pairs: Pairs) -> _Candidates:
    named = pairs.prim_id != MISS
    nothing = {"depth": np.inf, "depth_error": 0.0, "nearest": np.inf, "undecided": False, "surely_missed": False}
    every = {name: np.full(len(named), value) for name, value in nothing.items()}
    pairs = pairs[named]
    found, rounding = pairs.intersections, Rounding.of(pairs)
    undecided = is_on_outline(pairs) | _is_undecided(pairs, rounding)
    every["depth"][named] = found.depth
    with np.errstate(invalid="ignore"):
        every["depth_error"][named] = rounding.depth * found.depth
    every["nearest"][named] = pairs.depths.min(axis=1) - rounding.corners
    every["undecided"][named] = undecided
    every["surely_missed"][named] = ~undecided & (found.edge_distance < 0.0)
    return _Candidates(**every)


def _is_undecided(pairs: Pairs, rounding: Rounding) -> NDArray[np.bool_]:
    """(N,) bool, whether errors of float32 could make the volumes' signs those of a hit or of a miss.

    For a hit the ray is on the same side of all edges, with the same sign as the plane's distance ahead.
    """
    volumes = pairs.volumes
    unsure = rounding.edges * np.linalg.norm(pairs.rays[1], axis=1)
    sides = np.stack([volumes.u, volumes.v, volumes.facing - volumes.u - volumes.v])
    could_hit = must_hit = np.zeros(len(unsure), bool)
    for sign in (1, -1):
        could_hit = could_hit | ((sign * sides > -unsure).all(axis=0) & (sign * volumes.ahead > -rounding.ahead))
        must_hit = must_hit | ((sign * sides >= unsure).all(axis=0) & (sign * volumes.ahead >= rounding.ahead))
    return could_hit & ~must_hit & (pairs.depths.max(axis=1) > -rounding.corners)
