"""Pictures through a lens: as without one that bends nothing, black where there is no ray, alike from any tracer."""

from functools import partial

import numpy as np
import pytest

import atra
from atra import light
from tests.lenses import lens_camera
from tests.meshes import cornell_box, cornell_camera
from tests.shown import picture

PLACED, BOX = cornell_camera(96, 72), light.Scene(cornell_box())
RENDERERS = (light.HybridRenderer, light.PathRenderer)


@pytest.mark.parametrize("kind", RENDERERS)
def test_a_lens_that_bends_nothing_changes_no_picture(kind):
    camera = lens_camera(atra.OpenCVLens(k1=1e-13), PLACED)
    with_lens, without = (picture(kind, BOX, one, 2) for one in (camera, camera.undistorted()))
    assert without.max() > 0.0
    np.testing.assert_allclose(with_lens, without, atol=1e-5)


@pytest.mark.parametrize("kind", RENDERERS)
def test_what_a_lens_bends_is_seen_where_it_bends_it(kind):
    camera = lens_camera(atra.OpenCVLens(k1=-0.3, k2=0.08), PLACED)
    drawn, bent = (picture(kind, BOX, one, 2, jitter="off") for one in (camera, camera.undistorted()))
    traced = picture(kind, BOX, camera, 2, partial(atra.PixelTracer, threads=1), jitter="off")
    assert (np.abs(drawn - traced).max(axis=-1) < 1e-3).mean() > 0.99
    assert (np.abs(drawn - bent).max(axis=-1) > 1e-2).mean() > 0.05


@pytest.mark.parametrize("kind", RENDERERS)
def test_pixels_without_a_ray_are_black(kind):
    camera = lens_camera(atra.OpenCVLens(k1=-0.6), PLACED)
    blind = ~camera.has_ray()
    image = picture(kind, BOX, camera, 2, jitter="off")
    assert np.isfinite(image).all()
    assert (image[blind] == 0.0).all()
    assert blind.any()
    assert (image[~blind] > 0.0).any()
