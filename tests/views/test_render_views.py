"""Many views of one mesh: the same images by any executor, in order, and nothing lost where one fails."""

import multiprocessing
import pickle
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.exact import ties
from atra.views import shared_mesh
from atra.views.render_views import METHODS, trace_view
from examples.clusters import CLUSTERS
from tests.images import assert_same_bits
from tests.meshes import cornell_box, cornell_camera

BOX = cornell_box()
CAMERAS = {
    f"view {i}.png": atra.Camera((np.sin(i) * 0.3, 1 + 0.1 * i, 3), (0, 1, 0), width=24 + 8 * (i % 2), height=16)
    for i in range(5)
}


@pytest.fixture(scope="module")
def expected():
    return {name: alone(camera) for name, camera in CAMERAS.items()}


def alone(camera, kind=atra.RasterTracer, **options):
    with kind(BOX, camera, threads=1, **options) as tracer:
        return tracer.trace()


def assert_as_expected(found, expected):
    assert [name for name, _ in found] == list(expected)
    for name, hits in found:
        assert_same_bits(hits, expected[name])
        assert (hits.mesh, hits.camera, hits.offset) == (BOX, CAMERAS[name], (0.5, 0.5))
        assert hits.depth.flags.writeable


@pytest.mark.parametrize(("method", "options"), [
    ("pixel", {}), ("aligned", {"split": (4, 1)}), ("visible_first", {"split": (4, 1)}),
])  # fmt: skip
def test_every_method_gives_the_images_of_its_own_tracer(method, options):
    cameras = list(CAMERAS.values())[:2]
    for number, (name, hits) in enumerate(atra.render_views(BOX, cameras, method, threads=1, **options)):
        assert name == number
        assert_same_bits(hits, alone(cameras[number], METHODS[method], **options))


def test_all_views_are_drawn_in_this_process_by_one_tracer(expected, monkeypatch):
    made = []
    monkeypatch.setitem(
        METHODS, "raster", lambda *given, **options: made.append(1) or atra.RasterTracer(*given, **options)
    )
    assert_as_expected(list(atra.render_views(BOX, CAMERAS)), expected)
    assert made == [1]


def test_all_tracers_are_closed_in_the_end_busy_ones_when_they_come_back(monkeypatch):
    made = []

    def make(*given, **options):
        made.append(atra.RasterTracer(*given, **options))
        return made[-1]

    monkeypatch.setitem(METHODS, "raster", make)
    with ThreadPoolExecutor(2) as executor:
        assert len(list(atra.render_views(BOX, CAMERAS, executor=executor))) == len(CAMERAS)
    assert made
    stage, busy = shared_mesh.Stage(BOX), atra.RasterTracer(BOX, CAMERAS["view 0.png"], threads=1)
    stage.put(busy)
    assert stage.take() is busy
    stage.strike()
    stage.put(busy)
    for tracer in (*made, busy):
        with pytest.raises(atra.ClosedError, match="closed"):
            tracer.build()


def look_around(where):
    """In a worker: what it knows of the mesh before any view, and whose memory that is."""
    mesh = shared_mesh.stage_of(where, None).mesh
    owner = mesh.vertices
    while isinstance(owner, np.ndarray):
        owner = owner.base
    kept = {name for name in vars(mesh) if isinstance(vars(mesh)[name], np.ndarray)}
    writable = {name for name in kept if vars(mesh)[name].flags.writeable}
    return type(owner.obj).__name__, kept, writable, mesh in ties._found, float(mesh.vertices.sum())


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_processes_give_the_same_images_and_share_the_mesh_and_all_that_was_found_of_it(start, expected):
    if start not in multiprocessing.get_all_start_methods():
        pytest.skip(f"this platform cannot {start} processes")
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context(start)) as executor:
        assert_as_expected(list(atra.render_views(BOX, CAMERAS, executor=executor)), expected)
        mesh = atra.Mesh(BOX.vertices, BOX.faces)  # which the worker has never seen
        _ = mesh.bounds, mesh.traced_faces
        with shared_mesh.shared(mesh, ties.coplanar_overlaps(mesh), between_processes=True) as where:
            found = executor.submit(look_around, where).result()
    kept = {"vertices", "local_vertices", "origin", "faces", "bounds", "traced_faces"}
    assert found == ("mmap", kept, {"bounds"}, True, float(BOX.vertices.sum()))


