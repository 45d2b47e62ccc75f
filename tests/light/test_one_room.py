"""A room with a window of thin glass, a lamp, a ball of glass, one of metal and a floor of many normals: its light at
50 places is the same in pictures, in lightmaps, and by Mitsuba 3."""

import importlib.util

import numpy as np
import pytest
from scipy import stats

import atra
from atra import light
from atra.light import Atlas, Baker, PathRenderer
from atra.light.lightmaps.charts.unwrap import UNMAPPED
from experiments.light.mitsuba_light import parts_of
from scenes.lit.weekend import outwards
from scenes.shapes import ball, join, quad
from tests.light.mitsuba_materials import material_in_room

CELL, PLACES, SIDE = 0.25, 50, 16
BATCHES, SAMPLES, BOUNCES = 8, 1024, 24

WIDE, HIGH, LOW, TOP, HALF = 2.0, 2.5, 0.75, 2.0, 0.75
"""Half the room's width, its height; the window's lower and upper end, and half its width."""

WALLS = [
    ((-WIDE, 0, WIDE), (2 * WIDE, 0, 0), (0, 0, -2 * WIDE)),
    ((-WIDE, HIGH, -WIDE), (2 * WIDE, 0, 0), (0, 0, 2 * WIDE)),
    ((-WIDE, 0, -WIDE), (2 * WIDE, 0, 0), (0, HIGH, 0)),
    ((WIDE, 0, WIDE), (-2 * WIDE, 0, 0), (0, HIGH, 0)),
    ((-WIDE, 0, WIDE), (0, 0, -2 * WIDE), (0, HIGH, 0)),
    ((WIDE, 0, -WIDE), (0, 0, 2 * WIDE), (0, LOW, 0)),
    ((WIDE, TOP, -WIDE), (0, 0, 2 * WIDE), (0, HIGH - TOP, 0)),
    ((WIDE, LOW, -WIDE), (0, 0, WIDE - HALF), (0, TOP - LOW, 0)),
    ((WIDE, LOW, HALF), (0, 0, WIDE - HALF), (0, TOP - LOW, 0)),
]
"""A corner and two sides of each rectangle of the walls; the first is the floor, the last four surround the window."""


def cells():
    """(N, 3, 3): a corner and two sides of each square of the walls, and (N,) the wall it is of."""
    found, walls = [], []
    for number, wall in enumerate(np.array(WALLS, float)):
        corner, across, up = wall
        columns, rows = (round(float(np.linalg.norm(side) / CELL)) for side in (across, up))
        for row, column in np.ndindex(rows, columns):
            found.append((corner + column / columns * across + row / rows * up, across / columns, up / rows))
            walls.append(number)
    return np.array(found), np.array(walls)


