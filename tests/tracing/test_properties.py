"""The paper's promise on whatever hypothesis draws: every method returns the image of the float64 reference.

`ATRA_HYPOTHESIS=nightly` draws many more examples, other ones each time.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import atra
from atra.judge.compare import Verdict
from tests import images
from tests.judge.reference import brute_force
from tests.machine import WIDTHS
from tests.tracing.strategies import EXAMPLES, NIGHTLY, parallel_views, views

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
