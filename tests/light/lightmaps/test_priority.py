"""Which texels a camera sees: the same near the origin and far from it, where float32 has few numbers."""

import numpy as np
import pytest
import trimesh

import atra
from atra.light import Texels
from atra.light.lightmaps.priority import visible_texels
from atra.rays.kernel_scene import KernelScene
from tests.baked import cube, sheet
from tests.meshes import joined

TURN = trimesh.transformations.euler_matrix(0.3, 0.5, 0.7)[:3, :3]
"""No wall is along an axis, so that rounding puts texels before or behind their walls."""

FAR = np.array([1e5, -7e4, 3e4])
ROOM, BLOCK = cube(inwards=True), cube(0.15)


def moved(mesh, place):
    """Turned, rounded as it is far away, and brought to a place, which rounds no more."""
    there = (mesh.vertices @ TURN.T + FAR).astype(np.float32)
    return atra.Mesh(there.astype(np.float64) - FAR + place, mesh.faces)


def views(place):
    """Of so few pixels that almost all texels are looked for by rays."""
    eye, target = (tuple((TURN @ at + place).tolist()) for at in ((-0.6, 0.5, 0.4), (0.2, -0.1, -0.3)))
    up = tuple((TURN @ (0, 1, 0)).tolist())
    return [
        atra.Camera(eye, target, up, fov_y_degrees=100, width=3, height=3),
        atra.OrthographicCamera(eye, target, up, view_height=0.5, width=3, height=3),
    ]


def seen(mesh, place):
    there = moved(mesh, place)
    texels = Texels.of(there, sheet(there, 30))
    found = []
    with KernelScene(there, threads=1) as scene:
        for view in views(place):
            with atra.RasterTracer(there, view, threads=1) as tracer:
                found.append(visible_texels(texels, tracer.trace(), scene))
    return found


@pytest.mark.parametrize("place", [np.zeros(3), FAR], ids=["at the origin", "far away"])
def test_in_an_empty_room_every_texel_in_the_image_is_seen(place):
    there = moved(ROOM, place)
    texels = Texels.of(there, sheet(there, 30))
    for view, found in zip(views(place), seen(ROOM, place), strict=True):
        points = view.to_eye_space(texels.positions.astype(np.float64))
        a, b, c = (points @ view.to_pixels[:, :3].T + view.to_pixels[:, 3]).T
        inside = (c > 0) & (points @ view.axes[2] > 0) & (a >= 0) & (a <= 3 * c) & (b >= 0) & (b <= 3 * c)
        away = -view.axes[2] if view.is_parallel else -points
        inside &= (texels.normals * away).sum(axis=1) > 0
        assert inside.sum() > 80
        np.testing.assert_array_equal(found, inside)


def test_what_a_block_hides_is_the_same_far_away():
    room = joined(ROOM, BLOCK)
    there = moved(room, FAR)
    on_walls = Texels.of(there, sheet(there, 30)).prim_id < ROOM.triangle_count
    for near, far, empty in zip(seen(room, np.zeros(3)), seen(room, FAR), seen(ROOM, FAR), strict=True):
        # a texel is up to 0.007 elsewhere and may then lie on the other side of a rim; texels are ten times as large
        assert (near != far).sum() < 0.05 * near.sum()
        assert far[on_walls].sum() < 0.9 * empty.sum()
