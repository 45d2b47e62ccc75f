"""Closed surfaces are closed: no ray passes between two triangles, with any method, unless it is asked to be fast."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.judge.compare import Verdict, compare
from tests.images import draw
from tests.tracing import watertight_scenes as scenes

IMAGES = {
    "packets": lambda mesh, view, **o: atra.PixelTracer(mesh, view, threads=1, **o),
    "single rays": lambda mesh, view, **o: atra.PixelTracer(mesh, view, packet_width=1, threads=1, **o),
    "aligned": lambda mesh, view, **o: atra.AlignedTracer(mesh, view, (view.width // 5, 1), threads=1, **o),
    "visible-first": lambda mesh, view, **o: atra.VisibleFirstTracer(mesh, view, (view.width // 5, 1), threads=1, **o),
}
OTHERS = {
    "instanced": lambda mesh, view, **o: atra.AlignedTracer(
        mesh, view, (5, 1), culling=False, geometry="instanced", threads=1, **o
    ),
}
each_method = pytest.mark.parametrize("method", [*IMAGES, *OTHERS])

FEW = [scenes.roof(), scenes.cube(0), scenes.cube(1), scenes.ball(2)]


def traced(method, mesh, view, **options):
    with (IMAGES | OTHERS)[method](mesh, view, **options) as tracer:
        return tracer.trace()


def lost(method, meshes, views, **options):
    """Rays of images from inside of meshes that hit nothing."""
    return sum(int((~traced(method, mesh, view, **options).hit).sum()) for mesh in meshes for view in views(mesh))


def one_view(mesh):
    return [scenes.camera(40.0 if mesh.name == "roof" else 90.0)]


@each_method
def test_no_camera_ray_leaves_a_closed_mesh(method):
    assert lost(method, FEW, one_view) == 0


@each_method
def test_in_the_fast_setting_rays_do_leave_closed_meshes(method):
    assert lost(method, FEW, one_view, robust=False) > 0


def batches(mesh, count, seed=0):
    """Rays to edges and corners of a mesh from inside of it."""
    rays = scenes.edge_rays(mesh, np.zeros(3), count, seed)
    with atra.RayScene(mesh, threads=1) as scene:
        yield "closest", scene.intersect(rays).hit
        yield "occluded", scene.occluded(rays)


@pytest.mark.parametrize("mesh", [scenes.cube(2), scenes.ball(3)], ids=lambda mesh: mesh.name)
def test_no_ray_to_an_edge_leaves_a_closed_mesh(mesh):
    for name, hit in batches(mesh, 5000):
        assert hit.all(), name
    rays = scenes.edge_rays(mesh, np.zeros(3), 5000, 0)
    with atra.RayScene(mesh, threads=1, precision="fast") as scene:
        assert not scene.intersect(rays).hit.all()
        assert not scene.occluded(rays).all()


def test_no_ray_passes_between_triangles_that_copies_show_and_those_that_none_may_show():
    for seed in (2, 3, 8, 13, 16, 19):
        mesh, view = scenes.sliver(seed)
        with atra.AlignedTracer(mesh, view, (16, 1), threads=1) as tracer:
            assert tracer.trace().hit.all()
            assert tracer.counters["triangles_left_out"] > 0


@each_method
def test_from_outside_no_ray_passes_through_the_front(method):
    mesh = scenes.ball(3)
    view = atra.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 40.0, scenes.SIZE, scenes.SIZE)
    with atra.RasterTracer(mesh, view, threads=1) as raster:
        found = compare(traced(method, mesh, view), raster.trace())
    assert (found.pixels_wrong, found.pixels_hole) == (0, 0)


def punched(image, rows, columns):
    """The image with nothing at some pixels."""
    depth, prim_id = image.depth.copy(), image.prim_id.copy()
    depth[rows, columns], prim_id[rows, columns] = np.inf, atra.MISS
    return replace(image, depth=depth, prim_id=prim_id)


ROWS = np.arange(10, 50)
COLUMNS = scenes.SIZE - 1 - ROWS
"""Pixels of the diagonal along which the triangles of `scenes.roof` meet."""


def test_a_hole_punched_into_an_image_at_a_shared_edge_is_wrong():
    mesh, view = scenes.roof(), scenes.camera(40.0)
    right = traced("packets", mesh, view)
    wrong = punched(right, ROWS, COLUMNS)
    for found, own, other in (
        (compare(wrong, right), "pixels_hole", "reference_pixels_hole"),
        (compare(right, wrong), "reference_pixels_hole", "pixels_hole"),
    ):
        assert (found.pixels_wrong, getattr(found, own), getattr(found, other)) == (40, 40, 0)
        assert str(found).endswith("0 edge, 40 wrong, 40 of them holes")


def test_at_an_open_rim_and_at_a_silhouette_float32_may_miss():
    view = scenes.camera(40.0)
    open_rim = atra.Mesh(scenes.roof().vertices, scenes.roof().faces[:1], "half a roof")
    fold = np.array([(-3, -3, -1.3), (3, 3, -3.7), (3, -3, -2.2), (3, -3, -5.0)])  # turns away behind the diagonal
    silhouette = atra.Mesh(fold, [(0, 2, 1), (0, 1, 3)], "fold")
    for mesh in (open_rim, silhouette):
        right = draw(mesh, view)
        at = right.hit[ROWS, COLUMNS]
        assert at.any() or mesh is open_rim
        found = compare(punched(right, ROWS, COLUMNS), right)
        assert (found.pixels_wrong, found.pixels_edge) == (0, int(at.sum())), mesh.name
        assert not (found.verdict == Verdict.WRONG).any()


def test_what_shines_through_a_hole_is_a_hole_and_the_other_triangle_at_the_edge_is_none():
    mesh, view = scenes.around(scenes.roof()), scenes.camera(40.0)
    right = traced("packets", mesh, view)
    behind = traced("packets", atra.Mesh(mesh.vertices, mesh.faces[2:]), view)
    depth, prim_id = right.depth.copy(), right.prim_id.copy()
    depth[ROWS, COLUMNS], prim_id[ROWS, COLUMNS] = behind.depth[ROWS, COLUMNS], behind.prim_id[ROWS, COLUMNS] + 2
    found = compare(replace(right, depth=depth, prim_id=prim_id), right)
    assert (found.pixels_hole, found.pixels_wrong) == (40, 40)
    prim_id = right.prim_id.copy()
    prim_id[ROWS, COLUMNS] = 1 - prim_id[ROWS, COLUMNS]
    assert compare(replace(right, prim_id=prim_id), right).pixels_wrong == 0


def many_meshes():
    """32 closed meshes around the origin, of all kinds."""
    torus = scenes.level_set("torus", 24)
    inside = atra.Mesh(torus.vertices - np.float32([1.0, 0, 0]), torus.faces, "torus")
    meshes = [scenes.cube(seed) for seed in range(8)] + [scenes.cube(seed, 8) for seed in range(4)]
    meshes += [scenes.turned(scenes.needles(seed), seed) for seed in range(4)]
    meshes += [scenes.level_set("sphere", cells) for cells in (5, 12, 21, 32)]
    meshes += [scenes.turned(inside, seed) for seed in range(4)]
    return meshes + [scenes.turned(scenes.ball(k), k) for k in (0, 1, 2, 3, 4, 5, 5, 4)]


@pytest.mark.slow
def test_ten_million_rays_in_many_closed_meshes_are_all_stopped():
    meshes, views = many_meshes(), lambda mesh: [scenes.camera(90.0, 85, way) for way in scenes.WAYS]
    assert len(meshes) >= 30
    assert {method: lost(method, meshes, views) for method in IMAGES} == dict.fromkeys(IMAGES, 0)
    rays = len(meshes) * len(scenes.WAYS) * 85**2 * len(IMAGES)
    for number, mesh in enumerate(meshes):
        for name, hit in batches(mesh, 100_000, number):
            assert hit.all(), (mesh.name, name)
            rays += len(hit)
    assert rays >= 1e7
    for method in IMAGES:
        assert lost(method, meshes[:4], views, robust=False) > 0
