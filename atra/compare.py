"""Do two images agree, and if not, who is wrong?

Float32 tracers may differ where float32 cannot decide: on equally deep triangles, or nearly so, and on the rim of a
triangle. Every pixel is therefore judged in float64, and each disagreement is either explained or called wrong. Nothing
is averaged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.hits import MISS, Hits
from atra.mesh import Mesh
from atra.reference import Pairs
from atra.view import View

TIE_TOLERANCE = 1e-9
"""Relative difference up to which two float64 depths are the same depth."""

EDGE_TOLERANCE = 1e-4
"""Barycentric distance from an edge within which float32 may see either side; seen in practice: about 1e-5."""

OUTLINE_TOLERANCE_PIXELS = 1e-3
"""The same on the image. Float32 moves a ray by about 1e-4 pixels (1e-7 of some thousand pixels); for a triangle much
smaller than a pixel, or seen edge-on, that is more than EDGE_TOLERANCE."""

DEPTH_TOLERANCE = 1e-3
"""Relative error allowed in a stored depth."""

DEPTH_SHIFT_PIXELS = 0.01
"""A stored depth may also be that of a ray moved this far, which counts where a plane is seen at a grazing angle."""

FLOAT32_UNIT = 2.0**-24
"""Largest relative error of one rounding in float32."""


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


@dataclass(frozen=True, eq=False)
class Agreement:
    """The verdict on every pixel of two images.

    verdict: (H, W) uint8, values of `Verdict`. The counts are its histogram.
    Raises InputError for another dtype, another number of axes or an unknown code.
    """

    verdict: NDArray[np.uint8]
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
    *surely*, or passes so close to its rim that it is *doubtful*: within EDGE_TOLERANCE (barycentric) or
    OUTLINE_TOLERANCE_PIXELS, or so that the rounding of float32 could turn the sign of a volume that decides it. A
    triangle edge-on to the ray or without area has no inside: it is doubtful on its outline and surely missed
    elsewhere, so a tracer may report it where rounding gave it some width, and only there.

    Same candidate: EQUAL. Different ones, in this order:
    TIED   neither is surely missed, both have a depth, and the depths are equal to TIE_TOLERANCE;
    WRONG  one is surely missed, or the doubtful one lies entirely behind the sure one, or none is doubtful and their
           depths differ by more than the rounding of float32 can change them;
    EDGE   otherwise.

    Above all that, a pixel is WRONG if either image stores a depth that its triangle does not have there: off by
    more than DEPTH_TOLERANCE from every depth its plane has within DEPTH_SHIFT_PIXELS of the ray, and by more than the
    rounding of float32 can change it. Where these leave a depth open, because the plane is edge-on, or the ray is
    within OUTLINE_TOLERANCE_PIXELS of the outline (a needle), any depth between the corners is accepted. A miss must
    store inf.

    The rounding of float32 is that of a tracer which is given the mesh itself with the eye at the origin, and of its
    triangle test (`_Rounding`). Whoever traces other triangles than the mesh's, such as sheared copies of them, has to
    keep the errors that this brings within it.

    Raises InputError if the images differ in size or offset, from each other or from the camera, or name a triangle
    the mesh does not have.
    """
    _check_same_rays(camera, hits, reference)
    verdict = np.zeros(hits.prim_id.shape, np.uint8)
    y, x = np.nonzero(hits.prim_id != reference.prim_id)
    first, second = (_candidates(Pairs(mesh, camera, x, y, one.prim_id[y, x], one.offset)) for one in (hits, reference))
    verdict[y, x] = _judge(first, second)
    for image in (hits, reference):
        verdict[_has_wrong_depth(mesh, camera, image)] = Verdict.WRONG
    return Agreement(verdict)


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
    """How far off a float32 tracer may be about each triangle.

    A tracer subtracts the eye from the corners and rounds the result, subtracts corners from each other, multiplies the
    edges and the ray into volumes, and takes the signs and quotients of these. Each step errs relative to the lengths
    that go in. So, in units of rounding, with `far` the distance of the farthest corner:

    corners: 4 far; error of a corner's place.
    edges: 4 far x longest edge; error of the volume of an edge, the eye and the direction, per length of the direction.
    plane: 4 far x twice the area + longest edge squared x middle edge; error of the volume of the triangle and the eye.
        The second term is the rounding of the normal, a product of two edges, times the distance to the corner it
        belongs to; it rules where the corner between the two long edges of a needle comes first.

    None of these becomes less as the volume does. So a hit is the less certain the closer to the ray an edge passes,
    and a depth, a quotient, the closer the plane passes to the eye. Were all roundings at their worst and of one sign,
    errors could be about three times as large; in traced images they were 0.7 times as large at most.
    Source: N. J. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., SIAM 2002, chapter 3.
    """

    corners: NDArray[np.float64]
    edges: NDArray[np.float64]
    plane: NDArray[np.float64]

    @classmethod
    def of(cls, corners: NDArray[np.float64]) -> _Rounding:
        """corners: (N, 3, 3) float64, camera space."""
        far = np.linalg.norm(corners, axis=2).max(axis=1)
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        _, middle, longest = np.sort(edges, axis=1).T
        normal = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        sizes = 4 * far, 4 * far * longest, 4 * far * normal + longest**2 * middle
        return cls(*(FLOAT32_UNIT * size for size in sizes))


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
    found, rounding = pairs.intersections, _Rounding.of(pairs.corners)
    doubtful = (np.abs(found.edge_distance) <= EDGE_TOLERANCE) | _is_on_outline(pairs) | _is_undecided(pairs, rounding)
    every["depth"][named] = found.depth
    with np.errstate(divide="ignore", invalid="ignore"):
        every["depth_error"][named] = rounding.plane / np.abs(pairs.volumes.facing)
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
        could_hit = could_hit | ((sign * sides > -unsure).all(axis=0) & (sign * volumes.ahead > -rounding.plane))
        must_hit = must_hit | ((sign * sides >= unsure).all(axis=0) & (sign * volumes.ahead >= rounding.plane))
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


