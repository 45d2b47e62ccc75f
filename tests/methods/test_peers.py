"""Other ray tracers behind the protocol: the same rays, the same hits, and a reason where one cannot be used."""

import platform
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import atra
from atra.geometry.ray_space import NARROWEST_WORLD_PITCH
from experiments.harness.method import Tracing
from experiments.methods import METHODS, find_method
from experiments.methods.peers import embreex_run, llvmpipe
from experiments.methods.peers.peer import PEER_COLUMNS, block_order
from tests.images import trace_pixels
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

LOADER = "cannot open shared object file: No such file or directory"


@pytest.fixture(params=[one for one in METHODS if not one.is_ours], ids=lambda one: one.name)
def peer(request):
    problem = request.param.problem()
    if problem is not None:
        pytest.skip(problem)
    return request.param


def make_peer(peer, mesh, camera, threads=1):
    return peer.make(mesh, camera, peer.resolve(peer.options(), camera.width), Tracing(threads))


def trace_peer(peer, mesh, camera, threads=1):
    with make_peer(peer, mesh, camera, threads) as tracer:
        return tracer.trace()


ROUNDED = 0.005
"""Share of pixels that a peer gets wrong at most that rounds corners to a part of a pixel."""


def assert_equal_images(peer, hits, reference):
    """No pixel is wrong, or few where it is known that outlines are not exact."""
    agreement = atra.compare(hits, reference)
    wrong = ROUNDED if peer is llvmpipe.LLVMPIPE else 0
    assert agreement.pixels_wrong <= wrong * agreement.pixels, str(agreement)
    assert agreement.pixels_equal >= 0.98 * agreement.pixels, str(agreement)
    assert (hits.depth.dtype, hits.prim_id.dtype) == (np.float32, np.uint32)


def test_a_peer_traces_the_rays_of_any_offset_in_any_order(peer):
    mesh, camera = cornell_box(), cornell_camera(48, 31)
    with make_peer(peer, mesh, camera) as tracer:
        hits = tracer.trace()
        assert_equal_images(peer, hits, trace_pixels(mesh, camera))
        kept = hits.prim_id.copy()
        for offset in ((0.0, 0.0), (0.1, 0.9)):
            hits = tracer.trace(offset, out=hits)
            assert_equal_images(peer, hits, trace_pixels(mesh, camera, offset))
        np.testing.assert_array_equal(tracer.trace(out=hits).prim_id, kept)


def test_a_peer_looks_from_elsewhere_and_at_another_size_as_one_made_for_that(peer):
    mesh, camera = cornell_box(), cornell_camera(48, 31)
    with make_peer(peer, mesh, camera) as tracer:
        tracer.trace()
        for other in (replace(camera, eye=(0.2, 1.1, 2.5)), cornell_camera(20, 33)):
            tracer.look(other)
            assert_equal_images(peer, tracer.trace(), trace_pixels(mesh, other))


def test_a_miss_has_infinite_depth_and_a_hit_the_depth_along_the_view_axis(peer):
    camera = atra.Camera(**EYE_AT_ORIGIN, width=24, height=16, fov_y_degrees=120)
    hits = trace_peer(peer, quads([[(-90, 1, 5), (90, 1, 5), (90, 90, 5), (-90, 90, 5)]]), camera)
    np.testing.assert_allclose(hits.depth[0], 5.0, rtol=1e-6)
    assert (hits.prim_id[-1] == atra.MISS).all()
    assert np.isinf(hits.depth[-1]).all()


@pytest.mark.parametrize("seed", range(3))
def test_triangles_behind_around_and_through_the_eye_give_the_float64_image(peer, seed):
    mesh = random_triangles(60, seed)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=[60, 120, 165][seed])
    assert_equal_images(peer, trace_peer(peer, mesh, camera), brute_force(mesh, camera))


