"""Light beside Mitsuba 3's paths: tiles of pictures, a wall of a lightmap, and 50 places of a room in both. The room
has a window of thin glass, a lamp, a ball of glass, one of metal and a floor of many normals."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import atra
from atra import light
from atra.light import Atlas, Baker
from atra.light.lightmaps.charts.unwrap import UNMAPPED
from atra.light.tables import unit_normals
from experiments.light.mitsuba_light import parts_of
from scenes.atrium import ATRIUM_CAMERA, atrium
from scenes.lit.rooms import lit_cornell_box
from scenes.lit.weekend import WEEKEND_CAMERA, outwards, weekend
from scenes.shapes import ball, join, quad
from tests.light.mitsuba_materials import material_in_room
from tests.shown import batches

needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed (extra `peers`)"
)
BATCHES, TILE = 8, 8


def by_mitsuba(scene, cameras, samples, count=BATCHES, **integrator):
    """(count, cameras, H, W, 3): pictures of so many samples each, their seeds 0, 1, 2, ..."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    paths = {"integrator": {"type": "path", "rr_depth": 10_000} | integrator}
    loaded = mi.load_dict(parts_of(mi, scene, material_in_room) | paths)
    sensors = []
    for camera in cameras:
        place = mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up)
        if camera.is_parallel:
            half = camera.view_height * camera.width / camera.height / 2
            view = {"type": "orthographic", "to_world": place @ mi.ScalarTransform4f().scale([half, half, 1.0])}
        else:
            view = {"type": "perspective", "to_world": place, "fov": camera.fov_y_degrees, "fov_axis": "y"}
        film = {"type": "hdrfilm", "width": camera.width, "height": camera.height, "component_format": "float32"}
        sensors.append(mi.load_dict(view | {"near_clip": 1e-4, "film": film | {"rfilter": {"type": "box"}}}))
    return np.array([
        [np.array(mi.render(loaded, sensor=sensor, spp=samples, seed=seed))[..., :3] for sensor in sensors]
        for seed in range(count)
    ], float)  # fmt: skip


def differ(one, other):
    """Whether two sets of batches differ at some place and colour by more than chance allows, at 1 %, or on average."""
    chance = stats.ttest_ind(one, other, equal_var=False).pvalue
    error = np.sqrt((one.mean(axis=1).var(axis=0, ddof=1) + other.mean(axis=1).var(axis=0, ddof=1)) / BATCHES)
    apart = np.abs(one.mean(axis=(0, 1)) - other.mean(axis=(0, 1)))
    return np.nanmin(chance) < 1 - 0.99 ** (1 / chance.size) or (apart > 4 * error + 1e-6).any()  # Šidák


def book():
    """The weekend's scene without fuzz, chequers and a sky of two colours, which Mitsuba's plain materials have not."""
    scene = weekend(segments=8)
    plain = [light.Lambertian((0.5, 0.6, 0.5)), *scene.materials[1:]]
    plain = [light.Metal(one.colour) if isinstance(one, light.Metal) else one for one in plain]
    shown = replace(scene, materials=plain, sky=light.constant_sky((0.6, 0.7, 1.0)), normals=None, uv=None, lights=())
    return shown, atra.Camera(**WEEKEND_CAMERA, width=48, height=32)


def hall():
    """The atrium, whose upper parts shine."""
    mesh = atrium()
    heights = mesh.vertices[mesh.faces][:, :, 1].mean(axis=1)
    materials = [light.Lambertian((0.7, 0.6, 0.5)), light.Emissive((1.0, 0.9, 0.8))]
    numbers = (heights > 0.55 * heights.max()).astype(int)
    scene = light.Scene(mesh, materials, numbers, sky=light.constant_sky(0.0))
    return scene, atra.Camera(**ATRIUM_CAMERA, width=32, height=24)


