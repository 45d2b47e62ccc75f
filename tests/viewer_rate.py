"""The viewer's speed, as headless Chromium gets its pictures: until the first is there, and how many a second of a
camera that moves.

    python -m tests.viewer_rate scene=sponza

Arguments are those of `python run.py view`. Pictures are counted that arrive in the page. The browser draws without a
GPU on the same cores; so the processor time of the viewer's own process stands beside the rate.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PICTURE_BYTES = 5_000
"""What else the viewer sends is shorter."""

MOVING_S = 10.0
SIDE = 512


class Arrivals:
    """When pictures arrived in a page, by the monotonic clock."""

    def __init__(self, tab: Any) -> None:
        self.times_s: list[float] = []
        tab.on("websocket", lambda socket: socket.on("framereceived", self._take))

    def _take(self, payload: bytes | str) -> None:
        if len(payload) > PICTURE_BYTES:
            self.times_s.append(time.monotonic())


def measure(arguments: list[str], shots: Path) -> None:
    """Prints both numbers of `run.py view` with these arguments, and leaves pictures of the page in a folder."""
    command = [sys.executable, str(ROOT / "run.py"), "view", "view.port=0", *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as viewer, sync_playwright() as driver:
        assert viewer.stdout is not None
        viewer.stdout.readline()  # that it prepares
        said = viewer.stdout.readline().split()
        process = psutil.Process(viewer.pid)
        found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
        browser = driver.chromium.launch(executable_path=found, args=FLAGS)
        tab = browser.new_page(viewport={"width": SIDE, "height": SIDE})
        tab.set_default_timeout(600e3)
        arrivals = Arrivals(tab)
        start_s = time.monotonic()
        tab.goto(said[1])
        tab.get_by_text("of 64 samples").wait_for()
        print(f"{said[3]} first picture after {arrivals.times_s[0] - start_s:.2f} s")
        _move(tab, process, arrivals)
        for width, height in ((1280, 900), (400, 800)):
            tab.set_viewport_size({"width": width, "height": height})
            tab.get_by_text("64 of 64 samples").wait_for()
            tab.wait_for_timeout(1000)
            tab.screenshot(path=shots / f"viewer_{width}.png")
        viewer.terminate()
        viewer.wait()  # before the page closes, to which it may be sending a picture
        browser.close()


def _move(tab: Any, process: psutil.Process, arrivals: Arrivals) -> None:
    tab.mouse.move(100, 400)
    tab.mouse.down()
    before, spent_s, start_s, step = len(arrivals.times_s), process.cpu_times(), time.monotonic(), 0
    while time.monotonic() - start_s < MOVING_S:
        step += 1
        tab.mouse.move(100 + step % 200, 400)
    frames = len(arrivals.times_s) - before
    taken_s, now_s = time.monotonic() - start_s, process.cpu_times()
    tab.mouse.up()
    cpu_s = now_s.user + now_s.system - spent_s.user - spent_s.system
    print(f"moving: {frames / taken_s:.1f} pictures/s, {1e3 * cpu_s / max(1, frames):.1f} ms of processor time each")


if __name__ == "__main__":
    measure(sys.argv[1:], Path.cwd())
