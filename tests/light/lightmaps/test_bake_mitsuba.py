"""Lightmaps against Mitsuba 3's path tracer from the same points: blocks of texels, by a test of means."""

import importlib.util

import numpy as np
import pytest

import atra
from atra.light import Atlas, Baker
from atra.light.lightmaps.charts.unwrap import UNMAPPED
from atra.light.lightmaps.sums_kernels import LUMINANCE
from atra.light.tables import unit_normals
from experiments.light.mitsuba_light import mitsuba_scene, parts_of
from scenes.cornell_box import CORNELL_BOX_CAMERA
from scenes.lit.rooms import lit_cornell_box
from tests.baked import sheet, shining_room, standard_error

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba 3 is not installed (extra `peers`)", allow_module_level=True)

BOUNCES, PATHS, TEXELS, BLOCK = 3, 64, 16, 8


def of_mitsuba(scene, origins, directions):
    """(N, 3): radiance of one path along each ray, of BOUNCES reflections at most."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    loaded = mi.load_dict(parts_of(mi, scene))
    path = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1, "rr_depth": 10_000})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1)
    found = np.empty_like(origins)
    for number, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
        radiance, _, _ = path.sample(loaded, sampler, mi.RayDifferential3f(mi.Ray3f(origin, direction)))
        found[number] = np.array(radiance)
    return found


def test_blocks_of_texels_have_the_light_that_mitsuba_finds_from_them():
    scene = shining_room()
    with Baker(scene, sheet(scene.mesh, TEXELS), threads=1, bounces=BOUNCES) as baker:
        baker.add(512)
        lightmap = baker.maps
    texels = lightmap.texels
    random = np.random.default_rng(1)
    which = np.repeat(np.flatnonzero(texels.chart == texels.chart[0]), PATHS)
    tangent = np.cross(texels.normals[which], np.roll(texels.normals[which], 1, axis=1))
    other = np.cross(texels.normals[which], tangent)
    square, turn = random.random(len(which)), 2 * np.pi * random.random(len(which))
    flat = np.sqrt(square)[:, None] * (np.cos(turn)[:, None] * tangent + np.sin(turn)[:, None] * other)
    directions = flat + np.sqrt(1 - square)[:, None] * texels.normals[which]
    theirs = of_mitsuba(scene, texels.positions[which] + 1e-5 * texels.normals[which], directions).sum(axis=1)
    column, row = texels.number[which] % texels.atlas.width, texels.number[which] // texels.atlas.width
    block = (row - row.min()) // BLOCK * 8 + (column - column.min()) // BLOCK
    ours, error = lightmap.combined.sum(axis=1), 3 * standard_error(lightmap)
    for number in np.unique(block):
        inside = block == number
        of_block = np.unique(which[inside])
        spread = np.hypot(theirs[inside].std() / np.sqrt(inside.sum()), error[of_block].mean() / np.sqrt(len(of_block)))
        assert abs(theirs[inside].mean() - ours[of_block].mean()) < 4 * spread
        assert spread < 0.025 * ours[of_block].mean()


WALL, RENDERS, SAMPLES = slice(6, 8), 16, 256


def wall_by_mitsuba(scene):
    """(RENDERS, 3): mean radiance of a wall of the Cornell box, seen from just before it."""
    mi, drjit = pytest.importorskip("mitsuba"), pytest.importorskip("drjit")
    mi.set_variant("scalar_rgb")
    drjit.set_thread_count(1)
    mesh = scene.mesh
    a, b, c = mesh.vertices[mesh.faces[WALL.start]].astype(float)
    normal, middle = unit_normals(mesh)[WALL.start], (a + c) / 2
    place = mi.ScalarTransform4f().look_at(origin=middle + 0.05 * normal, target=middle, up=c - b)
    size = mi.ScalarTransform4f().scale([np.linalg.norm(b - a) / 2, np.linalg.norm(c - b) / 2, 1.0])
    film = {"type": "hdrfilm", "width": TEXELS, "height": TEXELS, "rfilter": {"type": "box"}}
    film["component_format"] = "float32"
    sensor = mi.load_dict({"type": "orthographic", "to_world": place @ size, "near_clip": 0.01, "film": film})
    loaded = mitsuba_scene(mi, scene, atra.Camera(**CORNELL_BOX_CAMERA, width=8, height=8), BOUNCES + 2)
    renders = [np.array(mi.render(loaded, sensor=sensor, spp=SAMPLES, seed=seed)) for seed in range(RENDERS)]
    return np.array([one[..., :3].mean(axis=(0, 1)) for one in renders])


def test_a_wall_of_the_cornell_box_has_mitsuba_s_light_within_three_thousandths():
    scene = lit_cornell_box()
    count = scene.mesh.triangle_count
    uv, chart = np.full((count, 3, 2), np.nan), np.full(count, UNMAPPED)
    corners = 1 + TEXELS * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    uv[WALL], chart[WALL] = corners[[[0, 1, 2], [0, 2, 3]]], 0
    with Baker(scene, Atlas(uv, chart, TEXELS + 2, TEXELS + 2), threads=1, bounces=BOUNCES) as baker:
        baker.add(2048)
        lightmap = baker.maps
    assert len(lightmap.texels) == TEXELS**2
    theirs = wall_by_mitsuba(scene) @ LUMINANCE
    albedo = scene.materials[scene.face_materials[WALL.start]].colour
    ours = (lightmap.combined * albedo).mean(axis=0) @ LUMINANCE
    spread = theirs.std(ddof=1) / np.sqrt(RENDERS)
    assert spread < 0.001 * ours
    assert abs(ours / theirs.mean() - 1) < 0.003
