"""Views of scenes: each shows the scene from a place of its own."""

import numpy as np
import pytest

import atra
from atra.errors import InputError
from scenes.cornell_box import CORNELL_BOX_CAMERA
from scenes.views import VIEWS, view_fields
from tests.meshes import cornell_box, cornell_camera


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_shows_the_scene_from_a_place_of_its_own(view):
    mesh = cornell_box()
    fields = view_fields(mesh, CORNELL_BOX_CAMERA, view)
    camera = atra.Camera(**fields, width=16, height=16)
    assert fields == view_fields(mesh, CORNELL_BOX_CAMERA, view)
    with atra.PixelTracer(mesh, camera, packet_width=1) as tracer:
        assert np.isfinite(tracer.trace().depth).mean() > 0.2
    others = [view_fields(mesh, CORNELL_BOX_CAMERA, other) for other in VIEWS if other != view]
    assert fields not in others


def test_a_view_moved_in_stands_nearer_by_four_tenths_of_what_it_looked_at_and_an_unknown_one_is_refused():
    eye = np.asarray(CORNELL_BOX_CAMERA["eye"])
    moved = np.asarray(view_fields(cornell_box(), CORNELL_BOX_CAMERA, "near")["eye"])
    with atra.PixelTracer(cornell_box(), cornell_camera(1, 1), packet_width=1) as tracer:
        assert np.linalg.norm(moved - eye) == pytest.approx(0.4 * float(tracer.trace().depth[0, 0]))
    with pytest.raises(InputError, match=r"scene\.view is 'behind'"):
        view_fields(cornell_box(), CORNELL_BOX_CAMERA, "behind")
