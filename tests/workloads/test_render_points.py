"""Workload render: pictures that are timed."""

from dataclasses import replace

import numpy as np
import pytest

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.light import Emissive, Metal, PathRenderer
from experiments.harness.processes.worker import measure_point
from experiments.harness.records import Record
from experiments.light.mitsuba_light import check_llvm
from experiments.light.render import RENDER, STAGES, RenderOptions, outside_embree
from experiments.methods import find_method
from experiments.workloads.baselines import PACKETS
from experiments.workloads.rounds import expert_packet_widths
from scenes.built_in import BUILT_IN, make_scene
from scenes.lit.interiors import lit_atrium, lit_living_room
from scenes.lit.lighting import WITH_MATERIALS, lit
from tests import points

pytestmark = pytest.mark.uncovered

WIDTH, HEIGHT = 24, 16


def planned(method="raster", scene=None, **options):
    return points.planned(method, "render", (WIDTH, HEIGHT), scene=scene, asked={"samples": 2, **options})


@pytest.mark.parametrize(("options", "stages"), [
    ({}, {"primary", "surfaces", "generate", "shadow", "occlusion", "accumulate", "other"}),
    ({"frame": "path"}, {"primary", "depth_first", "other"}),
])  # fmt: skip
def test_a_point_has_pictures_by_each_primary_visibility_and_their_stages(options, stages):
    found = measure_point(planned(**options).point)
    primaries = {"own", "rtcIntersect1", *(PACKETS[width] for width in expert_packet_widths())}
    assert set(found.samples) == primaries | {f"{name}_primary" for name in primaries}
    assert {len(values) for values in found.samples.values()} == {3}
    assert set(found.results["stages"]) == stages
    assert stages <= set(STAGES)
    assert found.results["pixels_wrong"] == found.results["pixels_unlike"] == 0
    assert 2 * WIDTH * HEIGHT < found.results["rays"] <= 2 * WIDTH * HEIGHT * (9 if "frame" in options else 3)
    own = np.array(found.samples["own"])
    assert (np.array(found.samples["own_primary"]) < own).all()


def test_a_pre_pass_by_llvmpipe_makes_pictures_and_its_pixels_are_judged():
    if problem := find_method("llvmpipe").problem():
        pytest.skip(problem)
    found = measure_point(planned("llvmpipe").point)
    assert found.results["pixels_unlike"] == 0
    assert 0 <= found.results["pixels_wrong"] < 0.02 * WIDTH * HEIGHT
    assert set(found.results["stages"]) >= {"primary", "surfaces", "shadow", "occlusion"}


def test_with_a_still_camera_primary_visibility_is_found_once_a_picture():
    found = {
        jitter: measure_point(planned(jitter=jitter, shadow_rays=0, occlusion_rays=0).point)
        for jitter in ("shared", "off")
    }
    rays = {jitter: one.results["rays"] for jitter, one in found.items()}
    assert rays == {"shared": 2 * WIDTH * HEIGHT, "off": WIDTH * HEIGHT}


def a_record(samples, **results):
    configuration = {"workload": RENDER.name, "workload_options": {"samples": 4}}
    return Record("0", "ok", None, configuration, {}, {}, samples, results)


def value(record, name):
    (column,) = (one for one in RENDER.columns if one.name == name)
    return column.value([record])


def test_amdahl_s_forecast_is_the_packets_picture_with_the_own_primary_in_it():
    record = a_record(
        {
            "own": [6.0, 6.0, 6.0], "own_primary": [1.0, 1.0, 1.0], "rtcIntersect1": [30.0] * 3,
            "packets_8": [10.0, 10.0, 20.0], "packets_8_primary": [5.0, 6.0, 5.0],
        },
        stages={"primary": 1.0, "shadow": 2.0, "accumulate": 3.0}, rays=600,
        plan_time_s=2.0, build_time_s=3.0, baseline_build_time_s=1.5,
    )  # fmt: skip
    assert value(record, "speedup_forecast") == 10 / 6  # of 10/6, 10/5 and 20/16
    assert value(record, "speedup_vs_packets") == 10 / 6
    assert value(record, "outside_embree") == 0.5
    assert value(record, "break_even_subframes") == 4  # 3.5 s behind, 1 s of each sample gained
    slower = replace(record, samples=record.samples | {"own": [11.0] * 3})
    assert value(slower, "break_even_subframes") is None
    assert outside_embree({"primary": 1.0, "depth_first": 3.0}) is None  # paths one by one have Embree within
    nothing_behind = replace(record, results=record.results | {"baseline_build_time_s": 9.0})
    assert value(nothing_behind, "break_even_subframes") == 1


@pytest.mark.parametrize(("options", "message"), [
    ({"samples": 0}, "samples is 0"), ({"occlusion_rays": 65}, "occlusion_rays is 65"),
    ({"frame": "path", "max_depth": 0}, "bounces is -1"), ({"occlusion_part": -1.0}, "occlusion_length is -1"),
])  # fmt: skip
def test_what_no_picture_can_have_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        RenderOptions(**options)


def test_a_scene_has_its_own_materials_or_a_sun_that_shines_where_the_camera_looks():
    camera = planned().point.camera
    for name, material in (("weekend", Metal), ("cornell_box", Emissive)):
        mesh = make_scene(name).mesh
        assert any(isinstance(one, material) for one in lit(name, mesh, camera).materials)
    for name, mesh in (("needles", make_scene("needles").mesh), ("weekend", make_scene("cornell_box").mesh)):
        grey = lit(name, mesh, camera)
        (sun,) = grey.lights
        assert len(grey.materials) == 1
        assert np.dot(sun.direction, camera.axes[2]) > 0
        assert sun.direction[1] < 0


def test_an_interior_has_lamps_a_sun_and_an_opening_for_it():
    for name, make in (("living_room", lit_living_room), ("atrium", lit_atrium)):
        assert WITH_MATERIALS[name] is make
        scene = make()
        made_of = [scene.materials[number] for number in np.unique(scene.face_materials)]
        assert sum(max(one.emission) > 1.0 for one in made_of) >= 2
        assert any(getattr(one, "opacity", 1.0) == 0.0 for one in made_of)
        assert scene.lights[0].power > 1.0 < scene.sky.power * max(scene.sky.above)
        assert len(made_of) == len(scene.materials)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["living_room", "atrium"])
def test_an_interior_by_paths_is_lit_in_every_block_of_the_picture(name):
    mesh = make_scene(name).mesh
    camera = Camera(**BUILT_IN[name].camera, width=32, height=32)
    with PathRenderer(lit(name, mesh, camera), camera, bounces=7, threads=1) as renderer:
        renderer.add(16)
        blocks = renderer.image.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3, 4))
    assert blocks.min() > 0.005
    assert 0.05 < np.median(blocks) < 1.0


def test_a_libllvm_that_would_end_the_process_is_refused_by_its_version():
    with pytest.raises(InputError, match=r"finds libLLVM 15\.0\.6, expected 16 or newer: install libLLVM"):
        check_llvm((15, 0, 6), "workload.mitsuba=llvm_ad_rgb")
    check_llvm((19, 1, 7), "workload.mitsuba=llvm_ad_rgb")
