"""What is dropped without `close` frees its threads and Embree's memory at once, whatever became of it before."""

import gc
import threading
import weakref

import numpy as np
import psutil
import pytest

import atra
from atra import light
from atra.embree.device import EmbreeDevice
from atra.light import Baker, Scene
from tests.images import make_tracer
from tests.meshes import cornell_box, cornell_camera

pytestmark = pytest.mark.usefixtures("old_objects_set_aside")

MESH, CAMERA = cornell_box(), cornell_camera(64, 48)
RAYS = np.zeros((200, 3)), np.ones((200, 3))
FRAMES = atra.Alignment.of_frames([CAMERA, CAMERA], atra.Split(16, 1, 64, 48))
SCENE = light.Scene(MESH, lights=[light.Sun((0.1, -1, -0.2))])


def traced(one):
    one.build()
    one.trace()
    return one


def gathered(one):
    traced(one).gather(atra.Count())
    return one


def looked(one):
    traced(one).look(cornell_camera(32, 32))
    one.trace()
    return one


def shot(scene):
    scene.intersect(*RAYS)
    return scene


def added(one):
    one.build()
    one.add()
    return one


MAKE = {
    **{
        kind: lambda kind=kind: traced(make_tracer(kind, MESH, CAMERA, (16, 1), threads=2))
        for kind in ("pixels", "aligned", "instanced", "visible_first")
    },
    "frames": lambda: traced(atra.FramesTracer(MESH, FRAMES, threads=2)),
    "raster": lambda: traced(atra.RasterTracer(MESH, CAMERA, threads=2)),
    "pixels gathered": lambda: gathered(atra.PixelTracer(MESH, CAMERA, threads=2)),
    "aligned gathered": lambda: gathered(atra.AlignedTracer(MESH, CAMERA, (16, 1), threads=2)),
    "raster gathered": lambda: gathered(atra.RasterTracer(MESH, CAMERA, threads=2)),
    "one that looked elsewhere": lambda: looked(atra.AlignedTracer(MESH, CAMERA, (16, 1), threads=2)),
    "ray scene": lambda: shot(atra.RayScene(MESH, threads=2)),
    "hybrid renderer": lambda: added(light.HybridRenderer(SCENE, CAMERA, threads=2)),
    "path renderer": lambda: added(light.PathRenderer(SCENE, CAMERA, threads=2)),
    "baker": lambda: added(Baker(Scene.plain(MESH), size=16, threads=2)),
}


@pytest.fixture
def no_collector():
    """Only what nothing refers to is released."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.fixture
def held(monkeypatch):
    """Bytes that each Embree device holds by its own account."""
    counters = []
    make = EmbreeDevice.__init__

    def noted(self, **settings):
        make(self, **settings)
        counters.append(self._byte_count)

    monkeypatch.setattr(EmbreeDevice, "__init__", noted)
    return counters


def assert_end(threads):
    for thread in threads:
        thread.join(30)
    assert not [thread for thread in threads if thread.is_alive()]


@pytest.mark.parametrize("kind", MAKE)
def test_dropping_the_last_reference_frees_threads_and_memory(kind, no_collector, held):
    MAKE[kind]()  # Numba, where it still compiles, leaves cycles of frames that refer to the tracer
    gc.collect()
    held.clear()
    before = set(threading.enumerate())
    one = MAKE[kind]()
    started, reference = set(threading.enumerate()) - before, weakref.ref(one)
    assert started
    del one
    assert reference() is None
    assert_end(started)
    assert [int(counter[0]) for counter in held] == [0] * len(held)


def test_a_constructor_that_fails_leaves_nothing(held):
    before = set(threading.enumerate())
    with pytest.raises(atra.InputError, match="does not divide"):
        light.HybridRenderer(SCENE, CAMERA, lambda mesh, camera: atra.AlignedTracer(mesh, camera, (7, 1)), threads=2)
    assert set(threading.enumerate()) == before
    assert not held


@pytest.fixture
def untraced_threads():
    """Coverage keeps a kilobyte of every thread that it traces, so new threads are not traced."""
    hook = threading.gettrace()
    threading.settrace(None)
    yield
    threading.settrace(hook)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pixels", "aligned", "visible_first", "raster", "ray scene"])
def test_a_thousand_dropped_leave_threads_and_memory_as_they_were(kind, untraced_threads):
    """A leak grows with every round. The heap settles in one of them, by some megabytes in an old process."""
    for _ in range(50):
        MAKE[kind]()
    threads, grown = set(threading.enumerate()), []
    for _ in range(3):
        memory = psutil.Process().memory_info().rss
        for _ in range(1000):
            MAKE[kind]()
        assert_end(set(threading.enumerate()) - threads)
        grown.append((psutil.Process().memory_info().rss - memory) / 1e6)
    assert min(grown) < 1, f"each thousand dropped grew the process by {grown} MB"
