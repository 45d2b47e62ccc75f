"""Do two images agree, and if not, who is wrong?

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
from atra.geometry.ray_space import ray_axes, to_ray_space
from atra.geometry.view import View
from atra.hits import MISS, Hits
from atra.kernels.rounding import ALLOWED_MULTIPLE, FLOAT32_UNIT

TIE_TOLERANCE = 1e-9
"""Relative difference up to which two float64 depths are the same depth."""

OUTLINE_TOLERANCE_PIXELS = 1e-3
"""How far from a triangle's outline a ray may pass and be on either side of it. Float32 moves a ray by about 1e-4
pixels (1e-7 of some thousand pixels)."""

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
    *surely*, or passes so close to its rim that it is *doubtful*: within OUTLINE_TOLERANCE_PIXELS, or so that the
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
    triangle test, for this very ray and triangle (`_Rounding`), times ALLOWED_MULTIPLE. Whoever traces other triangles
    than the mesh's, such as sheared copies of them, has to keep the errors that this brings within it.

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
class _Rounding:
    """How far off float32 may be about each pair of ray and triangle.

    A tracer subtracts the eye from the corners and rounds the result, subtracts corners from each other, multiplies the
    edges and the ray into volumes, and takes the signs and quotients of these; all that in ray space. Each step errs
    relative to the lengths that go in. With `far` the distance of the farthest corner, first corner v0, edges a and b
    at it, normal n = a x b, and the ray o + t d, in units of rounding:

    corners: 4 far; error of a corner's place.
    edges: 4 far x longest edge; error of the volume of an edge, the eye and the direction, per length of the direction.
    ahead: of n . (v0 - o). Corners, component by component, times n, as each is rounded, and the products that n is
        made of times the way from v0 to the hit: an error of n moves the plane about v0.
    facing: of n . d, the direction being the sum of a column's and a row's, and three roundings for products and
        quotient.
    depth: relative, of their quotient: each over its volume.

    All but `corners` and `edges` are ALLOWED_MULTIPLE times that. None of these becomes less as the volume does. So a
    hit is the less certain the closer to the ray an edge passes, and a depth, the closer the plane passes to the eye.
    Source: N. J. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., SIAM 2002, chapter 3.
    """

    corners: NDArray[np.float64]
    edges: NDArray[np.float64]
    ahead: NDArray[np.float64]
    facing: NDArray[np.float64]
    depth: NDArray[np.float64]

    @classmethod
    def of(cls, pairs: Pairs) -> _Rounding:
        camera, mesh = pairs.camera, pairs.mesh
        faces = mesh.traced_faces[pairs.prim_id]
        corners = to_ray_space(camera, mesh.vertices[faces].reshape(-1, 3)).reshape(-1, 3, 3)
        far = np.linalg.norm(corners, axis=2).max(axis=1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)

        axes = ray_axes(camera)
        origins, directions = (side @ axes for side in pairs.rays)
        across, along = (pairs.rays[0 if camera.is_parallel else 1][:, axis, None] * axes[axis] for axis in (0, 1))
        summands = np.abs(across) + np.abs(along if camera.is_parallel else along + axes[2])
        first, a, b = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(a, b)
        ahead, facing = ((normal * side).sum(axis=1) for side in (first - origins, directions))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            to_hit = np.abs(first - origins - (ahead / facing)[:, None] * directions)
        a, b, normal = np.abs(a), np.abs(b), np.abs(normal)
        to_hit = np.fmin(to_hit, np.maximum(a, b))  # in the triangle, whatever the plane says
        products = np.roll(a, -1, axis=1) * np.roll(b, 1, axis=1) + np.roll(a, 1, axis=1) * np.roll(b, -1, axis=1)
        places = np.abs(corners).max(axis=1) + (summands if camera.is_parallel else 0.0)
        of_ahead = ((normal * places) + products * to_hit).sum(axis=1)
        of_facing = (normal * (np.abs(directions) + (0.0 if camera.is_parallel else summands))).sum(axis=1)
        of_facing += 3.0 * np.abs(facing)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = of_ahead / np.abs(ahead) + of_facing / np.abs(facing)
        depth[np.isnan(depth)] = np.inf
        multiples = (ALLOWED_MULTIPLE * size for size in (of_ahead, of_facing, depth))
        return cls(*(FLOAT32_UNIT * size for size in (4 * far, 4 * far * longest, *multiples)))


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
    found, rounding = pairs.intersections, _Rounding.of(pairs)
    doubtful = _is_on_outline(pairs) | _is_undecided(pairs, rounding)
    every["depth"][named] = found.depth
    with np.errstate(invalid="ignore"):
        every["depth_error"][named] = rounding.depth * found.depth
    every["nearest"][named] = pairs.corners[..., 2].min(axis=1) - rounding.corners
    every["doubtful"][named] = doubtful
    every["surely_missed"][named] = ~doubtful & (found.edge_distance < 0.0)
    return _Candidates(**every)


def _is_undecided(pairs: Pairs, rounding: _Rounding) -> NDArray[np.bool_]:
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


def _is_on_outline(pairs: Pairs) -> NDArray[np.bool_]:
    """(N,) bool: the ray is within OUTLINE_TOLERANCE_PIXELS of its triangle's outline on the image.

    An edge that passes behind the eye is cut just in front of it; one entirely behind is infinitely far.
    """
    camera = pairs.camera
    point = _on_image_plane(camera, np.add(*pairs.rays))
    closest = np.full(len(point), np.inf)
    for i in range(3):
        start, end = pairs.corners[:, i], pairs.corners[:, (i + 1) % 3]
        # A millionth of the edge's size in front of the eye projects beyond any image.
        near = 1e-6 * np.maximum(np.abs(start).max(axis=1), np.abs(end).max(axis=1)) + np.finfo(float).tiny
        visible = np.maximum(start[:, 2], end[:, 2]) > near
        p, q = _on_image_plane(camera, _cut(start, end, near)), _on_image_plane(camera, _cut(end, start, near))
        along = q - p
        length_squared = (along**2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.clip(((point - p) * along).sum(axis=1) / length_squared, 0.0, 1.0)
        t = np.where(length_squared > 0.0, t, 0.0)
        distance = np.linalg.norm(p + t[:, None] * along - point, axis=1)
        closest = np.where(visible, np.minimum(closest, distance), closest)
    return closest <= OUTLINE_TOLERANCE_PIXELS * camera.pixel_pitch


def _cut(point: NDArray[np.float64], other: NDArray[np.float64], near: NDArray[np.float64]) -> NDArray[np.float64]:
    """`point`, moved towards `other` up to depth `near` if it is nearer than that."""
    rise = other[:, 2] - point[:, 2]
    behind = (point[:, 2] < near) & (rise > 0.0)
    t = np.where(behind, (near - point[:, 2]) / np.where(behind, rise, 1.0), 0.0)
    moved = point + t[:, None] * (other - point)
    moved[:, 2] = np.maximum(moved[:, 2], near)
    return moved


def _on_image_plane(camera: View, point: NDArray[np.float64]) -> NDArray[np.float64]:
    return point[:, :2] if camera.is_parallel else point[:, :2] / point[:, 2:]


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
    across = normal[row, 0] * (x + (image.offset[0] - camera.width / 2))
    across += normal[row, 1] * (y + (image.offset[1] - camera.height / 2))
    across *= camera.pixel_pitch
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
        rounding, volumes, depth = _Rounding.of(pairs), pairs.volumes, image.depth[y, x].astype(np.float64)
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
