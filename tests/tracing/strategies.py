"""What the property tests draw: meshes, cameras and splits, the awkward ones as likely as the pleasant ones."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import atra

LENGTH = os.environ.get("ATRA_HYPOTHESIS", "usual")
NIGHTLY = LENGTH == "nightly"
"""Many random examples, where nobody waits for them, instead of a few that are the same each time."""

EXAMPLES = settings(
    max_examples={"short": 8, "usual": 16, "nightly": 200}[LENGTH],
    derandomize=not NIGHTLY,
    deadline=None,  # the first example of a packet shape compiles
    database=None,
    suppress_health_check=list(HealthCheck),
    print_blob=True,
)
"""For each property."""

SIZES = ((1, 1), (8, 6), (13, 7), (24, 16), (48, 32))
"""Width and height of images: a pixel, cells narrower and wider than a packet, primes, many divisors."""

SCALES_AND_DISTANCES = ((1, 0), (1e-6, 0), (1e-3, 0), (1e3, 0), (1e6, 0), (1, 1e3), (1e-3, 1e4), (1e6, 1e5), (1, 1e6))
"""Factors on a mesh, and its distance from the origin in multiples of about its size."""


@dataclass(frozen=True)
class View:
    """A mesh, a camera on it, and how its image is cut and sampled."""

    mesh: atra.Mesh
    camera: atra.Camera | atra.OrthographicCamera
    split: tuple[int, int]
    offset: tuple[float, float]


def divisors(number: int) -> list[int]:
    """Ascending."""
    return [n for n in range(1, number + 1) if number % n == 0]


# Multiples of a quarter meet each other, the eye and the pixel grid exactly; other numbers do not.
_coordinates = st.integers(-8, 8).map(lambda n: n / 4) | st.floats(-2.0, 2.0, width=32, allow_subnormal=False)
_all_but_zero = st.sampled_from([0.0, 6e-17, -6e-17, 1e-19, -1e-19, -1e-30])
_points = st.tuples(_coordinates, _coordinates, _coordinates)


@st.composite
def meshes(draw: st.DrawFn, max_triangles: int = 40) -> atra.Mesh:
    """Triangles between few points, in a box of size 4 about the origin.

    Few points for many corners: edges are shared, triangles come twice or turned over, and lose their area where a
    corner is named twice. Some points lie a hair from another, which makes needles.
    """
    points = np.array(draw(st.lists(_points, min_size=6, max_size=24)))
    near = draw(st.lists(st.tuples(st.integers(0, len(points) - 1), st.sampled_from([1e-2, 1e-4, 1e-6])), max_size=3))
    points = np.concatenate([points, *([points[i] + [distance, -distance, 0.0]] for i, distance in near)])
    corners = st.integers(0, len(points) - 1)
    shape = st.tuples(st.integers(1, max_triangles), st.just(3))
    faces = draw(arrays(np.uint32, shape, elements=corners, fill=st.nothing()))
    return atra.Mesh(points, faces, "drawn")


@st.composite
def views(draw: st.DrawFn, *, max_triangles: int = 40) -> View:
    """A mesh seen from outside, from inside, from one of its corners or from on a face, or lying behind the eye; along
    an axis of the world or not, or all but along it; through any image plane.

    All of it is then scaled by up to a million either way, and moved up to a million times its size from the origin,
    where float32 leaves its vertices only a coarse grid.
    """
    mesh = draw(meshes(max_triangles))
    corners = mesh.triangles(np.arange(mesh.triangle_count))
    touched, seen = (corners[draw(st.integers(0, mesh.triangle_count - 1))] for _ in range(2))
    outside = st.tuples(_coordinates, _coordinates, st.sampled_from([-100.0, -10.0, 10.0]))
    eye = np.array(draw(outside | _points | st.sampled_from([touched[0], touched.mean(axis=0)])))
    forward = np.array(draw(st.sampled_from([seen.mean(axis=0), seen[0]]) | _points)) - eye
    if np.linalg.norm(forward) < 1e-3:
        forward = np.array([0.0, 0.0, 1.0])
    up = (0.0, 1.0, 0.0) if abs(forward[1]) < 0.9 * np.linalg.norm(forward) else (0.0, 0.0, 1.0)
    if draw(st.booleans()):
        axis = draw(st.integers(0, 2))
        forward, up = (draw(st.tuples(_all_but_zero, _all_but_zero, _all_but_zero)) for _ in range(2))
        forward, up = np.array(forward), np.array(up)
        forward[axis], up[(axis + 1) % 3] = draw(st.sampled_from([1.0, -2.0])), 1.0
    scale, distance = draw(st.sampled_from(SCALES_AND_DISTANCES))
    place = np.array([1.0, -0.7, 0.3]) * distance
    width, height = draw(st.sampled_from(SIZES))
    camera = atra.Camera(
        eye=tuple((eye + place) * scale),
        target=tuple((eye + place + forward) * scale),
        up=tuple(up),
        fov_y_degrees=draw(st.sampled_from([1e-3, 0.1, 1.0, 10.0, 45.0, 90.0, 150.0, 179.0]) | st.floats(10.0, 120.0)),
        width=width,
        height=height,
    )
    if draw(st.booleans()):
        camera = draw(calibrated(camera))
    split = (draw(st.sampled_from(divisors(width))), draw(st.sampled_from(divisors(height))))
    moved = atra.Mesh((mesh.vertices.astype(np.float64) + place) * scale, mesh.faces, mesh.name)
    return View(moved, camera, split, draw(offsets()))


@st.composite
def calibrated(draw: st.DrawFn, camera: atra.Camera) -> atra.CalibratedCamera:
    """The same camera with pixels that may not be square and a view axis that may pass beside the image, cropped."""
    stretched = draw(st.sampled_from([1.0, 0.5, 3.0]))
    axis_x, axis_y = (
        size * draw(st.sampled_from([0.5, 0.0, 0.37, -2.0, 9.0])) for size in (camera.width, camera.height)
    )
    left, top = draw(st.tuples(st.integers(0, 5), st.integers(0, 5)))
    plane = atra.ImagePlane(camera.pixel_pitch * stretched, camera.pixel_pitch, axis_x, axis_y, left, top)
    return atra.CalibratedCamera(camera.eye, camera.target, camera.up, camera.width, camera.height, plane=plane)


def offsets() -> st.SearchStrategy[tuple[float, float]]:
    """Sub-pixel positions: centres, borders, anything."""
    position = st.sampled_from([0.5, 0.0, 0.999999]) | st.floats(0.0, 1.0, exclude_max=True)
    return st.just((0.5, 0.5)) | st.tuples(position, position)


@st.composite
def parallel_views(draw: st.DrawFn) -> View:
    """The same with parallel rays, a hair to a hundred times as wide as the way from eye to target."""
    view = draw(views())
    camera = view.camera
    length = float(np.linalg.norm(np.subtract(camera.target, camera.eye)))
    height = length * draw(st.sampled_from([1e-3, 1.0, 100.0]))
    parallel = atra.OrthographicCamera(
        camera.eye, camera.target, camera.up, view_height=height, width=camera.width, height=camera.height
    )
    return replace(view, camera=parallel)
