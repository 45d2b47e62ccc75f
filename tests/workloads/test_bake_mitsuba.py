"""Rounds of bakes beside Mitsuba 3's paths from the same points, and the scenes that are baked."""

import importlib.util
from dataclasses import replace

import pytest

from atra import light
from atra.errors import InputError
from atra.light import Baker
from experiments.light.bake import BAKE
from experiments.light.bake.measure import bake_scene
from experiments.light.bake.mitsuba import MitsubaPaths, with_plain_light
from experiments.light.mitsuba_light import load_mitsuba, suns_of
from experiments.workloads.rounds import load_mesh
from scenes.lit.lighting import lit
from tests.baked import cube, sheet, shining_room
from tests.meshes import joined, quads
from tests.points import planned
from tests.shown import floor
from tests.workloads.test_bake_points import measured, xatlas

needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed (extra `peers`)"
)
BOUNCES = 3


def test_a_measured_bake_has_plain_materials_unless_the_scene_s_own_are_asked_for():
    room = {"name": "living_room"}
    own, plain = (planned("raster", "bake", scene=room, asked=asked).point for asked in ({"materials": "own"}, {}))
    mesh = load_mesh(own)
    shown = lit("living_room", mesh, own.camera)
    scene, grey = bake_scene(own, mesh), bake_scene(plain, mesh)
    for name in ("materials", "lights", "sky"):
        assert getattr(scene, name) == getattr(shown, name)
    assert {one.colour for one in grey.materials} == {(0.7, 0.7, 0.7)}
    dark = replace(own, workload_options=replace(own.workload_options, albedo=0.25))
    assert {one.colour for one in bake_scene(dark, mesh).materials if not any(one.emission)} == {(0.25, 0.25, 0.25)}


def sunlit():
    """A box above a floor, beneath a sun and a sky."""
    mesh = joined(cube(0.5), quads([floor(3.0, -0.6)]))
    materials, sky = [light.Lambertian((0.6, 0.5, 0.4))], light.GradientSky((0.3, 0.3, 0.3), (0.5, 0.7, 1.0))
    return light.Scene(mesh, materials, lights=[light.Sun((-0.35, -1.0, 0.25), power=3.0)], sky=sky)


@needs_mitsuba
@pytest.mark.parametrize("room", [shining_room(), sunlit()], ids=["lamp", "sun"])
def test_paths_that_a_round_is_held_against_find_the_same_light_and_as_many_vertices(room):
    try:
        load_mitsuba("llvm_ad_rgb", "this test", 1)
    except InputError as problem:
        pytest.skip(str(problem))
    room = with_plain_light(room)
    with Baker(room, sheet(room.mesh, 8), threads=1, bounces=BOUNCES) as baker:
        theirs = MitsubaPaths(room, baker, 16)
        for _ in range(15):
            theirs.add()
        baker.add(256)
        found = theirs.against(baker.maps, baker.maps)
    assert abs(found["other_light_ratio"] - 1) < 4 * found["other_light_error"]
    assert found["other_light_error"] < 0.01


@xatlas
@needs_mitsuba
def test_a_round_of_a_point_is_held_against_as_many_paths_by_mitsuba():
    point, found = measured(against="mitsuba", samples=4)
    assert set(found.samples) == {"own", "other"} == BAKE.samples(point)
    assert found.results["paths_per_round"] == 4 * found.results["texels"]
    assert {"other_light_ratio", "other_light_error", "best_other_ratio"} <= set(found.results)
    assert "other_rays_per_round" not in found.results


def test_light_that_mitsuba_is_not_handed_is_refused():
    with pytest.raises(InputError, match="expected no PointLight"):
        suns_of([light.PointLight((0, 1, 0))])
    with pytest.raises(InputError, match="expected no Sun"):
        suns_of([light.Sun((0, -1, 0))])
