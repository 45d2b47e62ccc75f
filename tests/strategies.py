"""What the property tests draw: meshes, cameras and splits, the awkward ones as likely as the pleasant ones."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import atra
from atra.alignment import Alignment
from atra.compare import DEPTH_TOLERANCE, FLOAT32_UNIT

LENGTH = os.environ.get("ATRA_HYPOTHESIS", "usual")
NIGHTLY = LENGTH == "nightly"
"""Many random examples, where nobody waits for them, instead of a few that are the same each time."""

EXAMPLES = settings(
    max_examples={"short": 8, "usual": 40, "nightly": 200}[LENGTH],
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
    camera: atra.Camera
    split: tuple[int, int]
    offset: tuple[float, float]


def divisors(number: int) -> list[int]:
    """Ascending."""
    return [n for n in range(1, number + 1) if number % n == 0]


# Multiples of a quarter meet each other, the eye and the pixel grid exactly; other numbers do not.
_coordinates = st.integers(-8, 8).map(lambda n: n / 4) | st.floats(-2.0, 2.0, width=32, allow_subnormal=False)
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
def views(
    draw: st.DrawFn,
    *,
    widest_degrees: float = 140.0,
    max_triangles: int = 40,
) -> View:
    """A mesh seen from outside, from inside, from one of its corners or from on a face, or lying behind the eye.

    All of it is then scaled by up to a million either way, and moved up to a million times its size from the origin,
    where float32 leaves its vertices only a coarse grid. widest_degrees: beyond 140, copies lose too many digits by
    their shear (docs/departures.md, "Wide views").
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
    scale, distance = draw(st.sampled_from(SCALES_AND_DISTANCES))
    place = np.array([1.0, -0.7, 0.3]) * distance
    width, height = draw(st.sampled_from(SIZES))
    camera = atra.Camera(
        eye=tuple((eye + place) * scale),
        target=tuple((eye + place + forward) * scale),
        up=up,
        fov_y_degrees=draw(
            st.sampled_from([1e-3, 0.1, 1.0, 10.0, 45.0, 90.0, widest_degrees]) | st.floats(10.0, 120.0)
        ),
        width=width,
        height=height,
    )
    split = (draw(st.sampled_from(divisors(width))), draw(st.sampled_from(divisors(height))))
    moved = atra.Mesh((mesh.vertices.astype(np.float64) + place) * scale, mesh.faces, mesh.name)
    return View(moved, camera, split, draw(offsets()))


def faces_at_the_eye(view: View, *, sheared: bool) -> np.ndarray:
    """(F,) bool: the eye is so nearly in the triangle that float32 cannot tell how far from it, or on which side.

    Float32 errs in the distance of the triangle's plane from the eye by FLOAT32_UNIT times its size, and for a needle
    by the tilt of a normal that is a difference of long products; a shear by s makes that (1 + s)^3 times as much
    (docs/departures.md, "Wide views"). Nearer than this over DEPTH_TOLERANCE, a depth may be off by more than that.
    """
    mesh, camera = view.mesh, view.camera
    shift = 0.0
    if sheared:
        alignment = Alignment.of_cells(camera, atra.Split(*view.split, camera.width, camera.height))
        shift = np.hypot(np.abs(alignment.shift_x).max(), np.abs(alignment.shift_y).max())
    corners = camera.to_eye_space(mesh.triangles(np.arange(mesh.triangle_count)).reshape(-1, 3)).reshape(-1, 3, 3)
    edges = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(corners, edges)  # of eye, corner, corner; their sum is the triangle's
    normal = normals.sum(axis=1)
    twice_area = np.linalg.norm(normal, axis=1)
    _, middle, longest = np.sort(np.linalg.norm(edges, axis=2), axis=1).T
    size = np.linalg.norm(corners, axis=2).max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = FLOAT32_UNIT * (1.0 + shift) ** 3 * (4.0 * size + longest**2 * middle / twice_area)
        from_plane = np.abs((normal * corners[:, 0]).sum(axis=1)) / twice_area
        along = np.clip(-(corners * edges).sum(axis=2) / (edges**2).sum(axis=2), 0.0, 1.0)
        over_it = ((normals @ normal[:, :, None])[..., 0] >= 0.0).all(axis=1)
    from_edges = np.linalg.norm(corners + np.nan_to_num(along)[..., None] * edges, axis=2).min(axis=1)
    nearest = np.minimum(error / DEPTH_TOLERANCE, 0.05 * size)  # near the eye in any case, whatever the needle
    return np.where(over_it, from_plane, from_edges) < nearest


def offsets() -> st.SearchStrategy[tuple[float, float]]:
    """Sub-pixel positions: centres, borders, anything."""
    position = st.sampled_from([0.5, 0.0, 0.999999]) | st.floats(0.0, 1.0, exclude_max=True)
    return st.just((0.5, 0.5)) | st.tuples(position, position)
