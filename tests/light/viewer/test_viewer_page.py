"""The viewer's page: its port, its errors, its ends, and what a real browser shows; skipped, with the reason, where
viser or a browser is missing."""

import contextlib
import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import psutil
import pytest
import trimesh
from PIL import Image

from atra.command.cameras import read_cameras
from atra.command.main import main
from atra.errors import InputError
from atra.light.viewer import page as pages
from atra.light.viewer.page import Page, say_numbers
from atra.light.viewer.request import Settings
from atra.light.viewer.session import Frame, Picture
from tests.browser import chromium
from tests.folders import ROOT
from tests.light.viewer.test_viewer_painter import FIRST, made
from tests.meshes import cornell_box

pytest.importorskip("viser", reason="viser is not installed: pip install -e '.[viewer]'")

HOST = "127.0.0.1"

PATIENCE_S = 60.0
"""For what takes a second where nobody else computes."""


def wait_for(happens, what):
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        if found := happens():
            return found
        time.sleep(0.05)
    pytest.fail(f"waited in vain for {what}")


@contextlib.contextmanager
def running(artist, first):
    """The page of an artist, in a thread."""
    one = Page(artist, first, 0, "the box", 3.0)
    one.thread = threading.Thread(target=one.session.run)
    one.thread.start()
    yield one
    one.session.close()
    one.thread.join(PATIENCE_S)
    one.close()


@pytest.fixture
def page(monkeypatch):
    """At 64 x 64 pixels."""
    monkeypatch.setattr(pages, "LEAVE_S", 0.5)
    first = replace(FIRST, settings=replace(FIRST.settings, samples=3))
    with contextlib.closing(made()) as painter, running(painter, first) as one:
        yield one


def test_only_this_machine_reaches_it(page):
    port = page._server.get_port()
    listening = [one.laddr for one in psutil.Process().net_connections("inet") if one.status == psutil.CONN_LISTEN]
    assert [address.ip for address in listening if address.port == port] == [HOST] == ["127.0.0.1"]


@pytest.fixture
def model(tmp_path, monkeypatch):
    """The working directory, with `box.glb`."""
    monkeypatch.chdir(tmp_path)
    mesh = cornell_box()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "box.glb")
    return tmp_path


def view(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["atra", "view", "box.glb", "--threads", "1", *arguments])
    return main()


def test_without_viser_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    monkeypatch.delitem(sys.modules, "atra.light.viewer.gate")
    with pytest.raises(InputError, match=r"^the viewer needs viser, .*pip install -e '\.\[viewer\]'$"):
        Page(made(), FIRST, 0, "the box", 3.0)


@pytest.mark.parametrize(("given", "told"), [
    (("--port", "TAKEN"), "atra: port TAKEN is taken; choose another by --port, or 0 for any that is free\n"),
    (("--port", "70000"), "port is 70000, expected a whole number from 0 to 65535"),
    (("--camera", "table"), "the camera is 'table', expected a file, one of front, back"),
    (("--camera", "cameras.json"), "cameras.json holds 2 cameras ('left', 'right'), expected one"),
    (("--sky", "none.hdr"), "none.hdr' is no file"),
])  # fmt: skip
def test_what_cannot_be_shown_is_refused_in_one_line_and_a_taken_port_not_evaded(
    model, monkeypatch, capsys, given, told
):
    one = {"eye": [0, 0, 3], "target": [0, 0, 0], "width": 8, "height": 8}
    (model / "cameras.json").write_text(json.dumps({"left": one, "right": one}), encoding="utf-8")
    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen()
        port = str(other.getsockname()[1])
        assert view(monkeypatch, *(one.replace("TAKEN", port) for one in given)) == 2
    out, error = capsys.readouterr()
    assert told.replace("TAKEN", port) in error
    assert (out, error.count("\n")) == ("", 1)


