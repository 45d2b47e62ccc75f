"""Do two images agree, and if not, who is wrong?

Float32 tracers may differ where float32 cannot decide: on equally deep triangles and on the rim of a triangle. Every
pixel is therefore judged in float64, and each disagreement is either explained or called wrong. Nothing is averaged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from atra.camera import Camera
from atra.errors import InputError
from atra.hits import MISS, Hits
from atra.mesh import Mesh
from atra.reference import intersect_pixels

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


class Verdict(IntEnum):
    """What is said of one pixel of two images."""

    EQUAL = 0
    """Same triangle (or both miss), and both depths are right."""
    TIED = 1
    """Different triangles, both hit, equally deep."""
    EDGE = 2
    """The ray passes so close to the rim of one of the triangles that float32 cannot say hit or miss."""
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


def compare(mesh: Mesh, camera: Camera, hits: Hits, reference: Hits) -> Agreement:
    """Judge every pixel of two images of `mesh` seen by `camera`; symmetric in `hits` and `reference`.

    A candidate is the triangle an image names, or nothing for a miss. In float64 its ray hits it *surely*, misses it
    *surely*, or passes within EDGE_TOLERANCE (barycentric) or OUTLINE_TOLERANCE_PIXELS of its rim, which is
    *doubtful*. A triangle edge-on to the ray or without area has no inside: it is doubtful on its outline and
    surely missed elsewhere, so a tracer may report it where rounding gave it some width, and only there.

    Same candidate: EQUAL. Different ones, in this order:
    TIED   neither is surely missed, both have a depth, and the depths are equal to TIE_TOLERANCE;
    WRONG  one is surely missed, or none is doubtful, or the doubtful one lies entirely behind the sure one;
    EDGE   otherwise.

    Above all that, a pixel is WRONG if either image stores a depth that its triangle does not have there: off by
    more than DEPTH_TOLERANCE from every depth its plane has within DEPTH_SHIFT_PIXELS of the ray. Where the plane is
    edge-on within that shift, or the ray is within OUTLINE_TOLERANCE_PIXELS of the outline (a needle), any depth
    between the corners is accepted. A miss must store inf.

    Raises InputError if the images differ in size or offset, from each other or from the camera, or name a triangle
    the mesh does not have.
    """
    _check_same_rays(camera, hits, reference)
    verdict = np.zeros(hits.prim_id.shape, np.uint8)
    y, x = np.nonzero(hits.prim_id != reference.prim_id)
    verdict[y, x] = _judge(mesh, camera, x, y, hits.prim_id[y, x], reference.prim_id[y, x], hits.offset)
    for image in (hits, reference):
        verdict[_has_wrong_depth(mesh, camera, image)] = Verdict.WRONG
    return Agreement(verdict)


def _check_same_rays(camera: Camera, hits: Hits, reference: Hits) -> None:
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
    nearest: NDArray[np.float64]  # depth of the nearest corner
    doubtful: NDArray[np.bool_]
    surely_missed: NDArray[np.bool_]


def _judge(
    mesh: Mesh,
    camera: Camera,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    first: NDArray[np.uint32],
    second: NDArray[np.uint32],
    offset: tuple[float, float],
) -> NDArray[np.uint8]:
    """(N,) verdicts on pixels whose two candidates differ."""
    a = _candidates(mesh, camera, x, y, first, offset)
    b = _candidates(mesh, camera, x, y, second, offset)
    missed = a.surely_missed | b.surely_missed
    finite = np.isfinite(a.depth) & np.isfinite(b.depth)
    with np.errstate(invalid="ignore"):
        tied = finite & ~missed & (np.abs(a.depth - b.depth) <= TIE_TOLERANCE * np.maximum(a.depth, b.depth))
    # The sure hit in front decides, whatever happens on the rim of something behind it.
    hidden = (~a.doubtful & (a.depth < b.nearest)) | (~b.doubtful & (b.depth < a.nearest))
    edge = ~missed & ~hidden & (a.doubtful | b.doubtful)
    return np.select([tied, edge], [np.uint8(Verdict.TIED), np.uint8(Verdict.EDGE)], np.uint8(Verdict.WRONG))


def _candidates(
    mesh: Mesh,
    camera: Camera,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    prim_id: NDArray[np.uint32],
    offset: tuple[float, float],
) -> _Candidates:
    named = prim_id != MISS
    x, y, ids = x[named], y[named], prim_id[named]
    found = intersect_pixels(mesh, camera, x, y, ids, offset)
    on_rim = (np.abs(found.edge_distance) <= EDGE_TOLERANCE) | (
        _outline_distance_pixels(mesh, camera, x, y, ids, offset) <= OUTLINE_TOLERANCE_PIXELS
    )
    depth = np.full(len(prim_id), np.inf)
    nearest = np.full(len(prim_id), np.inf)
    doubtful = np.zeros(len(prim_id), bool)
    missed = np.zeros(len(prim_id), bool)
    depth[named] = found.depth
    nearest[named] = _corners_in_camera_space(mesh, camera, ids)[..., 2].min(axis=1)
    doubtful[named] = on_rim
    missed[named] = ~on_rim & (found.edge_distance < 0.0)
    return _Candidates(depth, nearest, doubtful, missed)


def _outline_distance_pixels(
    mesh: Mesh,
    camera: Camera,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    prim_id: NDArray[np.uint32],
    offset: tuple[float, float],
) -> NDArray[np.float64]:
    """(N,) float64, distance on the image from each ray to the outline of its triangle, in pixels.

    An edge that passes behind the eye is cut just in front of it; one entirely behind is infinitely far.
    """
    corners = _corners_in_camera_space(mesh, camera, prim_id)
    point = camera.directions(x, y, offset)[:, :2]
    closest = np.full(len(corners), np.inf)
    for i in range(3):
        start, end = corners[:, i], corners[:, (i + 1) % 3]
        # A millionth of the edge's size in front of the eye projects beyond any image.
        near = 1e-6 * np.maximum(np.abs(start).max(axis=1), np.abs(end).max(axis=1)) + np.finfo(float).tiny
        visible = np.maximum(start[:, 2], end[:, 2]) > near
        p, q = _on_image_plane(start, end, near), _on_image_plane(end, start, near)
        along = q - p
        length_squared = (along**2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.clip(((point - p) * along).sum(axis=1) / length_squared, 0.0, 1.0)
        t = np.where(length_squared > 0.0, t, 0.0)
        distance = np.linalg.norm(p + t[:, None] * along - point, axis=1)
        closest = np.where(visible, np.minimum(closest, distance), closest)
    return closest / camera.pixel_pitch


def _on_image_plane(
    point: NDArray[np.float64], other: NDArray[np.float64], near: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Project `point` onto Z = 1, first moved towards `other` up to depth `near` if it is nearer than that."""
    rise = other[:, 2] - point[:, 2]
    behind = (point[:, 2] < near) & (rise > 0.0)
    t = np.where(behind, (near - point[:, 2]) / np.where(behind, rise, 1.0), 0.0)
    moved = point + t[:, None] * (other - point)
    return moved[:, :2] / np.maximum(moved[:, 2], near)[:, None]


