"""Clusters leave nothing out: the image is that of all triangles, whatever is culled, and in whatever order."""

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.exact.intersection import intersect_pixels
from atra.raster.clusters import CLUSTER, POINT_BYTES, clusters_of
from tests.images import assert_same_bits, draw
from tests.meshes import EYE_AT_ORIGIN, beams, boards, cornell_box, joined, quads, random_triangles


def city(seed, count=6000):
    """Triangles of all sizes, huge to tiny, behind walls that hide most of them, and all around the eye."""
    random = np.random.default_rng(seed)
    walls = quads([[(-4, -3, z), (4, -3, z), (4, 2.5, z), (-4, 2.5, z)] for z in (2.0, 2.5, -3.0)])
    return joined(
        random_triangles(count, seed, size=0.04, spread=5.0),
        random_triangles(count // 4, seed + 1, size=float(random.choice([0.2, 0.6])), spread=4.0),
        random_triangles(12, seed + 2, size=8.0),
        beams(seed, 40),
        boards(20, tilted=True),
        walls,
    )


def cameras(seed, count):
    """A walk with jumps: eyes anywhere, some on a triangle, all fields of view, some parallel."""
    random = np.random.default_rng(seed)
    eye = random.normal(size=3)
    for number in range(count):
        eye = eye + random.normal(size=3) * 0.05 if number % 4 else random.normal(size=3) * 2
        target, up = tuple((eye + random.normal(size=3)).tolist()), (0.1, 1.0, 0.2)
        width, height = int(random.integers(1, 150)), int(random.integers(1, 150))
        if number % 5 == 4:
            view_height = float(random.choice([0.2, 3.0, 12.0]))
            yield atra.OrthographicCamera(tuple(eye.tolist()), target, up, view_height, width, height)
        else:
            yield atra.Camera(
                tuple(eye.tolist()), target, up, float(random.choice([0.5, 40, 90, 150, 175])), width, height
            )


PIECE = 1000
"""Triangles too few for tiles to be looked at even once: nothing is hidden by what is drawn before."""


class AllDrawn:
    """The image of a mesh drawn in pieces, none of whose clusters is ever culled, put together afterwards."""

    def __init__(self, mesh, camera):
        self._mesh, self._starts = mesh, range(0, mesh.triangle_count, PIECE)
        self._tracers = [
            atra.RasterTracer(
                atra.Mesh(mesh.vertices, mesh.faces[start : start + PIECE]), camera, threads=1, ties="any"
            )
            for start in self._starts
        ]
        for tracer in self._tracers:
            tracer.build()
            tracer.prepared.memory.clusters.boxes[:] = [-1e12] * 3 + [1e12] * 3

    def look(self, camera):
        for tracer in self._tracers:
            tracer.look(camera)

    def trace(self, offset=(0.5, 0.5)):
        """Ascending pieces, so that of equal depths the lowest triangle stays; float64 decides between close ones."""
        all_hits = None
        for start, tracer in zip(self._starts, self._tracers, strict=True):
            hits = tracer.trace(offset)
            prim_id = np.where(hits.hit, hits.prim_id + np.uint32(start), hits.prim_id)
            if all_hits is None:
                all_hits = hits
            nearer = hits.depth < all_hits.depth
            with np.errstate(invalid="ignore"):  # inf - inf
                close = np.abs(hits.depth - all_hits.depth) <= 2.0**-20 * all_hits.depth
            y, x = np.nonzero(close & hits.hit & all_hits.hit & (prim_id != all_hits.prim_id))
            old, new = (
                intersect_pixels(self._mesh, hits.camera, x, y, ids[y, x], offset).depth
                for ids in (all_hits.prim_id, prim_id)
            )
            nearer[y, x] = new < old * (1.0 - 1e-12)
            all_hits.depth[nearer], all_hits.prim_id[nearer] = hits.depth[nearer], prim_id[nearer]
        return all_hits


@pytest.mark.core
@pytest.mark.parametrize("seed", range(12))
def test_a_camera_that_walks_and_jumps_sees_the_image_of_all_triangles(seed):
    mesh, views = city(seed), list(cameras(seed, 40))
    all_drawn = AllDrawn(mesh, views[0])
    with atra.RasterTracer(mesh, views[0], threads=1, ties="any") as tracer:
        for number, camera in enumerate(views):
            tracer.look(camera)
            all_drawn.look(camera)
            offset = [(0.5, 0.5), (0.0, 0.0), (0.3, 0.999)][number % 3]
            expected = all_drawn.trace(offset)
            assert_same_bits(tracer.trace(offset), expected)
            assert_same_bits(tracer.trace(offset), expected)  # and once more, for what a frame might remember


def test_of_equal_depths_the_lowest_triangle_is_stored_in_whatever_order_they_are_drawn():
    wall = [[(-2, -2, 4), (2, -2, 4), (2, 2, 4), (-2, 2, 4)]]
    small = [[(x, y, 4), (x + 0.1, y, 4), (x + 0.1, y + 0.1, 4), (x, y + 0.1, 4)] for x in (-1, 0) for y in (-1, 0.5)]
    for camera in (
        atra.Camera(**EYE_AT_ORIGIN, width=64, height=64),
        atra.OrthographicCamera((0, 0, 0), (0, 0, 1), view_height=4.0, width=64, height=64),
    ):
        for first, second in ((wall, small), (small, wall)):
            mesh = joined(quads(first), random_triangles(400, 0, 0.01, 0.5), quads(second), quads(first))
            with atra.RasterTracer(mesh, camera, threads=1, ties="any") as tracer:
                hits = tracer.trace((0.3, 0.6))
                one_of_twins = 2 * len(first)  # the first triangles of the mesh, and the last are the same again
                assert (hits.prim_id < one_of_twins).any()
                assert not (hits.prim_id[hits.hit] >= mesh.triangle_count - one_of_twins).any()
                clusters = tracer.prepared.memory.clusters
                order = np.random.default_rng(0).permutation(mesh.triangle_count)
                packed = clusters.corners & np.uint64((1 << 48) - 1)
                for start in range(0, mesh.triangle_count, CLUSTER):  # each cluster the other way round
                    end = min(start + CLUSTER, mesh.triangle_count)
                    turned = np.arange(end - 1, start - 1, -1)
                    clusters.prim_ids[start:end] = clusters.prim_ids[turned]
                    packed[start:end] = packed[turned]
                places = np.arange(len(order), dtype=np.uint64) % np.uint64(CLUSTER)
                clusters.corners[:] = packed | places << np.uint64(48)
                assert_same_bits(tracer.trace((0.3, 0.6)), hits)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("count", [1, CLUSTER, CLUSTER + 1, 20_000])
def test_clusters_hold_every_triangle_once_with_its_own_corners(count, threads):
    mesh = joined(random_triangles(count, 1), cornell_box())
    pool = WorkerPool(threads)
    clusters = clusters_of(mesh, pool)
    pool.close()
    np.testing.assert_array_equal(np.sort(clusters.prim_ids), np.arange(mesh.triangle_count))
    for cluster in range(clusters.count):
        places = np.arange(cluster * CLUSTER, min((cluster + 1) * CLUSTER, mesh.triangle_count))
        first, end = clusters.firsts[cluster : cluster + 2]
        vertices = clusters.vertices[3 * first : 3 * end].reshape(3, -1).T
        packed = clusters.corners[places]
        corners = np.stack([(packed >> np.uint64(16 * k)) & np.uint64(0xFFFF) for k in range(3)], axis=1) // POINT_BYTES
        np.testing.assert_array_equal(vertices[corners], mesh.triangles(clusters.prim_ids[places]))
        np.testing.assert_array_equal(packed >> np.uint64(48), places - places[0])
        np.testing.assert_array_equal(clusters.boxes[cluster], [*vertices.min(axis=0), *vertices.max(axis=0)])


def test_a_sliver_seen_all_but_edge_on_is_not_drawn_nearer_than_its_nearest_corner():
    random = np.random.default_rng(3)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=128, height=128, fov_y_degrees=90)
    for _ in range(30):
        away = np.array([random.uniform(-0.8, 0.8), random.uniform(-0.8, 0.8), 1.0])
        depths = random.uniform(1, 8, (200, 3, 1)) * random.choice([1.0, 1e-3, 1e3])
        across = random.normal(size=(200, 3, 3)) * 10.0 ** random.integers(-7, -2, (200, 1, 1))
        corners = (depths * (away + across)).astype(np.float32)
        mesh = atra.Mesh(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
        hits = draw(mesh, camera, ties="any")
        nearest = corners[:, :, 2].min(axis=1)
        seen = hits.hit
        # A projected corner is rounded, and so is a depth.
        assert (hits.depth[seen] >= nearest[hits.prim_id[seen]] * (1 - 2.0**-22)).all()
