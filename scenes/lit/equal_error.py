"""Scenes on which path tracers are compared by time to equal error: lamps, a window, glass, a panorama, many lamps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.light import Dielectric, Emissive, Lambertian, Metal, MetallicRoughness, PanoramaSky, Scene, constant_sky
from scenes.cornell_box import CORNELL_BOX_CAMERA
from scenes.lit.rooms import lit_cornell_box
from scenes.lit.weekend import WEEKEND_CAMERA, outwards, weekend
from scenes.shapes import Part, ball, join, quad

Shown = tuple[Scene, Camera]

_LAMP = slice(10, 12)
"""Triangles of the built-in box's lamp."""


def box_with_lamp(half: float) -> Shown:
    """The built-in box with a lamp of another half width, of the same power."""
    scene = lit_cornell_box()
    vertices, faces = scene.mesh.vertices.copy(), scene.mesh.faces
    corners = np.unique(faces[_LAMP])
    before = float(np.abs(vertices[corners, 0]).max())
    vertices[corners] *= np.array([half / before, 1.0, half / before], np.float32)
    lamp = scene.materials[3]
    shining = Emissive(tuple(channel * (before / half) ** 2 for channel in lamp.emission))  # type: ignore[arg-type]
    scene = replace(scene, mesh=Mesh(vertices, faces), materials=(*scene.materials[:3], shining))
    return scene, Camera(**CORNELL_BOX_CAMERA, width=96, height=96)


def room_with_window() -> Shown:
    """A closed room of 4 x 2.5 x 4 whose only light is that of the sky through a window."""
    w, h, low, high, half = 2.0, 2.5, 0.9, 2.0, 0.6
    walls = [
        quad((-w, 0, w), (w, 0, w), (w, 0, -w), (-w, 0, -w)),
        quad((-w, h, -w), (w, h, -w), (w, h, w), (-w, h, w)),
        quad((-w, 0, -w), (w, 0, -w), (w, h, -w), (-w, h, -w)),
        quad((w, 0, w), (-w, 0, w), (-w, h, w), (w, h, w)),
        quad((-w, 0, w), (-w, 0, -w), (-w, h, -w), (-w, h, w)),
        quad((w, 0, -w), (w, 0, w), (w, low, w), (w, low, -w)),
        quad((w, high, -w), (w, high, w), (w, h, w), (w, h, -w)),
        quad((w, low, -w), (w, low, -half), (w, high, -half), (w, high, -w)),
        quad((w, low, half), (w, low, w), (w, high, w), (w, high, half)),
        outwards(ball(0.5, 32, 16)).moved(x=-0.5, y=0.5, z=-0.8),
    ]
    scene = Scene(join(walls).to_mesh("room"), [Lambertian((0.7, 0.65, 0.6))], sky=constant_sky((2.0, 2.4, 3.0)))
    return scene, Camera((-1.7, 1.5, 1.7), (0.6, 0.9, -1.0), fov_y_degrees=60, width=96, height=96)


def plain_weekend() -> Shown:
    """The book's scene without fuzz, chequers, smooth normals and a sky of two colours."""
    scene = weekend(segments=12)
    plain = [Lambertian((0.5, 0.6, 0.5)), *scene.materials[1:]]
    plain = [Metal(one.colour) if isinstance(one, Metal) else one for one in plain]
    shown = replace(scene, materials=plain, sky=constant_sky((0.6, 0.7, 1.0)), normals=None, uv=None, lights=())
    return shown, Camera(**WEEKEND_CAMERA, width=144, height=96)


def _on_a_floor(parts: list[Part], materials: Sequence[object], sky: object) -> Scene:
    floor = quad((-6, 0, 6), (6, 0, 6), (6, 0, -6), (-6, 0, -6))
    whole = [floor, *parts]
    numbers = np.repeat(np.arange(len(whole)), [part.triangle_count for part in whole])
    return Scene(join(whole).to_mesh("balls"), materials, numbers, sky=sky)  # type: ignore[arg-type]