def test_a_narrow_view_is_traced_in_the_world_too(peer):
    mesh = random_triangles(400, 4, size=0.02, spread=0.05)
    camera = atra.Camera((3, 4, -5), (0, 0, 0), fov_y_degrees=0.6, width=64, height=64)
    assert camera.pixel_pitch < NARROWEST_WORLD_PITCH
    reference = brute_force(mesh, camera)
    assert reference.hit.mean() > 0.5
    assert_equal_images(peer, trace_peer(peer, mesh, camera), reference)


def test_the_number_of_threads_does_not_change_the_image(peer):
    mesh, camera = cornell_box(), cornell_camera(61, 7)
    single, many = (trace_peer(peer, mesh, camera, threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(many.prim_id, single.prim_id)
    np.testing.assert_array_equal(many.depth, single.depth)


@pytest.fixture
def library(peer):
    """A peer that is called in this process."""
    if peer.counters != PEER_COLUMNS:
        pytest.skip(f"{peer.name} is a program of its own")
    return peer


def test_the_table_says_of_a_peer_what_was_called_in_which_version_and_how_exact_it_is(library):
    mesh, camera = cornell_box(), cornell_camera(16, 16)
    with make_peer(library, mesh, camera, 2) as tracer:
        told = [tracer.counters[column.name] for column in library.counters]
        assert (tracer.threads, tracer.triangle_count, tracer.embree_bytes) == (2, mesh.triangle_count, 0)
        assert tracer.build_time_s > 0 <= tracer.plan_time_s
    assert told[0] == library.version()
    assert all(told)


def test_what_is_timed_of_a_peer_is_its_own_query_alone(library, monkeypatch):
    with make_peer(library, cornell_box(), cornell_camera(16, 16)) as tracer:
        in_rows = tracer.prepared._in_rows
        monkeypatch.setattr(tracer.prepared, "_in_rows", lambda values: (time.sleep(0.05), in_rows(values))[1])
        start = time.perf_counter()
        tracer.trace()
        assert 0 < tracer.prepared.frame_time_s < time.perf_counter() - start - 0.09


def test_rays_come_block_by_block_each_once_and_blocks_at_the_border_are_smaller():
    order = block_order(20, 11)
    assert sorted(order) == list(range(220))
    x, y = order % 20, order // 20
    assert np.ptp(x[:64]) == np.ptp(y[:64]) == 7
    assert (x[128:160].min(), x[128:160].max(), y[128:160].max()) == (16, 19, 7)
    assert (np.diff(y // 8 * 3 + x // 8) >= 0).all()


def test_misuse_is_an_error_and_closing_twice_is_not(peer):
    with pytest.raises(atra.InputError, match="threads is 0"):
        make_peer(peer, cornell_box(), cornell_camera(16, 16), threads=0)
    tracer = make_peer(peer, cornell_box(), cornell_camera(16, 16))
    with tracer:
        with pytest.raises(atra.InputError, match="offset"):
            tracer.trace((1.0, 0.5))
        hits = tracer.trace()
    tracer.close()
    assert hits.hit.any()
    for use in (tracer.trace, tracer.build):
        with pytest.raises(atra.ClosedError, match="closed"):
            use()


@pytest.mark.parametrize(("name", "module"), [
    ("embreex", "embreex.rtcore_scene"), ("trimesh", "trimesh"), ("mitsuba3", "mitsuba"), ("open3d", "open3d"),
    ("llvmpipe", "moderngl"),
])  # fmt: skip
def test_a_missing_package_is_a_reason_not_a_crash(monkeypatch, name, module):
    monkeypatch.setitem(sys.modules, module, None)  # as if it were not installed
    monkeypatch.setattr(sys, "version_info", (3, 11, 0))
    problem = find_method(name).problem()
    assert "atra[peers]" in problem
    assert "\n" not in problem
    with pytest.raises(atra.InputError, match="peers"):
        make_peer(find_method(name), cornell_box(), cornell_camera(16, 16))


def test_a_machine_without_a_wheel_is_named(monkeypatch):
    def absent(_):
        raise ModuleNotFoundError("No module named 'embreex'", name="embreex")

    monkeypatch.setattr(embreex_run, "import_module", absent)
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    problem = find_method("embreex").problem()
    assert problem.startswith("embreex is not installed; embreex has no wheel for ")
    assert problem.endswith(" on riscv64")


WITHOUT_LLVM = "variants = lambda: ['llvm_ad_mono']\ndef set_variant(name): raise ImportError('no libLLVM.so')"


@pytest.mark.parametrize(("name", "module", "source", "expected"), [
    ("open3d", "open3d", f"raise OSError('libusb-1.0.so.0: {LOADER}')", "cannot be imported, OSError: libusb-1.0.so.0"),
    ("open3d", "open3d", "import a_module_nobody_has", "No module named 'a_module_nobody_has'"),
    ("open3d", "open3d", "raise AttributeError('_ARRAY_API\\nnot found')", "AttributeError: _ARRAY_API not found"),
    ("mitsuba3", "mitsuba", "variants = lambda: ['scalar_rgb']", "without the variant llvm_ad_mono"),
    ("mitsuba3", "mitsuba", WITHOUT_LLVM, "install libLLVM 16 or newer (Debian: libllvm19) or let DRJIT_LIBLLVM_PATH"),
])  # fmt: skip
def test_a_broken_package_is_a_reason_of_one_line_not_a_crash(monkeypatch, tmp_path, name, module, source, expected):
    (tmp_path / f"{module}.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, module, raising=False)
    problem = find_method(name).problem()
    sys.modules.pop(module, None)  # not by monkeypatch, whose undoing would bring the fake back
    assert expected in problem
    assert "\n" not in problem


@pytest.fixture
def _drawn_by_llvmpipe():
    problem = llvmpipe.LLVMPIPE.problem()
    if problem is not None:
        pytest.skip(problem)


@pytest.mark.usefixtures("_drawn_by_llvmpipe")
def test_llvmpipe_draws_parallel_views():
    mesh, offset = cornell_box(), (0.1, 0.9)
    camera = atra.OrthographicCamera((2, 3, 4), (0, 0.5, 0), view_height=4, width=96, height=64)
    with make_peer(llvmpipe.LLVMPIPE, mesh, camera) as tracer:
        hits = tracer.trace(offset)
    assert 0.2 < hits.hit.mean() < 0.9
    assert_equal_images(llvmpipe.LLVMPIPE, hits, trace_pixels(mesh, camera, offset))


@pytest.mark.usefixtures("_drawn_by_llvmpipe")
def test_llvmpipe_is_called_wrong_where_it_rounds_outlines():
    mesh = random_triangles(3000, 5, size=0.05, spread=1)
    camera = atra.Camera((0, 0, -3), (0, 0, 0), width=256, height=256)
    agreement = atra.compare(trace_peer(llvmpipe.LLVMPIPE, mesh, camera), trace_pixels(mesh, camera))
    assert agreement.pixels_wrong > 0


@pytest.mark.usefixtures("_drawn_by_llvmpipe")
def test_llvmpipe_tells_triangles_apart_that_are_a_millionth_apart_in_depth():
    behind, before = ([(-9, -9, z), (9, -9, z), (9, 9, z), (-9, 9, z)] for z in (5.00002, 5.0))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64)
    for order, first in (([behind, before], 2), ([before, behind], 0)):
        assert set(np.unique(trace_peer(llvmpipe.LLVMPIPE, quads(order), camera).prim_id)) == {first, first + 1}


def test_another_opengl_than_llvmpipe_and_none_at_all_are_named(monkeypatch):
    pytest.importorskip("moderngl")
    monkeypatch.setattr(llvmpipe, "_EGL", "libnone.so.1")
    assert llvmpipe.LLVMPIPE.problem() == (
        "moderngl gets no OpenGL 4.5 through EGL (libnone.so.1 not loaded); "
        "install Debian's libegl1 libgl1-mesa-dri libgles2"
    )
    other = SimpleNamespace(info={"GL_RENDERER": "A fast card"}, release=lambda: None)
    monkeypatch.setattr(llvmpipe, "opengl_context", lambda threads: other)
    assert llvmpipe.LLVMPIPE.problem().startswith("OpenGL is A fast card, not llvmpipe; ")
