"""A mesh near the world's origin and the same mesh at map coordinates, moved there without rounding, with cameras."""

from __future__ import annotations

import numpy as np

import atra

AWAY = np.array([512344.0, 4598768.0, -120.0])
"""From the near mesh to the far one: whole steps of any origin that `boxes` may get, which float64 adds exactly."""

EYE = np.array([1.5, 2.25, 9.75])


def boxes(at=0.0, count=30, seed=1):
    """Closed boxes of different sizes that overlap, one of them twice; corners are multiples of 2^-16."""
    random = np.random.default_rng(seed)
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    low = np.round(random.uniform(-4.0, 3.0, (count, 1, 3)) * 2**16) / 2**16
    size = np.round(random.uniform(0.3, 1.5, (count, 1, 3)) * 2**16) / 2**16
    low[0], size[0], low[1], size[1] = -4.0, 1.0, 3.0, 1.0  # the box of all is [-4, 4]
    low[2], size[2] = low[3], size[3]
    vertices = (low + size * corners).reshape(-1, 3) + at
    return atra.Mesh(vertices, (np.array(faces) + 8 * np.arange(count)[:, None, None]).reshape(-1, 3), "boxes")


def cameras(at=0.0, pixels=32):
    """By name: the same views of `boxes`, whose eyes lie on a grid of 2^-2."""
    eye, target = tuple((EYE + at).tolist()), tuple((np.zeros(3) + at).tolist())
    sensor = atra.ImagePlane(2.5 / pixels, 2.5 / pixels, pixels / 2, pixels / 2)
    fisheye = atra.FisheyeLens(k1=0.05)
    return {
        "pinhole": atra.Camera(eye, target, width=pixels, height=pixels),
        "narrow": atra.Camera(eye, target, fov_y_degrees=0.3, width=pixels, height=pixels),
        "orthographic": atra.OrthographicCamera(eye, target, view_height=9.0, width=pixels, height=pixels),
        "calibrated": atra.Camera(eye, target, width=2 * pixels, height=pixels).crop(8, 0, pixels, pixels),
        "fisheye": atra.LensCamera(eye, target, (0.0, 1.0, 0.0), pixels, pixels, lens=fisheye, sensor=sensor),
        "panorama": atra.LensCamera.panorama(
            tuple((np.array([0.25, 1.5, 0.5]) + at).tolist()), target, width=2 * pixels
        ),
    }


NEAR, FAR = boxes(), boxes(AWAY)
SEEN_NEAR, SEEN_FAR = cameras(), cameras(AWAY)