def balls_of_metal_and_glass() -> Shown:
    """Two balls, of rough metal and of clear glass, beneath a lamp and a dim sky."""
    lamp = quad((-1, 4, -1), (1, 4, -1), (1, 4, 1), (-1, 4, 1))
    balls = [outwards(ball(1.0, 64, 32)).moved(x=x, y=1.01) for x in (-1.1, 1.1)]
    metal = MetallicRoughness((1.0, 1.0, 1.0), metallic=1.0, roughness=0.4)
    scene = _on_a_floor(
        [*balls, lamp], [Lambertian((0.5, 0.4, 0.3)), metal, Dielectric(1.5), Emissive((12.0, 11.0, 9.0))],
        constant_sky((0.1, 0.12, 0.15)),
    )  # fmt: skip
    return scene, Camera((0.0, 2.6, 6.0), (0.0, 0.9, 0.0), fov_y_degrees=36, width=144, height=96)


def model_in_a_panorama() -> Shown:
    """Balls of metal and paint beneath a panorama with a small, soft sun."""
    y, x = np.mgrid[:64, :128]
    height, turn = np.cos((y + 0.5) * np.pi / 64), (x + 0.5) * 2 * np.pi / 128
    across = np.sqrt(1 - height**2)
    away = np.arccos(np.clip(0.7 * height + 0.714 * across * np.cos(turn - 2.0), -1, 1))
    texels = (
        0.3 + 0.3 * height[..., None] * np.array([0.2, 0.5, 1.0]) + 150.0 * np.exp(-((away / 0.12) ** 2))[..., None]
    )
    balls = [outwards(ball(1.0, 64, 32)).moved(x=x, y=1.01) for x in (-1.1, 1.1)]
    metal = MetallicRoughness((1.0, 1.0, 1.0), metallic=1.0, roughness=0.5)
    materials = [Lambertian((0.5, 0.5, 0.5)), metal, Lambertian((0.7, 0.3, 0.2))]
    scene = _on_a_floor(balls, materials, PanoramaSky(texels.astype(np.float32)))
    return scene, Camera((0.0, 2.6, 6.0), (0.0, 0.9, 0.0), fov_y_degrees=36, width=144, height=96)


def thousand_lamps() -> Shown:
    """A floor with balls beneath 1,000 small square lamps of different colours, at different heights."""
    places = np.random.Generator(np.random.PCG64(7)).random((1000, 6))
    lamps = []
    for x, y, z, *_ in places * (11.0, 1.5, 11.0, 1, 1, 1) - (5.5, -1.5, 5.5, 0, 0, 0):
        s = 0.03
        lamps.append(quad((x - s, y, z - s), (x + s, y, z - s), (x + s, y, z + s), (x - s, y, z + s)))
    balls = [outwards(ball(0.6, 32, 16)).moved(x=x, y=0.6, z=z) for x, z in ((-1.5, 0.0), (0.3, 1.0), (1.6, -0.6))]
    floor = quad((-6, 0, 6), (6, 0, 6), (6, 0, -6), (-6, 0, -6))
    grey = [floor, *balls]
    counts = [sum(part.triangle_count for part in grey), *(part.triangle_count for part in lamps)]
    numbers = np.repeat(1 + np.arange(len(lamps) + 1) % 8, counts).astype(np.int32)
    numbers[: counts[0]] = 0
    colours = 20.0 + 60.0 * np.random.Generator(np.random.PCG64(8)).random((8, 3))
    materials = [Lambertian((0.6, 0.6, 0.6)), *(Emissive(tuple(one.tolist())) for one in colours)]
    scene = Scene(join([*grey, *lamps]).to_mesh("lamps"), materials, numbers, sky=constant_sky(0.0))
    return scene, Camera((0.0, 2.2, 6.0), (0.0, 0.4, 0.0), fov_y_degrees=40, width=144, height=96)


SCENES: dict[str, Callable[[], Shown]] = {
    "box, lamp 0.24": lambda: box_with_lamp(0.24),
    "box, lamp 0.05": lambda: box_with_lamp(0.05),
    "room with window": room_with_window,
    "weekend": plain_weekend,
    "metal and glass": balls_of_metal_and_glass,
    "panorama": model_in_a_panorama,
    "1,000 lamps": thousand_lamps,
}
