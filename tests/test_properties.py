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
from atra.alignment.culling import plan_aligned_geometry
from atra.embree.library import load_library
from atra.geometry.intersection import intersect_pixels
from atra.judge.compare import Verdict
from atra.judge.reference import brute_force
from atra.parallel import WorkerPool
from tests.strategies import EXAMPLES, parallel_views, views

pytestmark = pytest.mark.core

WIDTHS = load_library().native_packet_widths
packet_widths = st.sampled_from(WIDTHS)
UNSHEARED = {
    "pixel": lambda view: (atra.PixelTracer, {}),
    "tiles": lambda view: (atra.TiledTracer, {"split": view.split}),
}
SHEARED = {
    "aligned": lambda view: (atra.AlignedTracer, {"split": view.split}),
    "unculled": lambda view: (atra.AlignedTracer, {"split": view.split, "culling": False}),
    "instanced": lambda view: (atra.AlignedTracer, {"split": view.split, "culling": False, "geometry": "instanced"}),
    "visible_first": lambda view: (atra.VisibleFirstTracer, {"split": view.split}),
}
METHODS = UNSHEARED | SHEARED


def trace(view, method, packet_width, **options):
    kind, its_options = METHODS[method](view)
    with kind(view.mesh, view.camera, packet_width=packet_width, threads=1, **its_options, **options) as tracer:
        return tracer.trace(view.offset)


def assert_agree(view, hits, reference):
    """No pixel is wrong."""
    y, x = np.nonzero(atra.compare(view.mesh, view.camera, hits, reference).verdict == Verdict.WRONG)
    if len(y):
        pixel = y[0], x[0]
        found, expected = ((image.prim_id[pixel], image.depth[pixel]) for image in (hits, reference))
        raise AssertionError(f"{len(y)} pixels wrong; at {x[0]}, {y[0]}: (prim_id, depth) {found}, expected {expected}")


@pytest.mark.parametrize("method", UNSHEARED)
@EXAMPLES
@given(views(), packet_widths)
def test_rays_per_pixel_give_the_float64_image(method, view, packet_width):
    hits, reference = trace(view, method, packet_width), brute_force(view.mesh, view.camera, view.offset)
    assert_agree(view, hits, reference)


@pytest.mark.parametrize("method", SHEARED)
@EXAMPLES
@given(views(), packet_widths)
def test_aligned_rays_give_the_float64_image_and_that_of_single_rays(method, view, packet_width):
    hits = trace(view, method, packet_width)
    assert_agree(view, hits, brute_force(view.mesh, view.camera, view.offset))
    assert_agree(view, hits, trace(view, "pixel", 1))


@pytest.mark.parametrize("method", ["pixel", "aligned", "instanced"])
@EXAMPLES
@given(parallel_views(), packet_widths)
def test_parallel_rays_give_the_float64_image(method, view, packet_width):
    assert_agree(view, trace(view, method, packet_width), brute_force(view.mesh, view.camera, view.offset))


@EXAMPLES
@given(views(), packet_widths)
def test_culling_and_instancing_change_nothing(view, packet_width):
    unculled = trace(view, "unculled", packet_width)
    assert_agree(view, trace(view, "aligned", packet_width), unculled)
    assert_agree(view, trace(view, "instanced", packet_width), unculled)


@EXAMPLES
@given(views())
def test_culling_keeps_every_triangle_in_every_cell_where_a_float64_ray_hits_it(view):
    mesh, camera = view.mesh, view.camera
    alignment = Alignment.of_cells(camera, atra.Split(*view.split, camera.width, camera.height))
    pool = WorkerPool(1)
    geometry = plan_aligned_geometry([mesh], alignment, atra.AlignedOptions(), camera.width, pool)
    pool.close()
    kept = set(zip(geometry.records & 0xFFFFFFFF, geometry.records >> 32, strict=True))  # prim_id, first pixel of cell
    left_out = {prim_id for one in geometry.left_out if one for prim_id in one.prim_ids}  # tests/test_rounding.py
    y, x = (grid.ravel() for grid in np.mgrid[: camera.height, : camera.width])
    cell_x, cell_y = (pixels // count for pixels, count in zip((camera.width, camera.height), view.split, strict=True))
    first_pixel = y // cell_y * cell_y * camera.width + x // cell_x * cell_x
    for prim_id in set(range(mesh.triangle_count)) - left_out:
        found = intersect_pixels(mesh, camera, x, y, np.full(x.size, prim_id), view.offset)
        hit = (found.edge_distance >= 0.0) & (found.depth > 0.0)
        assert {(prim_id, pixel) for pixel in first_pixel[hit]} <= kept


@pytest.mark.parametrize("place", [Alignment.of_cells, Alignment.at_first_cell])
@EXAMPLES
@given(views(max_triangles=1))
def test_the_shear_maps_the_rays_of_each_cell_one_to_one_onto_the_reference_rays_and_keeps_t(place, view):
    camera = view.camera
    split = atra.Split(*view.split, camera.width, camera.height)
    alignment = place(camera, split)
    y, x = (grid.ravel() for grid in np.mgrid[: camera.height, : camera.width])
    t = np.geomspace(1e-3, 1e3, x.size)
    points = camera.directions(x, y, view.offset) * t[:, None]
    for j in range(split.ny):
        for i in range(split.nx):
            inside = (x // split.cell_width == i) & (y // split.cell_height == j)
            sheared = alignment.shear_points(points[inside], i, j)
            assert (sheared[:, 2] == t[inside]).all()
            columns, rows = (sheared[:, :2] / sheared[:, 2:] / camera.pixel_pitch).T
            columns, rows = columns - alignment.first_x_pixels, rows - alignment.first_y_pixels
            # The ray at (column, row) of the reference cell comes from the pixel at (column, row) of the cell.
            np.testing.assert_allclose(columns, x[inside] % split.cell_width + view.offset[0], atol=1e-9)
            np.testing.assert_allclose(rows, y[inside] % split.cell_height + view.offset[1], atol=1e-9)


@pytest.mark.parametrize("said", ["nothing", "any triangles", "all triangles", "another camera's image"])
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
        probe = np.array(prim_ids if said == "all triangles" else [], np.uint32)
    hits = trace(view, "visible_first", packet_width, probe=probe)
    assert_agree(view, hits, trace(view, "pixel", 1))