def _has_wrong_depth(mesh: Mesh, camera: Camera, image: Hits) -> NDArray[np.bool_]:
    """(H, W) bool: the stored depth is not a depth that the named triangle has at (or next to) this pixel.

    One division per pixel by the plane equation, since a whole image is checked; the few suspects are looked at
    closely.
    """
    wrong = (image.prim_id == MISS) & (image.depth != np.inf)
    y, x = np.nonzero(image.prim_id != MISS)
    prim_id = image.prim_id[y, x]
    stored = image.depth[y, x].astype(np.float64)
    used, row = _numbered(mesh, prim_id)
    corners = _corners_in_camera_space(mesh, camera, used)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = (normal * corners[:, 0]).sum(axis=1)
    # normal . direction, with a unit-Z direction that is linear in x and y
    slope_x = (normal[:, 0] * camera.pixel_pitch)[row]
    slope_y = (normal[:, 1] * camera.pixel_pitch)[row]
    pixel_x = x + (image.offset[0] - camera.width / 2)
    pixel_y = y + (image.offset[1] - camera.height / 2)
    facing = slope_x * pixel_x + slope_y * pixel_y + normal[row, 2]
    sign = np.sign(facing)
    facing, height_seen = np.abs(facing), height[row] * sign
    shift = DEPTH_SHIFT_PIXELS * (np.abs(slope_x) + np.abs(slope_y))
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = height_seen / (facing + shift) * (1.0 - DEPTH_TOLERANCE)
        highest = height_seen / (facing - shift) * (1.0 + DEPTH_TOLERANCE)
    right = (facing > shift) & (stored >= lowest) & (stored <= highest)
    suspect = np.nonzero(~right)[0]
    if len(suspect):
        grazing = ~(facing[suspect] > shift[suspect])
        excused = _is_between_corners_of_a_thin_triangle(
            mesh, camera, x[suspect], y[suspect], prim_id[suspect], image.offset, stored[suspect], grazing
        )
        suspect = suspect[~excused]
        wrong[y[suspect], x[suspect]] = True
    return wrong


def _is_between_corners_of_a_thin_triangle(
    mesh: Mesh,
    camera: Camera,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    prim_id: NDArray[np.uint32],
    offset: tuple[float, float],
    stored: NDArray[np.float64],
    grazing: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """(N,) bool: the triangle's plane says nothing about depth here, and the depth lies between its corners.

    The plane says nothing if it passes within the shift of the ray (`grazing`), or if the triangle is a needle on whose
    rim the ray lies: its normal, a difference of nearly equal products, may then lose all digits in float32.
    """
    thin = grazing | (_outline_distance_pixels(mesh, camera, x, y, prim_id, offset) <= OUTLINE_TOLERANCE_PIXELS)
    corners = _corners_in_camera_space(mesh, camera, prim_id)
    low, high = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
    slack = DEPTH_TOLERANCE * np.maximum(np.abs(low), np.abs(high))
    return thin & (stored >= np.maximum(low - slack, 0.0)) & (stored <= high + slack)


def _numbered(mesh: Mesh, prim_id: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct `prim_id`, ascending, and each one's place among them; O(F), no sorting of a million pixels."""
    if len(prim_id) and prim_id.max() >= mesh.triangle_count:
        mesh.triangles(prim_id)  # raises, naming it
    is_used = np.zeros(mesh.triangle_count, bool)
    is_used[prim_id] = True
    place = np.cumsum(is_used) - 1
    return np.nonzero(is_used)[0], place[prim_id]


def _corners_in_camera_space(mesh: Mesh, camera: Camera, prim_id: NDArray[np.integer]) -> NDArray[np.float64]:
    return camera.to_camera_space(mesh.triangles(prim_id).reshape(-1, 3)).reshape(-1, 3, 3)
