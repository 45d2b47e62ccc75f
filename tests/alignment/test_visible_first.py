"""Visible-first returns the image that per-pixel tracing returns, whatever the probe said."""

import numpy as np
import pytest

import atra
from atra.alignment.cells import CellOptions
from atra.alignment.copies import filled_copies
from atra.alignment.visibility_kernels import TileGrid
from atra.alignment.visible_first import visible_copies
from atra.compiled.threads import WorkerPool
from atra.exact.intersection import intersect_pixels
from atra.geometry.projection import project_mesh
from tests.images import assert_equal_images, make_tracer, nothing_seen, trace, trace_pixels
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, joined, quads, random_triangles

DEPTHS = {"nothing": [0.0], "all": [np.inf], "wrong frame": [0.0, 0.1, 1.0, 10.0, np.inf]}


def make_probe(kind, mesh, camera):
    if kind == "default":
        return None
    hits = trace_pixels(mesh, camera, (0.2, 0.1))
    if kind in DEPTHS:
        depth = np.random.default_rng(2).choice(DEPTHS[kind], hits.depth.shape).astype(np.float32)
        return atra.Hits(depth, hits.prim_id, hits.offset, mesh, camera)
    return hits


@pytest.mark.core
@pytest.mark.parametrize("probe", ["default", "earlier frame", *DEPTHS])
def test_any_probe_gives_the_float64_image(probe):
    camera = cornell_camera(48, 36)
    scenes = [(cornell_box(), camera)]
    for seed, fov in enumerate((20, 90, 170)):  # triangles behind, around and through the eye
        around = atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=fov)
        scenes.append((random_triangles(60, seed), around))
    for mesh, camera in scenes:
        given = make_probe(probe, mesh, camera)
        for offset in ((0.5, 0.5), (0.0, 0.99)):
            reference = brute_force(mesh, camera, offset)
            for split in ((1, 1), (1, 12), (4, 3), (8, 1)):
                hits = trace("visible_first", mesh, camera, split, offset, probe=given)
                assert_equal_images(mesh, camera, hits, reference)


@pytest.mark.core
@pytest.mark.parametrize("seed", range(2))
def test_a_cloud_of_small_triangles_in_front_of_a_wall_is_complete(seed):
    cloud = random_triangles(3000, seed, size=0.03)
    wall = quads([[(-50, -50, 4), (50, -50, 4), (50, 50, 4), (-50, 50, 4)]])
    mesh = joined(wall, cloud)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=48, fov_y_degrees=70)
    reference = brute_force(mesh, camera, (0.3, 0.8))
    with make_tracer("visible_first", mesh, camera, (16, 1), probe=nothing_seen(mesh, camera)) as tracer:
        assert_equal_images(mesh, camera, tracer.trace((0.3, 0.8)), reference)
        assert tracer.counters["packets_verified"] > 0
    assert_equal_images(mesh, camera, trace("visible_first", mesh, camera, (16, 1), (0.3, 0.8)), reference)


@pytest.mark.parametrize(("seed", "counts", "fov"), [(0, (12, 1), 30), (1, (4, 3), 100), (2, (24, 1), 175)])
def test_no_ray_meets_a_copy_left_out_before_the_depth_of_its_tile(seed, counts, fov):
    mesh = random_triangles(40, seed, size=1.5)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=24, height=18, fov_y_degrees=fov)
    split = atra.Split(*counts, camera.width, camera.height)
    tiles, pool = TileGrid(4, 4, camera.width, camera.height), WorkerPool(1)
    seen_depth = np.random.default_rng(seed).choice([0.0, 0.0, 0.0, 1.0], tiles.shape)
    alignment = atra.Alignment.of_cells(camera, split)
    points = project_mesh(mesh, camera, pool)
    counts, nearest_hidden, fill = visible_copies(mesh, alignment, tiles, seen_depth, points, pool)
    geometry = filled_copies([counts], fill, alignment, CellOptions(), row_stride=24)
    assert np.isfinite(nearest_hidden).any()
    records = geometry.records
    prim_id, pixels = records & 0xFFFFFFFF, records >> 32
    kept = set(zip(prim_id.tolist(), (pixels % 24).tolist(), (pixels // 24).tolist(), strict=True))
    y, x = (grid.ravel() for grid in np.mgrid[:18, :24])
    for triangle in range(mesh.triangle_count):
        left_out = np.array([
            (triangle, i // split.cell_width * split.cell_width, j // split.cell_height * split.cell_height) not in kept
            for i, j in zip(x, y, strict=True)
        ])  # fmt: skip
        for offset in ((0.0, 0.0), (0.5, 0.5), (0.999, 0.999)):
            found = intersect_pixels(mesh, camera, x, y, np.full(x.size, triangle), offset)
            hit = left_out & (found.edge_distance >= 0) & np.isfinite(found.depth)
            assert (found.depth[hit] >= nearest_hidden[y[hit] // 4, x[hit] // 4]).all()


def test_a_wall_hides_what_is_behind_and_nothing_need_be_verified():
    wall = [(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]
    behind = [[(x, -0.5, 8), (x + 0.4, -0.5, 8), (x + 0.4, 0.5, 8), (x, 0.5, 8)] for x in np.arange(-3, 3, 0.5)]
    mesh = quads([wall, *behind])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64, fov_y_degrees=60)
    with make_tracer("visible_first", mesh, camera, (16, 1)) as tracer:
        assert set(np.unique(tracer.trace().prim_id)) == {0, 1}
        assert tracer.counters["packets_verified"] == 0
        assert tracer.triangle_count - mesh.triangle_count <= 2 * 16
        assert len(tracer.prepared.second_passes[0].nearest) > 0


def test_the_probe_is_timed_and_both_scenes_are_counted():
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    with make_tracer("pixels", mesh, camera) as pixels, make_tracer("visible_first", mesh, camera, (16, 1)) as tracer:
        assert 0 < tracer.counters["probe_time_s"] < tracer.plan_time_s
        assert tracer.embree_bytes > pixels.embree_bytes
        first = tracer.triangle_count
        assert first > mesh.triangle_count
        tracer.build()
        assert tracer.triangle_count == first
        assert_equal_images(mesh, camera, tracer.trace(), pixels.trace())


@pytest.mark.parametrize(("probe", "message"), [
    ([1112], r"the probe is \[1112\], expected Hits of an image, or None"),
    (trace_pixels(cornell_box(), cornell_camera(8, 16)), r"the probe is an image of \(16, 8\), expected \(16, 16\)"),
])  # fmt: skip
def test_a_bad_probe_is_refused_with_its_value(probe, message):
    with pytest.raises(atra.InputError, match=message):
        make_tracer("visible_first", cornell_box(), cornell_camera(16, 16), (4, 1), probe=probe)
