"""Hits -> pictures: clay shading, the difference of two images."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits
from atra.judge.compare import Verdict
from atra.judge.marks import mark_verdicts

BACKGROUND = (236, 238, 241)
"""RGB of a miss."""

# To the light, in camera space (X right, Y down, Z into the picture): behind the eye, above its left shoulder.
_TO_LIGHT = np.array([-0.45, -0.65, -0.61])
_AMBIENT, _KEY, _HEADLIGHT = 0.14, 0.56, 0.30

# The darkest, middle and lightest clay. A ramp of few tones keeps PNG files small.
_RAMP = np.array([(38, 30, 27), (164, 128, 106), (247, 236, 222)], np.float64)
_TONES = 128

_CREASE_RADII_PIXELS = (1, 3, 9)
_CREASE_STRENGTH = 0.45
_HAZE = 0.28


def shade(hits: Hits) -> NDArray[np.uint8]:
    """A clay model of what was hit: (H, W, 3) uint8 RGB.

    A directional light at the eye's shoulder and a weaker one along the view axis meet geometric normals, turned to
    the eye; creases are darkened and far surfaces hazed to give depth. A miss is `BACKGROUND`. The tone of a triangle
    depends on its orientation and its depth alone, so equal hits give equal pictures whoever traced them.
    """
    hit = hits.hit
    picture = np.empty((*hit.shape, 3), np.uint8)
    picture[:] = BACKGROUND
    if not hit.any():
        return picture
    tone = _face_tones(hits)[hits.prim_id[hit]] - _creases(hits)[hit]
    haze = _HAZE * _distance(hits)
    tone = np.clip(tone * (1 - haze) + 0.8 * haze, 0.0, 1.0)
    picture[hit] = _ramp()[np.rint(tone * (_TONES - 1)).astype(np.intp)]
    return picture


def _face_tones(hits: Hits) -> NDArray[np.float64]:
    """(F,) float64 in [0, 1], the light each triangle returns; one without area counts as seen face on."""
    corners = hits.camera.to_camera_space(hits.mesh.vertices)[hits.mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals = np.where(length[:, None] > 0, normals / np.where(length > 0, length, 1)[:, None], (0.0, 0.0, -1.0))
    # A triangle has two sides; the one seen is the one whose normal points to the eye at the origin.
    normals *= np.where((normals * corners.mean(axis=1)).sum(axis=1) > 0, -1.0, 1.0)[:, None]
    key = np.clip(0.25 + 0.75 * normals @ (_TO_LIGHT / np.linalg.norm(_TO_LIGHT)), 0.0, 1.0)
    return _AMBIENT + _KEY * key + _HEADLIGHT * np.abs(normals[:, 2])


def _creases(hits: Hits) -> NDArray[np.float32]:
    """(H, W) float32, how much darker a pixel gets because its surroundings rise towards the eye.

    The inverse depth of a plane is linear over the image, so its second difference is zero on any plane and positive
    in a concave corner or beside something nearer.
    """
    inverse = np.where(hits.hit, np.float32(1) / hits.depth, np.float32(0))
    darker = np.zeros_like(inverse)
    height, width = inverse.shape
    for radius in _CREASE_RADII_PIXELS:
        for step_x, step_y in ((1, 0), (0, 1), (1, 1), (1, -1)):
            dx, dy = step_x * radius, step_y * radius
            # Where a neighbour would lie outside the image nothing is known, and nothing darkens.
            rows, columns = slice(abs(dy), height - abs(dy)), slice(dx, width - dx)
            middle = inverse[rows, columns]
            if middle.size == 0:
                continue
            ahead = inverse[abs(dy) + dy : height - abs(dy) + dy, 2 * dx : width]
            behind = inverse[abs(dy) - dy : height - abs(dy) - dy, 0 : width - 2 * dx]
            with np.errstate(divide="ignore", invalid="ignore"):
                rise = (0.5 * (ahead + behind) - middle) / middle * np.float32(24 / radius**0.5)
                # A jump is no crease: the farther in front the neighbour, the less it darkens. And below 0.02 it is
                # rounding of the depths, which two tracers may do differently.
                darker[rows, columns] += np.where(rise > 0.02, np.minimum(rise, 1 / rise), 0)
    return darker * np.float32(_CREASE_STRENGTH / (4 * len(_CREASE_RADII_PIXELS)))


def _distance(hits: Hits) -> NDArray[np.float64]:
    """(N,) float64 of the hit pixels, 0 = among the nearest, 1 = among the farthest of the image."""
    depth = np.log(hits.depth[hits.hit].astype(np.float64))
    near, far = np.quantile(depth, [0.02, 0.98])
    # A picture of one depth has no distance to show, rounding aside.
    return np.clip((depth - near) / (far - near), 0, 1) if far - near > 1e-3 else np.zeros_like(depth)


def _ramp() -> NDArray[np.uint8]:
    place = np.linspace(0, len(_RAMP) - 1, _TONES)
    colours = np.stack([np.interp(place, range(len(_RAMP)), _RAMP[:, i]) for i in range(3)], axis=1)
    return np.rint(colours).astype(np.uint8)


def difference_picture(
    aligned: Hits, pixel: Hits, verdict: NDArray[np.uint8] | None = None, reach_pixels: int | None = None
) -> NDArray[np.uint8]:
    """Where two images differ: (H, W, 3) uint8 RGB, white where they are equal.

    verdict: (H, W) uint8 codes of `Verdict` (`Agreement.verdict`). Without it a pixel with another triangle, or with
    the same one at a depth off by more than a thousandth, is marked as wrong, since nobody has excused it.
    reach_pixels: how far a mark reaches beyond its pixel, so that one pixel in a million is seen; 0 marks the pixels
    alone, None chooses by the image's size. Where marks overlap, the graver verdict is on top.
    """
    if verdict is None:
        verdict = np.where(_differs(aligned, pixel), np.uint8(Verdict.WRONG), np.uint8(Verdict.EQUAL))
    return mark_verdicts(verdict, reach_pixels)


def _differs(aligned: Hits, pixel: Hits) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):  # inf - inf of two misses
        off = np.abs(aligned.depth - pixel.depth) > 1e-3 * np.minimum(aligned.depth, pixel.depth)
    return (aligned.prim_id != pixel.prim_id) | off
