"""The paper's promise on whatever hypothesis draws: every method returns the image of the float64 reference.

`ATRA_HYPOTHESIS=nightly` draws many more examples, other ones each time.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import atra
from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions
from atra.alignment.copies import copied_geometry
from atra.compiled.threads import WorkerPool
from atra.exact.intersection import intersect_pixels
from atra.judge.compare import Verdict
from tests import images
from tests.judge.reference import brute_force
from tests.machine import WIDTHS
from tests.strategies import EXAMPLES, NIGHTLY, parallel_views, views

packet_widths = st.sampled_from(WIDTHS if NIGHTLY else (WIDTHS[0], WIDTHS[-1]))  # kernels are compiled for each


def trace(view, method, packet_width, **options):
    return images.trace(method, view.mesh, view.camera, view.split, view.offset, packet_width=packet_width, **options)


def assert_agree(view, hits, reference):
    """No pixel is wrong."""
    y, x = np.nonzero(atra.compare(hits, reference).verdict == Verdict.WRONG)
    if len(y):
        pixel = y[0], x[0]
        found, expected = ((image.prim_id[pixel], image.depth[pixel]) for image in (hits, reference))
        raise AssertionError(f"{len(y)} pixels wrong; at {x[0]}, {y[0]}: (prim_id, depth) {found}, expected {expected}")


@pytest.mark.core
@pytest.mark.parametrize(
    "widths",
    [
        pytest.param(sorted({WIDTHS[0], WIDTHS[-1]}), id="narrowest and widest packets"),
        pytest.param(WIDTHS, id="all packets", marks=pytest.mark.slow),  # compiles for each
    ],
)
@EXAMPLES
@given(data=st.data(), view=views())
def test_every_method_gives_the_float64_image_and_that_of_single_rays(widths, data, view):
    packet_width = data.draw(st.sampled_from(widths))
    reference = brute_force(view.mesh, view.camera, view.offset)
    single, unculled = trace(view, "pixels", 1), trace(view, "unculled", packet_width)
    for method in images.METHODS:
        hits = trace(view, method, packet_width)
        assert_agree(view, hits, reference)
        if method in images.SHEARED:
            assert_agree(view, hits, single)
            assert_agree(view, hits, unculled)


def test_a_triangle_beside_the_eye_is_no_hit_in_a_cell_that_does_not_see_it():
    """Found by the test above: sheared copies put such a triangle before the eye, by rounding."""
    mesh = atra.Mesh(np.float32([[1.25, 0, 0], [0, 0.25, 0], [0, 0, -0.25]]), np.uint32([[0, 1, 2]]))
    plane = atra.ImagePlane(114.58865012931011, 38.196216709770034, -16.0, 3.0, 0, 0)
    target = (0.8333333333333334, 0.0, 0.08333333333333333)
    camera = atra.CalibratedCamera((0.625, 0.0, 0.0), target, (0.0, 1.0, 0.0), 8, 6, plane=plane)
    assert not brute_force(mesh, camera).hit.any()
    for method in images.METHODS:
        assert not images.trace(method, mesh, camera, (2, 2), packet_width=1).hit.any(), method


@EXAMPLES
@given(views() | parallel_views())
def test_triangles_drawn_give_the_float64_image(view):
    with atra.RasterTracer(view.mesh, view.camera, threads=1) as tracer:
        assert_agree(view, tracer.trace(view.offset), brute_force(view.mesh, view.camera, view.offset))


@EXAMPLES
@given(parallel_views(), packet_widths)
def test_parallel_rays_give_the_float64_image(view, packet_width):
    reference = brute_force(view.mesh, view.camera, view.offset)
    for method in images.PARALLEL:
        assert_agree(view, trace(view, method, packet_width), reference)


@EXAMPLES
@given(views())
def test_culling_keeps_every_triangle_in_every_cell_where_a_float64_ray_hits_it(view):
    mesh, camera = view.mesh, view.camera
    alignment = Alignment.of_cells(camera, atra.Split(*view.split, camera.width, camera.height))
    pool = WorkerPool(1)
    geometry = copied_geometry([mesh], alignment, CellOptions(), camera.width, pool)
    pool.close()
    kept = set(zip(geometry.records & 0xFFFFFFFF, geometry.records >> 32, strict=True))  # prim_id, first pixel of cell
    left_out = {prim_id for one in geometry.left_out if one for prim_id in one.prim_ids}  # tests/exact/test_rounding.py
    y, x = (grid.ravel() for grid in np.mgrid[: camera.height, : camera.width])
    cell_x, cell_y = (pixels // count for pixels, count in zip((camera.width, camera.height), view.split, strict=True))
    first_pixel = y // cell_y * cell_y * camera.width + x // cell_x * cell_x
    for prim_id in set(range(mesh.triangle_count)) - left_out:
        found = intersect_pixels(mesh, camera, x, y, np.full(x.size, prim_id), view.offset)
        hit = (found.edge_distance >= 0.0) & (found.depth > 0.0)
        assert {(prim_id, pixel) for pixel in first_pixel[hit]} <= kept


@pytest.mark.parametrize("said", ["any triangles", "all triangles", "another camera's image"])
@EXAMPLES
@given(data=st.data(), view=views(), packet_width=packet_widths)
def test_visible_first_gives_the_image_of_single_rays_whatever_the_probe_says(said, data, view, packet_width):
    prim_ids = range(view.mesh.triangle_count)
    if said == "another camera's image":
        turned = replace(view.camera, eye=view.camera.target, target=view.camera.eye)
        with atra.PixelTracer(view.mesh, turned, threads=1) as tracer:
            probe = tracer.trace()
    elif said == "any triangles":
        probe = np.array(data.draw(st.lists(st.sampled_from(prim_ids))), np.uint32)
    else:
        probe = np.array(prim_ids, np.uint32)
    hits = trace(view, "visible_first", packet_width, probe=probe)
    assert_agree(view, hits, trace(view, "pixels", 1))