def _has_wrong_depth(mesh: Mesh, camera: View, image: Hits) -> NDArray[np.bool_]:
    """(H, W) bool: the stored depth is not a depth that the named triangle has at (or next to) this pixel.

    A few products per pixel, since a whole image is checked; the few suspects are looked at closely. The point of depth
    Z on the ray through (X, Y) on the image plane is (X reach, Y reach, Z), where the reach is Z for a pinhole and 1
    for parallel rays; the plane has normal . point = height. So what a wrong depth, and a moved ray, add to
    normal . point are linear in the pixel for both.
    """
    wrong = (image.prim_id == MISS) & (image.depth != np.inf)
    y, x = np.nonzero(image.prim_id != MISS)
    prim_id = image.prim_id[y, x]
    depth = image.depth[y, x].astype(np.float64)
    used, row = _numbered(mesh, prim_id)
    corners = camera.to_camera_space(mesh.triangles(used).reshape(-1, 3)).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = (normal * corners[:, 0]).sum(axis=1)
    slope_x, slope_y = normal[:, 0] * camera.pixel_pitch, normal[:, 1] * camera.pixel_pitch
    across = slope_x[row] * (x + (image.offset[0] - camera.width / 2))
    across += slope_y[row] * (y + (image.offset[1] - camera.height / 2))
    along = normal[row, 2]
    shift = (DEPTH_SHIFT_PIXELS * (np.abs(slope_x) + np.abs(slope_y)))[row]
    with np.errstate(invalid="ignore"):
        if camera.is_parallel:
            facing = depth * np.abs(along)
            off_plane = np.abs(across + depth * along - height[row])
        else:
            shift *= depth
            facing = depth * np.abs(across + along)
            off_plane = np.abs(depth * (across + along) - height[row])
        allowed = shift + DEPTH_TOLERANCE * facing
        right = (facing > shift) & (off_plane <= allowed) & (depth < np.inf)
    suspect = np.nonzero(~right)[0]
    if len(suspect):
        pairs = Pairs(mesh, camera, x[suspect], y[suspect], prim_id[suspect], image.offset)
        rounding = _Rounding.of(pairs.corners)
        on_plane = off_plane[suspect] <= allowed[suspect] + rounding.plane
        excused = (on_plane | _is_on_outline(pairs)) & _is_between_corners(pairs, depth[suspect], rounding)
        suspect = suspect[~excused]
        wrong[y[suspect], x[suspect]] = True
    return wrong


def _is_between_corners(pairs: Pairs, depth: NDArray[np.float64], rounding: _Rounding) -> NDArray[np.bool_]:
    """(N,) bool: not before the eye, and no nearer and no farther than the triangle's corners."""
    low, high = pairs.corners[..., 2].min(axis=1), pairs.corners[..., 2].max(axis=1)
    slack = DEPTH_TOLERANCE * np.maximum(np.abs(low), np.abs(high)) + rounding.corners
    return (depth >= np.maximum(low - slack, 0.0)) & (depth <= high + slack)


def _numbered(mesh: Mesh, prim_id: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct `prim_id`, ascending, and each one's place among them; O(F), no sorting of a million pixels."""
    if len(prim_id) and prim_id.max() >= mesh.triangle_count:
        mesh.triangles(prim_id)  # raises, naming it
    is_used = np.zeros(mesh.triangle_count, bool)
    is_used[prim_id] = True
    place = np.cumsum(is_used) - 1
    return np.nonzero(is_used)[0], place[prim_id]