class Elsewhere(Executor):
    """As on another machine: arguments travel as bytes, and neither mesh nor file of the caller are there."""

    def __init__(self, folder):
        self.folder, self.parcels = folder, 0

    def submit(self, call, *arguments):
        assert call is trace_view
        where, parcel, *rest = pickle.loads(pickle.dumps(arguments))
        self.parcels += parcel is not None
        future = Future()
        try:
            future.set_result(call(replace(where, key="elsewhere", path=self.folder / "none"), parcel, *rest))
        except Exception as error:
            future.set_exception(error)
        return future


def test_a_worker_on_another_machine_is_sent_the_mesh_once_with_what_was_found_of_it(expected, tmp_path, monkeypatch):
    calls, find = [], ties._find
    monkeypatch.setattr(ties, "_find", lambda mesh: calls.append(mesh) or find(mesh))
    executor, mesh = Elsewhere(tmp_path), atra.Mesh(BOX.vertices, BOX.faces)
    try:
        for name, hits in atra.render_views(mesh, CAMERAS, executor=executor, in_flight=1):
            assert_same_bits(hits, expected[name])
    finally:
        shared_mesh._stages.pop("elsewhere").strike()
    assert executor.parcels == 1
    assert calls == [mesh]


@pytest.mark.parametrize("executor", [None, ThreadPoolExecutor(2)], ids=["here", "threads"])
def test_a_view_that_fails_is_named_at_the_end_and_the_others_are_not_lost(executor, expected):
    far = replace(CAMERAS["view 0.png"], eye=(0, 1, 1e13))
    cameras = {"far.png": far, **CAMERAS, "too.png": far}
    found = []
    with pytest.raises(ExceptionGroup, match=r"2 of 7 views failed") as raised:
        found.extend(atra.render_views(BOX, cameras, executor=executor))
    assert_as_expected(found, expected)
    assert [error.__notes__ for error in raised.value.exceptions] == [["in view 'far.png'"], ["in view 'too.png'"]]
    assert all(isinstance(error, atra.InputError) for error in raised.value.exceptions)
    assert not shared_mesh._stages


def test_no_more_cameras_are_taken_than_may_be_in_flight_and_closing_ends_it():
    taken = []

    def cameras():
        for number in range(100):
            taken.append(number)
            yield CAMERAS["view 0.png"]

    with ThreadPoolExecutor(1) as executor:
        results = atra.render_views(BOX, cameras(), executor=executor, in_flight=3)
        assert not taken
        for number in range(4):
            assert next(results)[0] == number
            assert len(taken) <= number + 3
        results.close()
    assert len(taken) < 10
    assert not shared_mesh._stages


@pytest.mark.parametrize(("arguments", "message"), [
    ({"method": "magic"}, "method is 'magic', expected one of raster, pixel, aligned, visible_first"),
    ({"cameras": CAMERAS["view 0.png"]}, "cameras is Camera.*expected several"),
    ({"cameras": 3}, "cameras is 3, expected several"),
    ({"in_flight": 0}, "in_flight is 0, expected a whole number of at least 1"),
    ({"offset": (1, 0)}, r"offset is \(1, 0\)"),
])  # fmt: skip
def test_what_cannot_be_rendered_is_refused_before_anything_is_done(arguments, message):
    with pytest.raises(atra.InputError, match=message):
        atra.render_views(BOX, **{"cameras": CAMERAS, **arguments})


NEEDS = {"dask": "distributed", "ray": "ray"}


@pytest.mark.slow
@pytest.mark.parametrize("cluster", CLUSTERS)
def test_a_cluster_gives_the_same_images(cluster):
    pytest.importorskip(NEEDS[cluster], reason=f"{NEEDS[cluster]} is not installed")
    mesh, whole = cornell_box(), cornell_camera(64, 48)
    cameras = {f"part {left}": whole.crop(left, 0, 32, 48) for left in (0, 16, 32)}
    with CLUSTERS[cluster](1) as executor:
        found = dict(atra.render_views(mesh, cameras, executor=executor))
    assert list(found) == list(cameras)
    for (name, hits), (_, expected) in zip(found.items(), atra.render_views(mesh, cameras, threads=1), strict=True):
        assert_same_bits(hits, expected)
        assert hits.camera == cameras[name]
