"""Embree's threads work while a BVH is built, and sleep afterwards."""

import subprocess
import sys

from atra.embree.building import building
from atra.embree.library import load_library
from tests.folders import ROOT

IDLE = """
import time
import numpy as np
import atra
mesh = atra.Mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32), np.array([(0, 1, 2)], np.uint32))
tracer = atra.PixelTracer(mesh, atra.Camera((0, 0, 3), (0, 0, 0), width=8, height=8), threads=1)
tracer.build()
used = time.process_time()
time.sleep(0.5)
print(time.process_time() - used)
"""


def test_after_a_build_with_one_thread_no_other_one_keeps_a_core_busy():
    done = subprocess.run([sys.executable, "-c", IDLE], cwd=ROOT, capture_output=True, text=True, check=True)
    assert float(done.stdout) < 0.25


def test_while_one_thread_builds_no_device_allows_it_more(monkeypatch):
    made = []
    library = load_library()
    monkeypatch.setattr(library.functions, "rtcNewDevice", lambda options: made.append(options) or len(made))
    monkeypatch.setattr(library.functions, "rtcReleaseDevice", lambda device: made.pop())
    monkeypatch.setattr("atra.embree.building._idle_device", None)
    with building(library, 1):
        with building(library, 1):
            assert made == []
        assert made == []
    assert [b"threads=2" in options for options in made] == [True]
    with building(library, 1):
        assert made == []
    with building(library, 4):
        assert len(made) == 1