@needs_mitsuba
@pytest.mark.parametrize("make", [book, hall])
def test_no_tile_differs_from_mitsuba_s_more_than_chance_allows(make):
    scene, camera = make()
    ours = batches(scene, camera, BATCHES, 16, bounces=3, jitter="pixel")
    theirs = by_mitsuba(scene, [camera], 16, max_depth=4)[:, 0]
    cut = (BATCHES, camera.height // TILE, TILE, camera.width // TILE, TILE, 3)
    ours, theirs = (one.reshape(cut).mean(axis=(2, 4)).reshape(BATCHES, -1, 3) for one in (ours, theirs))
    noisy = ((ours.std(axis=0) > 1e-5) | (theirs.std(axis=0) > 1e-5)).any(axis=1)  # the others show the sky alone
    np.testing.assert_allclose(ours.mean(axis=0)[~noisy], theirs.mean(axis=0)[~noisy], rtol=1e-5)
    assert noisy.mean() > 0.7
    assert not differ(ours[:, noisy], theirs[:, noisy])
    assert differ(0.9 * ours[:, noisy], theirs[:, noisy])


@needs_mitsuba
def test_a_wall_of_the_cornell_box_has_mitsuba_s_light_within_three_thousandths():
    scene, wall, texels = lit_cornell_box(), slice(6, 8), 16
    count = scene.mesh.triangle_count
    uv, chart = np.full((count, 3, 2), np.nan), np.full(count, UNMAPPED)
    corners = 1 + texels * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    uv[wall], chart[wall] = corners[[[0, 1, 2], [0, 2, 3]]], 0
    with Baker(scene, Atlas(uv, chart, texels + 2, texels + 2), threads=1, bounces=3) as baker:
        baker.add(2048)
        lightmap = baker.maps
    assert len(lightmap.texels) == texels**2
    a, b, c = scene.mesh.vertices[scene.mesh.faces[wall.start]].astype(float)
    middle, width, height = (a + c) / 2, np.linalg.norm(b - a), np.linalg.norm(c - b)
    eye = middle + 0.05 * unit_normals(scene.mesh)[wall.start]
    before = atra.OrthographicCamera(eye, middle, c - b, height, round(100 * width), round(100 * height))
    theirs = by_mitsuba(scene, [before], 2, 16, max_depth=5).mean(axis=(1, 2, 3, 4))
    albedo = scene.materials[scene.face_materials[wall.start]].colour
    ours = (lightmap.combined * albedo).mean()
    spread = theirs.std(ddof=1) / np.sqrt(len(theirs))
    assert spread < 0.001 * ours
    assert abs(ours / theirs.mean() - 1) < 0.003


CELL, PLACES, SIDE = 0.25, 50, 16
SAMPLES, BOUNCES = 1024, 24

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
    for number, (corner, across, up) in enumerate(np.array(WALLS, float)):
        columns, rows = (round(float(np.linalg.norm(side) / CELL)) for side in (across, up))
        for row, column in np.ndindex(rows, columns):
            found.append((corner + column / columns * across + row / rows * up, across / columns, up / rows))
            walls.append(number)
    return np.array(found), np.array(walls)


CELLS, WALL_OF = cells()
CHOSEN = np.random.Generator(np.random.PCG64(64)).choice(len(CELLS), PLACES, replace=False)


def bumps(steepest=0.2):
    """Waves, as an image of normals. Steep ones scatter light below the floor, which Mitsuba drops, and ours mirrors
    (`on_side`); of these it drops about a hundredth."""
    y, x = np.mgrid[:32, :32] * (2 * np.pi / 32)
    normals = np.stack([steepest * np.sin(3 * x + y), steepest * np.cos(2 * y - x), np.ones_like(x)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return light.Image((0.5 + 0.5 * normals).astype(np.float32))


def room(**changes):
    """The scene; changes: of materials by name."""
    lamp = quad((-0.5, 2.4, -0.5), (0.5, 2.4, -0.5), (0.5, 2.4, 0.5), (-0.5, 2.4, 0.5))
    window = quad((WIDE, LOW, -HALF), (WIDE, LOW, HALF), (WIDE, TOP, HALF), (WIDE, TOP, -HALF))
    glass, metal = (
        outwards(ball(r, 24, 12)).moved(*at) for r, at in ((0.45, (-0.7, 0.6, -0.5)), (0.4, (0.6, 0.5, 0.4)))
    )
    parts = [*(quad(c, c + a, c + a + b, c + b) for c, a, b in CELLS), lamp, window, glass, metal]
    kinds = [*np.where(WALL_OF == 0, 0, 1 + WALL_OF % 2), 3, 4, 5, 6]
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


def cameras():
    """One for each place: a quarter of a cell, from just before it."""
    for corner, across, up in CELLS[CHOSEN]:
        middle, normal = corner + 0.75 * across + 0.25 * up, np.cross(across, up) / CELL**2
        yield atra.OrthographicCamera(middle + 0.01 * normal, middle, up, CELL / 2, SIDE, SIDE)


def by_lightmap(scene):
    """(BATCHES, PLACES, 3). Each place is the texel in the right angle of a triangle with legs of two texels."""
    count, width = scene.mesh.triangle_count, 4 * PLACES + 2
    uv, chart = np.full((count, 3, 2), np.nan), np.full(count, UNMAPPED)
    for number, cell in enumerate(CHOSEN):
        uv[2 * cell], chart[2 * cell] = np.array([(0, 0), (2, 0), (2, 2)]) + (4 * number + 2, 2), number
    albedo = np.array([scene.materials[scene.face_materials[2 * cell]].plain for cell in CHOSEN])
    sums = []
    with Baker(scene, Atlas(uv, chart, width, 6), threads=1, bounces=BOUNCES - 1) as baker:
        for batch in range(1, BATCHES + 1):
            baker.add(SAMPLES)
            where = np.searchsorted(baker.texels.number, 2 * width + 4 * np.arange(PLACES) + 3)
            sums.append(batch * baker.maps.combined[where].astype(float))
    return albedo * np.diff(sums, axis=0, prepend=0.0)


@pytest.fixture(scope="module")
def pictured():
    """(BATCHES, PLACES, 3)"""
    options = {"bounces": BOUNCES, "jitter": "pixel"}
    seen = [batches(room(), camera, BATCHES, SAMPLES // SIDE**2, **options) for camera in cameras()]
    return np.mean(seen, axis=(2, 3)).swapaxes(0, 1)


def test_fifty_places_of_a_room_have_the_same_light_in_pictures_and_in_a_lightmap(pictured):
    mapped = by_lightmap(room())
    assert (pictured.mean(axis=0) > 0.03).all()
    assert not differ(pictured, mapped)
    assert differ(0.97 * pictured, mapped)
    assert differ(pictured, by_lightmap(room(floor=light.Lambertian((0.6, 0.5, 0.4)))))


@needs_mitsuba
def test_fifty_places_of_a_room_have_the_light_that_mitsuba_finds_there(pictured):
    theirs = by_mitsuba(room(), cameras(), SAMPLES // SIDE**2, max_depth=-1, rr_depth=6).mean(axis=(2, 3))
    assert not differ(pictured, theirs)
    assert differ(0.97 * pictured, theirs)
