"""Tracers from making to closing: nothing leaks, nothing is used after it is gone, every order of calls is defined."""

import gc
import os
import subprocess
import sys
import threading
import weakref
from concurrent.futures import Future

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.embree.device import EmbreeDevice
from tests.failing import Failing, Injected
from tests.images import make_tracer
from tests.meshes import cornell_box, cornell_camera

pytestmark = pytest.mark.usefixtures("old_objects_set_aside")

MESH, CAMERA = cornell_box(), cornell_camera(64, 48)
TRACERS = ("pixels", "aligned", "instanced", "visible_first")
every_tracer = pytest.mark.parametrize("name", TRACERS)


def tracer(name, threads=1):
    return make_tracer(name, MESH, CAMERA, (16, 1), threads=threads)


def image(name):
    with tracer(name) as one:
        return one.trace().prim_id


def devices(one):
    """Every Embree device a tracer holds."""
    prepared = getattr(one, "prepared", None)
    if prepared is None:
        return []
    second = [each.scene for each in getattr(prepared, "second_passes", ()) if each is not None]
    return [value for value in (*vars(prepared).values(), *second) if isinstance(value, EmbreeDevice)]


def in_threads(*works, timeout_s=60):
    """Run side by side; the first exception of any comes out."""
    errors = []

    def guarded(work):
        try:
            work()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=guarded, args=(work,)) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout_s)
        assert not thread.is_alive(), "a thread hangs"
    if errors:
        raise errors[0]


def test_what_embree_reads_lives_as_long_as_the_scene():
    # The tracer forgets its plan; the scene must not.
    with tracer("aligned") as one:
        expected = one.trace().prim_id
        vertices, records = (
            weakref.ref(array) for array in (one.prepared.geometry.vertices, one.prepared.geometry.records)
        )
        one.prepared.geometry = None
        gc.collect()
        assert vertices() is not None
        assert records() is not None
        np.testing.assert_array_equal(one.trace().prim_id, expected)
    gc.collect()
    assert vertices() is None
    assert records() is None


@every_tracer
def test_nothing_is_traced_after_closing_which_gives_back_every_byte_and_may_come_twice(name):
    one = tracer(name)
    with one:
        one.trace()
        held = devices(one)
        assert held
        assert all(device.embree_bytes > 0 for device in held)
    # The monitor has seen the last allocation go: there is nothing left that could call it.
    assert [device.embree_bytes for device in held] == [0] * len(held)
    assert all(device.closed for device in held)
    one.close()
    for call in (one.trace, one.build):
        with pytest.raises(atra.ClosedError, match="closed"):
            call()


def test_closing_waits_for_the_frame_in_progress(monkeypatch):
    with tracer("aligned") as one:
        begun, may_go_on, traced = threading.Event(), threading.Event(), []
        draw = one.prepared.draw

        def slow_draw(*arguments):
            begun.set()
            assert may_go_on.wait(30)
            assert not any(device.closed for device in devices(one))
            draw(*arguments)

        monkeypatch.setattr(one.prepared, "draw", slow_draw)

        def close():
            assert begun.wait(30)
            closing = threading.Thread(target=one.close)
            closing.start()
            closing.join(0.05)
            assert closing.is_alive()
            may_go_on.set()
            closing.join(30)
            assert not closing.is_alive()

        in_threads(lambda: traced.append(one.trace()), close)
        assert traced
        assert all(device.closed for device in devices(one))


@pytest.mark.parametrize("step", ["prepare", "draw"])
def test_an_exception_in_the_middle_comes_out_and_the_next_attempt_succeeds(step):
    name = "aligned"
    expected = image(name)
    one = tracer(name, 2)
    method, one.method = one.method, Failing(one.method, step)  # when all of its work is done
    with pytest.raises(Injected):
        one.trace()
    one.method = method
    one.build()
    np.testing.assert_array_equal(one.trace().prim_id, expected)
    one.close()
    one = tracer(name, 2)
    one.method = Failing(one.method, step, after=False)
    with pytest.raises(Injected), one:
        one.trace()
    assert all(device.closed for device in devices(one))
    with pytest.raises(atra.ClosedError, match="closed"):
        one.trace()


