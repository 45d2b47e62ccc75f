"""The page of a lightmap: what a real browser shows while texels converge; skipped, with the reason, where viser or a
browser is missing."""

import threading
from contextlib import closing

import numpy as np
import pytest

from atra import light
from atra.light import Baker, Scene, Texels
from atra.light.viewer import page as pages
from atra.light.viewer.page import Page
from atra.light.viewer.request import Pose, Request, Settings
from tests.baked import cube, sheet
from tests.light.viewer.test_viewer_page import PATIENCE_S, Shown, browser, drag, has_picture, opened, wait_for

pytest.importorskip("viser", reason="viser is not installed: pip install -e '.[viewer]'")

from atra.light.viewer.lightmap import MapPainter, say_progress

__all__ = ["browser"]

BOX = cube(inwards=True)
SCENE = Scene.plain(BOX, 0.6, lights=[light.PointLight((0.3, 0.4, 0.1), power=0.2)], sky=light.constant_sky(0.0))
ATLAS = sheet(BOX, 24)
TARGET = 8
POSE = Pose((0.0, 0.0, 0.9), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0)
FIRST = Request(POSE, Settings(side=64, samples=TARGET))


def test_the_panel_says_how_far_texels_are():
    samples = np.full(96, TARGET, np.int32)
    assert say_progress(samples, TARGET, 1.0).startswith(f"**done**: {TARGET} samples of 96 texels")
    samples[:24] = 2
    assert say_progress(samples, TARGET, 0.8125) == "**2 to 8 of 8 samples** of 96 texels\n\n81% done"
    assert "of 96 texels, 24 in view first" in say_progress(samples, TARGET, 0.8125, 24)


@pytest.fixture
def page(monkeypatch):
    monkeypatch.setattr(pages, "LEAVE_S", 0.5)
    with Baker(SCENE, ATLAS, threads=1) as baker, closing(MapPainter(baker, TARGET, 1)) as painter:
        one = Page(painter, FIRST, 0, "the box", 3.0, settings=False)
        thread = threading.Thread(target=one.session.run)
        thread.start()
        yield one, baker, thread
        one.session.close()
        thread.join(PATIENCE_S)
        one.close()


def test_a_bake_that_is_shown_takes_what_the_camera_sees_first_and_is_that_of_no_page():
    with Baker(SCENE, ATLAS, threads=1) as baker, closing(MapPainter(baker, TARGET, 1)) as painter:
        clay = painter.sketch(FIRST).image
        assert painter.add(FIRST, lambda: True) < TARGET
        assert painter.add(FIRST, lambda: False) == 1
        assert baker.samples[baker.visible].min() == 1
        assert baker.samples[~baker.visible].max() == 0
        assert (painter.show(FIRST).image != clay).any()
        while painter.add(FIRST, lambda: False) < TARGET:
            pass
        assert painter.show(FIRST).note.startswith("**done**")
        shown = baker.maps.combined
    with Baker(SCENE, ATLAS, threads=1) as baker:
        baker.add(TARGET)
        np.testing.assert_allclose(shown, baker.maps.combined, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
def test_a_browser_shows_the_map_and_its_camera_says_what_comes_first(page, browser, monkeypatch):
    page, baker, thread = page
    shown = Shown(page, monkeypatch)
    with opened(browser, page.address, 400, 800) as tab:
        tab.get_by_text("done").wait_for()
        assert tab.evaluate("document.documentElement.scrollWidth") <= 400
        tab.set_viewport_size({"width": 640, "height": 400})
        wait_for(lambda: has_picture(tab), "a picture on the canvas")
        wait_for(lambda: baker.visible is not None, "what the camera sees")
        before, count = baker.visible, len(shown.frames)
        drag(tab, 80)
        wait_for(lambda: (baker.visible != before).any(), "what another camera sees")
        wait_for(lambda: not all(samples for _, samples in shown.frames[count:]), "a sketch of another camera")
        wait_for(lambda: shown.frames[-1][1], "a picture at rest")
    thread.join(PATIENCE_S)
    assert not thread.is_alive(), "the last page is closed, the viewer is not"
    texels = Texels.of(BOX, ATLAS)
    assert 0 < baker.visible.sum() < len(texels)