def bumps(steepest=0.2):
    """Waves, as an image of normals. Steep ones scatter light below the floor, which Mitsuba drops, and ours mirrors
    (`on_side`); of these it drops about a hundredth."""
    y, x = np.mgrid[:32, :32] * (2 * np.pi / 32)
    normals = np.stack([steepest * np.sin(3 * x + y), steepest * np.cos(2 * y - x), np.ones_like(x)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return light.Image((0.5 + 0.5 * normals).astype(np.float32))


def room(**changes):
    """The scene; changes: of materials by name."""
    squares, walls = cells()
    parts = [quad(c, c + a, c + a + b, c + b) for c, a, b in squares]
    lamp = quad((-0.5, 2.4, -0.5), (0.5, 2.4, -0.5), (0.5, 2.4, 0.5), (-0.5, 2.4, 0.5))
    window = quad((WIDE, LOW, -HALF), (WIDE, LOW, HALF), (WIDE, TOP, HALF), (WIDE, TOP, -HALF))
    glass, metal = (
        outwards(ball(r, 24, 12)).moved(*at) for r, at in ((0.45, (-0.7, 0.6, -0.5)), (0.4, (0.6, 0.5, 0.4)))
    )
    parts += [lamp, window, glass, metal]
    kinds = [0 if wall == 0 else 1 + wall % 2 for wall in walls] + [3, 4, 5, 6]
    whole = join(parts)
    materials = {
        "floor": light.MetallicRoughness((0.6, 0.5, 0.4), specular=0.0, normals=bumps()),
        "walls": light.Lambertian((0.6, 0.6, 0.6)),
        "others": light.Lambertian((0.6, 0.4, 0.3)),
        "lamp": light.Emissive((5.0, 4.5, 4.0)),
        "window": light.MetallicRoughness((0.9, 1.0, 0.9), roughness=0.0, transmission=1.0),
        "glass": light.Dielectric(1.5),
        "metal": light.Metal((0.9, 0.8, 0.6)),
    } | changes
    return light.Scene(
        whole.to_mesh("room"), list(materials.values()), np.repeat(kinds, [part.triangle_count for part in parts]),
        sky=light.constant_sky((4.0, 5.0, 6.0)), uv=whole.vertices[:, [0, 2]] * (0.5, -0.5),
    )  # fmt: skip


CHOSEN = np.random.Generator(np.random.PCG64(64)).choice(len(cells()[0]), PLACES, replace=False)


def cameras():
    """One for each place: a quarter of a cell, from just before it."""
    for corner, across, up in cells()[0][CHOSEN]:
        middle, normal = corner + 0.75 * across + 0.25 * up, np.cross(across, up) / CELL**2
        yield atra.OrthographicCamera(middle + 0.01 * normal, middle, up, CELL / 2, SIDE, SIDE)


def by_pictures(scene):
    """(BATCHES, PLACES, 3) radiance."""
    found = np.empty((BATCHES, PLACES, 3))
    for place, camera in enumerate(cameras()):
        with PathRenderer(scene, camera, threads=1, bounces=BOUNCES, jitter="pixel") as renderer:
            before = 0.0
            for batch in range(BATCHES):
                renderer.add(SAMPLES // SIDE**2)
                so_far = renderer.image.astype(float).mean(axis=(0, 1)) * (batch + 1)
                found[batch, place], before = so_far - before, so_far
    return found


def by_lightmap(scene):
    """The same. Each place is the texel that lies in the right angle of a triangle with legs of two texels."""
    count, width = scene.mesh.triangle_count, 4 * PLACES + 2
    uv, chart = np.full((count, 3, 2), np.nan), np.full(count, UNMAPPED)
    for number, cell in enumerate(CHOSEN):
        uv[2 * cell], chart[2 * cell] = np.array([(0, 0), (2, 0), (2, 2)]) + (4 * number + 2, 2), number
    albedo = np.array([scene.materials[scene.face_materials[2 * cell]].plain for cell in CHOSEN])
    found = np.empty((BATCHES, PLACES, 3))
    with Baker(scene, Atlas(uv, chart, width, 6), threads=1, bounces=BOUNCES - 1) as baker:
        before = 0.0
        for batch in range(BATCHES):
            baker.add(SAMPLES)
            lightmap = baker.maps
            where = np.searchsorted(lightmap.texels.number, 2 * width + 4 * np.arange(PLACES) + 3)
            so_far = lightmap.combined[where].astype(float) * (batch + 1)
            found[batch], before = albedo * (so_far - before), so_far
    return found


def by_mitsuba(scene, variant="scalar_rgb"):
    """The same."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant(variant)
    loaded = mi.load_dict(
        parts_of(mi, scene, material_in_room) | {"integrator": {"type": "path", "max_depth": -1, "rr_depth": 6}}
    )
    found = np.empty((BATCHES, PLACES, 3))
    for place, camera in enumerate(cameras()):
        where = mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up)
        film = {
            "type": "hdrfilm",
            "width": SIDE,
            "height": SIDE,
            "rfilter": {"type": "box"},
            "component_format": "float32",
        }
        sensor = mi.load_dict({
            "type": "orthographic", "to_world": where @ mi.ScalarTransform4f().scale([CELL / 4, CELL / 4, 1.0]),
            "near_clip": 1e-4, "film": film,
        })  # fmt: skip
        for batch in range(BATCHES):
            image = np.array(mi.render(loaded, sensor=sensor, spp=SAMPLES // SIDE**2, seed=batch), float)
            found[batch, place] = image[..., :3].mean(axis=(0, 1))
    return found


def differ(one, other):
    """Whether two sets of batches differ at some place and colour by more than chance allows, at 1 %, or on average."""
    chance = stats.ttest_ind(one, other, equal_var=False).pvalue
    error = np.sqrt((one.mean(axis=1).var(axis=0, ddof=1) + other.mean(axis=1).var(axis=0, ddof=1)) / BATCHES)
    apart = np.abs(one.mean(axis=(0, 1)) - other.mean(axis=(0, 1)))
    return chance.min() < 1 - 0.99 ** (1 / chance.size) or (apart > 4 * error).any()  # Šidák


@pytest.fixture(scope="module")
def pictured():
    return by_pictures(room())


def test_fifty_places_of_a_room_have_the_same_light_in_pictures_and_in_a_lightmap(pictured):
    mapped = by_lightmap(room())
    assert (pictured.mean(axis=0) > 0.03).all()
    assert not differ(pictured, mapped)
    assert differ(0.97 * pictured, mapped)
    assert differ(pictured, by_lightmap(room(floor=light.Lambertian((0.6, 0.5, 0.4)))))


@pytest.mark.skipif(importlib.util.find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed (extra `peers`)")
def test_fifty_places_of_a_room_have_the_light_that_mitsuba_finds_there(pictured):
    theirs = by_mitsuba(room())
    assert not differ(pictured, theirs)
    assert differ(0.97 * pictured, theirs)