def test_the_sky_of_a_file_stands_above_what_is_shown_from_the_side_that_is_asked_for(model, monkeypatch, capsys):
    shown = []
    (model / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n" + bytes([128, 64, 32, 130]))

    def keep(painter, first, *others):
        shown.append((painter._scene_of(Settings(sky_power=2.0)).sky, first))
        raise InputError("that is all")

    monkeypatch.setattr("atra.light.viewer.page.Page", keep)
    given = "--sky", "sky.hdr", "--sky-rotation", "30", "--camera", "top", "--method", "aligned", "--tone", "agx"
    assert view(monkeypatch, *given) == 2
    assert capsys.readouterr().err == "atra: that is all\n"
    ((sky, first),) = shown
    assert (sky.power, sky.rotation_degrees) == (2.0, 30.0)
    np.testing.assert_array_equal(sky.texels, [[[2.0, 1.0, 0.5]]])
    assert first.pose.eye[1] > first.pose.target[1]
    assert (first.settings.method, first.settings.frame, first.settings.tone) == ("aligned", "path", "agx")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
def test_ctrl_c_ends_it_cleanly(model):
    process = subprocess.Popen(
        [sys.executable, "-m", "atra.command", "view", "box.glb", "--port", "0", "--threads", "1"],
        cwd=model, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        assert process.stdout.readline().startswith("viewer: preparing; a first start compiles kernels")
        said = process.stdout.readline()
        assert re.fullmatch(r"viewer: http://127\.0\.0\.1:\d+ shows box\.glb; Ctrl-C ends it\n", said)
        os.kill(process.pid, signal.SIGINT)
        out, errors = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
    assert (process.returncode, out, errors) == (0, "viewer: ended\n", "")


def test_numbers_tell_samples_and_stages():
    picture = Picture(np.zeros((64, 64, 3), np.uint8), {"primary": 0.002, "shadow": 0.006}, "a note")
    told = say_numbers(Frame(FIRST, picture, 2)).split("\n\n")
    assert told == ["**2 of 2 samples**, 64 x 64", "a note", "ms: primary 2.0, shadow 6.0"]


@pytest.fixture(scope="module")
def browser():
    with chromium("--use-angle=swiftshader", "--enable-unsafe-swiftshader") as started:
        yield started


class Shown:
    """Requests of frames that went to the page, and their formats."""

    def __init__(self, page, monkeypatch):
        self.frames = []
        self.formats = []
        show, send = page.show, page._server.scene.set_background_image

        def shown(frame):
            self.frames.append((frame.request, frame.samples))
            show(frame)

        def sent(image, format, **more):
            self.formats.append((self.frames[-1][1] > 0, format))
            send(image, format=format, **more)

        monkeypatch.setattr(page, "show", shown)
        monkeypatch.setattr(page._server.scene, "set_background_image", sent)


def has_picture(tab):
    """The left wall has another brightness than the floor; before a picture came, all was white."""
    pixels = np.asarray(Image.open(io.BytesIO(tab.screenshot())).convert("RGB"))
    return np.ptp(pixels[-100, 20:200].astype(int)) > 20


def drag(tab, across):
    tab.mouse.move(150, 250)
    tab.mouse.down()
    tab.mouse.move(150 + across, 250, steps=5)
    tab.mouse.up()


def choose(tab, movement):
    tab.get_by_label("movement").click()
    tab.get_by_role("option", name=movement).click()


@contextlib.contextmanager
def opened(browser, address, width=640, height=400, count=1, **options):
    """Tabs of a context of its own; the first shows the page. Errors of its scripts are the test's."""
    complaints = []
    with browser.new_context(viewport={"width": width, "height": height}, **options) as context:
        tabs = [context.new_page() for _ in range(count)]
        for tab in tabs:
            tab.set_default_timeout(1e3 * PATIENCE_S)
            tab.on("pageerror", lambda error: complaints.append(str(error)))
        tabs[0].goto(address)
        yield tabs[0] if count == 1 else tabs
    assert complaints == []


@pytest.mark.slow
def test_a_browser_shows_the_picture_moves_the_camera_changes_parameters_and_ends_the_viewer(
    page, browser, monkeypatch
):
    shown = Shown(page, monkeypatch)
    with opened(browser, page.address) as tab:
        tab.get_by_text("3 of 3 samples").wait_for()
        wait_for(lambda: page.session.wanted.pose.aspect == pytest.approx(1.6, abs=0.01), "the page's own camera")
        wait_for(lambda: page.session.wanted.pose.eye == pytest.approx(FIRST.pose.eye, abs=1e-6), "the scene's view")
        wait_for(lambda: has_picture(tab), "a picture on the canvas")
        assert {request.pose.eye for request, _ in shown.frames} <= {FIRST.pose.eye, page.session.wanted.pose.eye}
        before = page.session.wanted.pose
        drag(tab, 48)
        wait_for(lambda: page.session.wanted.pose != before, "the camera to move")
        wait_for(lambda: shown.frames[-1][:2] == (page.session.wanted, 3), "the picture at rest")
        from_middle = np.subtract(page.session.wanted.pose.eye, FIRST.pose.target)
        assert np.linalg.norm(from_middle) == pytest.approx(3.4, abs=1e-3), "it moved, but in no orbit"
        assert (page.session.wanted, 0) in shown.frames, "no sketch came before"

        tab.get_by_text("Primary visibility").click()
        tab.get_by_label("jitter").click()
        tab.get_by_role("option", name="off").click()
        wait_for(lambda: page.session.wanted.settings.jitter == "off", "the choice")
        wait_for(lambda: shown.frames[-1] == (page.session.wanted, 3), "the picture without jitter")
        assert set(shown.formats) == {(False, "jpeg"), (True, "png")}
    page.thread.join(PATIENCE_S)
    assert not page.thread.is_alive(), "the last page is closed, the viewer is not"


@pytest.mark.slow
def test_walking_turns_the_head_moves_by_keys_and_buttons_and_picture_and_camera_are_saved(page, browser, tmp_path):
    def eye():
        return np.array(page.session.wanted.pose.eye)

    with opened(browser, page.address, accept_downloads=True) as tab:
        tab.get_by_text("3 of 3 samples").wait_for()
        wait_for(lambda: eye() == pytest.approx(FIRST.pose.eye, abs=1e-6), "the scene's view")
        choose(tab, "walk")
        forward = tab.get_by_role("button", name="forward", exact=True)
        forward.wait_for()
        before = page.session.wanted.pose
        drag(tab, 60)
        wait_for(lambda: abs(page.session.wanted.pose.target[0] - before.target[0]) > 0.1, "the head to turn")
        np.testing.assert_allclose(eye(), before.eye, atol=0.02)

        def steps(by, way, what):
            """As often as it takes: on a busy machine what came before still moves the eye, too."""
            start = eye()

            def has_moved():
                by()
                return way * np.dot(eye() - start, np.subtract(page.session.wanted.pose.target, eye())) > 0.05

            wait_for(has_moved, what)
            assert eye()[1] == pytest.approx(start[1], abs=0.01)

        def press():
            tab.keyboard.down("w")
            tab.wait_for_timeout(300)
            tab.keyboard.up("w")

        steps(press, 1.0, "a step by the key")
        steps(tab.get_by_role("button", name="back", exact=True).click, -1.0, "a step back")
        wait_for(lambda: page._frame is not None and page._frame.samples == 3, "the picture at rest")

        def saves_what_is_shown():
            for name in ("picture.png", "camera.json"):
                with tab.expect_download() as loaded:
                    tab.get_by_role("button", name=f"save {name.partition('.')[0]}").click()
                loaded.value.save_as(tmp_path / name)
            (camera,) = read_cameras(tmp_path / "camera.json", None, {}).values()
            picture = np.asarray(Image.open(tmp_path / "picture.png"))
            return camera == page.session.wanted.camera and np.array_equal(picture, page._frame.picture.image)

        wait_for(saves_what_is_shown, "picture and camera as they are shown")
        choose(tab, "orbit")
        forward.wait_for(state="hidden")


@pytest.mark.slow
def test_a_page_that_opens_while_another_walks_shows_the_scene(page, browser):
    with opened(browser, page.address, count=2) as (tab, other):
        tab.get_by_text("3 of 3 samples").wait_for()
        choose(tab, "walk")
        wait_for(lambda: page._movement.value == "walk", "walking")
        other.bring_to_front()
        other.goto(page.address)
        wait_for(lambda: len(page._server.get_clients()) == 2, "the second page")
        wait_for(lambda: has_picture(other), "a picture on the second page")
        wait_for(lambda: page.session.wanted.pose.eye == pytest.approx(FIRST.pose.eye, abs=1e-3), "the scene's view")
        assert page._movement.value == "orbit"


@pytest.mark.slow
def test_controls_are_reached_and_nothing_scrolls_sideways_on_desktop_and_phone(page, browser):
    with opened(browser, page.address, 400, 800) as tab:
        tab.get_by_text("3 of 3 samples").wait_for()
        for width, height in ((400, 800), (1280, 900)):
            tab.set_viewport_size({"width": width, "height": height})
            for folder in ("Picture", "Camera", "Primary visibility", "Hybrid", "Paths", "Light"):
                assert tab.get_by_text(folder, exact=True).is_visible()
            assert tab.evaluate("document.documentElement.scrollWidth") <= width
            wait_for(
                lambda shape=width / height: page.session.wanted.pose.aspect == pytest.approx(shape, abs=0.01),
                "its shape",
            )