@pytest.mark.parametrize("call", ["rtcCommitScene", "rtcAttachGeometry", "rtcSetGeometryUserData"])
def test_an_embree_call_that_fails_is_named_and_its_device_released(call, monkeypatch):
    made = []
    real_call = EmbreeDevice._call

    def call_or_fail(self, name, *arguments):
        made.append((self, self._byte_count))
        if name == call:
            raise atra.EmbreeError(f"{name} failed: injected")
        return real_call(self, name, *arguments)

    monkeypatch.setattr(EmbreeDevice, "_call", call_or_fail)
    one = tracer("aligned")
    with pytest.raises(atra.EmbreeError, match=f"{call} failed"), one:
        pass
    assert made
    assert all(device.closed and counter[0] == 0 for device, counter in made)


@pytest.mark.parametrize("faulty", [0, 1, 2])
def test_the_pool_raises_what_a_thread_raised_only_when_all_are_done(faulty):
    pool = WorkerPool(3)
    others_may_go_on = threading.Event()
    finished = []

    def kernel(worker, counter):
        if worker == faulty:
            others_may_go_on.set()
            raise Injected
        assert others_may_go_on.wait(30)
        threading.Event().wait(0.02)
        finished.append(worker)

    with pytest.raises(Injected):
        pool.run(kernel)
    assert sorted(finished) == sorted({0, 1, 2} - {faulty})
    pool.close()


def test_the_pool_waits_for_its_threads_even_when_the_waiting_is_interrupted(monkeypatch):
    # Ctrl-C comes to the waiting thread, while others still write to memory that it is about to free.
    pool = WorkerPool(2)
    may_finish, finished = threading.Event(), []
    real_wait = Future.exception

    def interrupted_wait(future):
        if not may_finish.is_set():
            may_finish.set()
            raise KeyboardInterrupt
        return real_wait(future)

    monkeypatch.setattr(Future, "exception", interrupted_wait)

    def kernel(worker, counter):
        if worker == 1:
            assert may_finish.wait(30)
            threading.Event().wait(0.02)
        finished.append(worker)

    with pytest.raises(KeyboardInterrupt):
        pool.run(kernel)
    assert sorted(finished) == [0, 1]
    pool.close()


@pytest.mark.parametrize("ending", ["", "one.close(); one.close()"])
def test_a_process_may_end_with_tracers_open_and_a_thread_still_tracing(ending):
    script = (
        "import threading, time, atra\n"
        "from tests.meshes import cornell_box, cornell_camera\n"
        "one = atra.AlignedTracer(cornell_box(), cornell_camera(256, 256), (16, 1), threads=1)\n"
        "one.__enter__(); one.trace()\n"
        "other = atra.AlignedTracer(cornell_box(), cornell_camera(256, 256), (16, 1), threads=1)\n"
        "other.__enter__()\n"
        "def work():\n"
        "    while True: other.trace()\n"
        "threading.Thread(target=work, daemon=True).start()\n"
        "time.sleep(0.05)\n"
        f"{ending}\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == ""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_child_traces_on_and_builds_its_own():
    """It has none of the threads of its parent."""
    script = (
        "import os, sys, signal, numpy\n"
        "from tests.tracing.test_lifetimes import tracer\n"
        "for name in ('pixels', 'aligned', 'visible_first'):\n"
        "    with tracer(name, 2) as one:\n"
        "        before = one.trace().prim_id.copy()\n"
        "        child = os.fork()\n"
        "        if not child:\n"
        "            signal.alarm(30)\n"
        "            with tracer(name, 2) as other:\n"
        "                images = [one.trace().prim_id, one.trace().prim_id, other.trace().prim_id]\n"
        "            os._exit(not all(numpy.array_equal(image, before) for image in images))\n"
        "        status = os.waitpid(child, 0)[1]\n"
        "        assert numpy.array_equal(one.trace().prim_id, before)\n"
        "    if status: sys.exit(f'the child of {name} ended with status {status}')\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
