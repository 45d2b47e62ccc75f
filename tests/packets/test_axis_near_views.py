"""Packets lose no hit where a component of a direction is all but zero.

Embree's packets choose near and far planes by the sign of a component, and then take the reciprocal of one below 1e-18
as that of +1e-18: a packet with a tiny negative component missed what it should hit.
"""

import math

import numpy as np
import pytest

import atra
from atra.alignment.alignment import Alignment
from atra.alignment.copies import instance_transforms
from atra.geometry.ray_space import ray_axes
from tests.images import METHODS, PARALLEL, trace
from tests.machine import WIDTHS
from tests.meshes import quads

each_width = pytest.mark.parametrize(
    "width", [pytest.param(one, marks=() if one == WIDTHS[-1] else pytest.mark.slow) for one in WIDTHS]
)
"""No other fast test needs the kernels of the narrower packets."""
TINY = (6e-17, 1e-18, 1e-19, 1e-20, 1e-30, 1e-38, 1e-45)


def grid_wall(cells=40):
    """A square of 18 x 18 in the plane z = 0, slightly off the axes, of 2 x cells x cells triangles."""
    x, y = np.meshgrid(np.linspace(-9, 9, cells + 1), np.linspace(-9, 9, cells + 1))
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, c, d, e = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    faces = np.concatenate([np.stack([a, c, e], 1), np.stack([a, e, d], 1)])
    return atra.Mesh(np.stack([x + 0.123, y + 0.077, 0 * x], -1).reshape(-1, 3), faces)


WALL = grid_wall()


def closed_box(cells=6):
    """All six sides of a box about the origin, in small triangles that no ray of a pixel meets in an edge."""
    steps = np.linspace(-1.0, 1.0, cells + 1)
    corners = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            for u, v in np.ndindex(cells, cells):
                square = [(steps[i], steps[j]) for i, j in ((u, v), (u + 1, v), (u + 1, v + 1), (u, v + 1))]
                corners.append([tuple(np.insert(point, axis, side) + (0.0137, -0.0071, 0.0233)) for point in square])
    return quads(corners, "closed box")


def axis_near_views(count, seed):
    """Cameras inside the box and offsets: along an axis, rolled by quarter turns of float64 and by tiny components."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        forward = np.roll([random.choice([-1.0, 1.0]), 0.0, 0.0], random.integers(3))
        up = np.roll(forward, random.choice([1, 2])) * random.choice([-1.0, 1.0])
        tiny = random.choice([0.0, math.cos(math.pi / 2), *TINY], (2, 3)) * random.choice([-1.0, 1.0], (2, 3))
        eye = random.choice([0.0, 0.251, 1e-19, -0.507], 3)
        camera = atra.Camera(
            tuple(eye), tuple(eye + forward + tiny[0]), tuple(up + tiny[1]),
            fov_y_degrees=float(random.choice([30.0, 60.0, 90.0, 120.0])),
            width=int(random.choice([16, 31])), height=int(random.choice([16, 17])),
        )  # fmt: skip
        yield camera, tuple(random.choice([0.5, 0.0, 1e-17, 1e-19, 0.999999], 2).tolist())


@pytest.mark.core
@each_width
@pytest.mark.parametrize("component", [math.cos(math.pi / 2), *TINY])
def test_a_rolled_camera_sees_a_wall_without_holes(width, component):
    for sign in (1, -1):
        camera = atra.Camera((0, 0, 3), (0, 0, 0), (1, sign * component, 0), 60, 256, 256)
        assert trace("pixels", WALL, camera, offset=(0.0, 0.0), packet_width=width).hit.all()


@pytest.mark.core
@each_width
@pytest.mark.parametrize("method", [method for method in METHODS if method != "visible_first"])  # "unprobed" is
def test_a_closed_box_seen_from_inside_along_an_axis_has_no_holes(method, width):
    box = closed_box()
    for camera, offset in axis_near_views(12, seed=width):
        split = 31 if camera.width == 31 else 8, 1
        assert trace(method, box, camera, split, offset, packet_width=width).hit.all(), (camera, offset)


@pytest.mark.core
@each_width
@pytest.mark.parametrize("component", TINY)
def test_parallel_rays_along_an_axis_lose_nothing(width, component):
    for target in ((component, -component, 0.0), (-component, 0.0, 0.0)):
        camera = atra.OrthographicCamera((0, 0, 3), target, (0, 1, -component), 10.0, 64, 48)
        for method in PARALLEL:
            assert trace(method, WALL, camera, (8, 3), (0.0, 1e-19), packet_width=width).hit.all()


def test_instances_turn_no_direction_into_one_with_a_tiny_component():
    # Their rays are Embree's, which multiplies the reference rays by the inverse of these.
    for camera, _ in axis_near_views(200, seed=1):
        split = atra.Split(camera.width, 1, camera.width, camera.height)
        transforms = instance_transforms(Alignment.of_cells(camera, split))
        entries = np.abs(np.concatenate([transforms[:, :, :3].ravel(), ray_axes(camera).ravel()]))
        assert ((entries == 0) | (entries > 1e-12)).all()
