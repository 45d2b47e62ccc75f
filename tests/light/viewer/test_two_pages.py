"""Two pages of one viewer in a real browser; skipped, with the reason, where viser or a browser is missing."""

import numpy as np
import pytest

from tests.light.viewer import test_viewer_page as one_page
from tests.light.viewer.test_viewer_page import FIRST, PATIENCE_S, screenshot, wait_for

page, browser = one_page.page, one_page.browser


@pytest.mark.slow
def test_a_page_that_opens_while_another_walks_shows_the_scene(page, browser):
    with browser.new_context(viewport={"width": 640, "height": 400}) as context:
        tabs = [context.new_page(), context.new_page()]
        for tab in tabs:
            tab.set_default_timeout(1e3 * PATIENCE_S)
        tabs[0].goto(page.address)
        tabs[0].get_by_text("3 of 3 samples").wait_for()
        tabs[0].get_by_label("movement").click()
        tabs[0].get_by_role("option", name="walk").click()
        wait_for(lambda: page._movement.value == "walk", "walking")
        tabs[1].bring_to_front()
        tabs[1].goto(page.address)
        wait_for(lambda: len(page._server.get_clients()) == 2, "the second page")
        wait_for(lambda: np.ptp(screenshot(tabs[1])[300, 20:200].astype(int)) > 20, "a picture on the second page")
        wait_for(lambda: page.session.wanted.pose.eye == pytest.approx(FIRST.pose.eye, abs=1e-3), "the scene's view")
        assert page._movement.value == "orbit"
