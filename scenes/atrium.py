"""An atrium made of numbers: a stand-in of 262,267 triangles for the paper's Sponza."""

from __future__ import annotations

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import upright_camera
from scenes.shapes import (
    Floats,
    Part,
    ball,
    blades,
    box,
    cloth,
    copies,
    frames,
    join,
    lathe,
    leaf,
    quad,
    ring,
    smooth_profile,
    spread,
    surface,
    tube,
)

ATRIUM_CAMERA = upright_camera((-14.2, 3.3, -0.5), (0.0, 3.5, -0.5), 60.0)
"""Along the length, a little beside the middle."""

_TRIANGLES = 262_267
_BAY = 4.0  # metres between the columns of a row
_BAYS = 8  # along each side
_END_BAYS = 2  # across each end
_HALF_LENGTH = _BAY * _BAYS / 2
_HALF_WIDTH = _BAY * _END_BAYS / 2
_AISLE = 3.5
_FLOOR_2, _SPRING_1, _SPRING_2, _ROOF = 6.0, 3.6, 8.8, 11.2


def atrium() -> Mesh:
    """Two storeys of columns and arches round a covered court, vaulted aisles behind them, curtains and ornaments.

    262,267 triangles; ivy over the balustrade, one triangle a leaf, makes the number exact. y is up, metres; the long
    axis is x.
    Depth complexity from its own camera, square image: a ray of a 32 x 32 grid crosses 6.4 triangles on average
    (the paper's scene, in our estimate of its view: 7.7).
    """
    return planted_court().to_mesh("atrium")


def planted_court() -> Part:
    """The triangles of `atrium`, with what they are made of: keys of `scenes.lit.interiors.COURT`."""
    bays, corners = _bay_frames()
    built = join(
        [
            _hull(),
            _colonnade(),
            _along(_arches().made_of("stone"), bays),
            _along(_balustrade().made_of("marble"), bays),
            _along(_vault().made_of("plaster"), bays),
            _along(_aisle_wall(), bays),
            _along(_ornaments(), bays),
            _along(_curtain(), bays[: 2 * _BAYS]),
            _along(_pot(), bays[: 2 * _BAYS]),
            _along(_corner_vault().made_of("plaster"), corners),
            _lamps(),
        ]
    )
    return join([built, _ivy(_TRIANGLES - built.triangle_count).made_of("leaf")])


def _bay_frames() -> tuple[list[tuple[float, float, float]], list[tuple[float, float, float]]]:
    """(x, z, turn in degrees) of each bay's middle on the column line, the sides first, and of the four corners.

    A bay is modelled along x with the court at +z and the aisle at -z.
    """
    middles = (np.arange(_BAYS) - (_BAYS - 1) / 2) * _BAY
    across = (np.arange(_END_BAYS) - (_END_BAYS - 1) / 2) * _BAY
    sides = [(float(x), -_HALF_WIDTH, 0.0) for x in middles] + [(float(x), _HALF_WIDTH, 180.0) for x in middles]
    ends = [(-_HALF_LENGTH, float(z), 90.0) for z in across] + [(_HALF_LENGTH, float(z), -90.0) for z in across]
    corners = [(x, z, 0.0) for x in (-_HALF_LENGTH, _HALF_LENGTH) for z in (-_HALF_WIDTH, _HALF_WIDTH)]
    return sides + ends, corners


def _along(part: Part, places: list[tuple[float, float, float]]) -> Part:
    return copies(part, [(x, 0.0, z) for x, z, _ in places], frames([turn for _, _, turn in places]))


def _hull() -> Part:
    """Floors, walls, facade and roof as slabs with two sides, and a coffered ceiling over the court.

    The cellar under the floor and the rooms behind the wall are seen by no ray that stops at its first hit, but they
    lie on every ray's way, as such parts do in a model of a whole building.
    """
    x, z, out = _HALF_LENGTH, _HALF_WIDTH, _AISLE
    floor_x, floor_z = np.linspace(-x - out, x + out, 41), np.linspace(-z - out, z + out, 17)
    floor = surface(np.stack(np.broadcast_arrays(floor_x[:, None], 0.0, floor_z), -1))
    outer = [box(2 * (x + out) + 1, 12.6, 0.5).moved(z=side * (z + out + 0.25)) for side in (-1, 1)]
    outer += [box(0.5, 12.6, 2 * (z + out) + 1).moved(side * (x + out + 0.25)) for side in (-1, 1)]
    slabs = []
    for y in (_FLOOR_2 - 0.25, _ROOF):
        slabs += [box(2 * (x + out), 0.25, out).moved(y=y, z=side * (z + out / 2)) for side in (-1, 1)]
        slabs += [box(out, 0.25, 2 * z).moved(side * (x + out / 2), y) for side in (-1, 1)]
    ceiling = box(2 * x + 1, 0.2, 2 * z + 1).moved(y=12.4)
    beams = copies(box(0.3, 0.5, 2 * z), [(at, 11.9, 0) for at in np.linspace(-x, x, 17)])
    ribs = copies(box(2 * x, 0.35, 0.2), [(0, 12.05, at) for at in np.linspace(-z, z, 7)])
    upper = [box(2 * x + 0.6, 1.0, 0.5).moved(y=_ROOF + 0.2, z=side * z) for side in (-1, 1)]
    upper += [box(0.5, 1.0, 2 * z + 0.6).moved(side * x, _ROOF + 0.2) for side in (-1, 1)]
    cellar = box(2 * (x + out), 0.4, 2 * (z + out)).moved(y=-3.4)
    facade = [box(2 * (x + out) + 9, 12.6, 0.6).moved(z=side * (z + out + 4)) for side in (-1, 1)]
    facade += [box(0.6, 12.6, 2 * (z + out) + 9).moved(side * (x + out + 4)) for side in (-1, 1)]
    eaves, ridge = z + out + 5.0, 16.5
    for y in (0.0, 0.3):
        low, high = 12.8 + y, ridge + y
        facade += [
            quad((-x - 9, low, side * eaves), (x + 9, low, side * eaves), (x + 9, high, 0), (-x - 9, high, 0)).made_of(
                "glass"
            )
            for side in (-1, 1)
        ]
    glazing = [ceiling.made_of("glass"), join([beams, ribs]).made_of("iron")]
    return join([floor.made_of("floor"), cellar, *outer, *facade, *slabs, *glazing, *upper]).made_of("plaster")


def _colonnade() -> Part:
    """A column of 1,088 triangles on each storey at every corner of a bay."""
    along, across = np.linspace(-_HALF_LENGTH, _HALF_LENGTH, _BAYS + 1), (0.0,)
    feet = [(x, 0.0, side * _HALF_WIDTH) for x in along for side in (-1, 1)]
    feet += [(side * _HALF_LENGTH, 0.0, z) for z in across for side in (-1, 1)]
    above = [(x, _FLOOR_2, z) for x, _, z in feet]
    below, upper = copies(_column(0.38, _SPRING_1), feet), copies(_column(0.28, _SPRING_2 - _FLOOR_2), above)
    return join([below, upper]).made_of("marble")


def _column(radius: float, height: float) -> Part:
    """Plinth, base, swelling shaft, capital and abacus."""
    r, h = radius, height
    knots = [(1.35 * r, 0.2), (1.35 * r, 0.3), (1.05 * r, 0.42), (r, 0.5), (1.03 * r, 0.4 * h), (0.85 * r, h - 0.65)]
    knots += [(0.98 * r, h - 0.6), (0.86 * r, h - 0.52), (1.25 * r, h - 0.25), (1.4 * r, h - 0.16)]
    shaft = lathe(smooth_profile(knots, 20), 28)
    side = 2.8 * r
    return join([shaft, box(side, 0.2, side), box(side, 0.16, side).moved(y=h - 0.16)])


def _arch(radius: float, spring: float, top: float, half_depth: float) -> Part:
    """A wall over a round arch, one bay wide, with mouldings on both faces: 144 + 2 x 288 triangles."""
    turn = np.linspace(0.0, np.pi, 25)
    away = np.stack([np.cos(turn), np.sin(turn)], 1)
    with np.errstate(divide="ignore"):
        reach = np.minimum(_BAY / 2 / np.abs(away[:, 0]), (top - spring) / np.maximum(away[:, 1], 0.0))
    inner, outer = radius * away, away * reach[:, None]

    def row(points: Floats, z: float) -> Floats:
        return np.stack([points[:, 0], points[:, 1] + spring, np.full(len(points), z)], 1)

    d = half_depth
    wall = surface(np.stack([row(outer, d), row(inner, d), row(inner, -d), row(outer, -d)]))
    bend = row((radius + 0.08) * away, 0.0)
    bars = [tube(bend + (0.0, 0.0, z), 0.07, 6, (0.0, 0.0, 1.0)) for z in (d, -d)]
    return join([wall, *bars])


def _arches() -> Part:
    """Both storeys: one wide arch below, two narrow ones with a slender column between them above."""
    lower = _arch(1.55, _SPRING_1, _FLOOR_2 - 0.25, 0.3)
    upper = _arch(1.7, _SPRING_2, _ROOF + 0.2, 0.22)
    string_course = [box(_BAY, 0.12, 0.75).moved(y=_FLOOR_2 - 0.25), box(_BAY, 0.1, 0.6).moved(y=_ROOF + 0.1)]
    dentils = [(x, y, 0.33) for x in np.linspace(-1.85, 1.85, 10) for y in (_FLOOR_2 - 0.4, _ROOF - 0.05)]
    return join([lower, upper, *string_course, copies(box(0.14, 0.14, 0.14), dentils)])


def _balustrade() -> Part:
    """Nine turned balusters of 176 triangles between rails."""
    knots = [(0.07, 0), (0.07, 0.06), (0.035, 0.1), (0.085, 0.26), (0.03, 0.5), (0.055, 0.58), (0.055, 0.66)]
    baluster = lathe(smooth_profile(knots, 12), 8)
    posts = copies(baluster, [(x, _FLOOR_2 + 0.08, 0.0) for x in np.linspace(-1.5, 1.5, 9)])
    return join([posts, box(3.4, 0.08, 0.26).moved(y=_FLOOR_2), box(3.4, 0.12, 0.3).moved(y=_FLOOR_2 + 0.74)])


def _vault() -> Part:
    """Groin vaults over the aisle of one bay on both storeys, and the wall arch across the aisle."""
    side = np.linspace(-1.0, 1.0, 13)
    u, v = np.meshgrid(side, side)
    rise = np.sqrt(1.0 - np.minimum(np.abs(u), np.abs(v)) ** 2)
    deep = -_AISLE / 2 * (1.0 - v)
    sheets = [
        surface(np.stack([_BAY / 2 * u, spring + height * rise, deep], -1))
        for spring, height in ((_SPRING_1, 1.9), (_SPRING_2, 2.2))
    ]
    turn = np.linspace(0.0, np.pi, 13)
    rib = np.stack([np.full(13, _BAY / 2), _SPRING_1 + 1.85 * np.sin(turn), -_AISLE / 2 * (1 + np.cos(turn))], 1)
    return join([*sheets, tube(rib, 0.1, 6, (1.0, 0.0, 0.0))])


def _corner_vault() -> Part:
    """A flat ceiling of coffers where two aisles meet."""
    bars = copies(box(0.15, 0.15, 3.4), [(x, _FLOOR_2 - 0.4, 0.0) for x in np.linspace(-1.6, 1.6, 5)])
    return join([bars, box(0.9, _FLOOR_2 - 0.25, 0.9), box(0.8, _ROOF - _FLOOR_2, 0.8).moved(y=_FLOOR_2)])


def _aisle_wall() -> Part:
    """What the aisle of one bay shows: a panelled door below, a window with bars and shutters above, pilasters."""
    z = -_AISLE
    pilasters = copies(box(0.35, _SPRING_1, 0.2), [(-1.9, 0, z + 0.1), (1.9, 0, z + 0.1)])
    turn = np.linspace(0.0, np.pi, 17)
    head = tube(np.stack([0.85 * np.cos(turn), 2.2 + 0.85 * np.sin(turn), 0 * turn + z + 0.06], 1), 0.09, 8, (0, 0, 1))
    door = [box(0.12, 2.2, 0.16).moved(x, 0, z + 0.06) for x in (-0.85, 0.85)]
    door += [box(0.72, 0.42, 0.08).moved(x, y, z + 0.04) for x in (-0.4, 0.4) for y in (0.15, 0.65, 1.15, 1.65)]
    bars = [box(0.05, 1.9, 0.05).moved(x, 6.9, z + 0.1) for x in np.linspace(-0.6, 0.6, 5)]
    sill = [box(1.6, 0.12, 0.3).moved(0, 6.78, z + 0.15), box(1.6, 0.15, 0.2).moved(0, 8.8, z + 0.1)]
    slats = copies(box(0.5, 0.015, 0.06), [(x, y, z + 0.1) for x in (-1.1, 1.1) for y in np.linspace(6.95, 8.7, 9)])
    wood = join([*bars, *sill, slats]).made_of("shutter")
    return join([join([pilasters, head]).made_of("stone"), join(door).made_of("door"), wood])


def _ornaments() -> Part:
    """Rosettes and a boss on the wall between the storeys, and a lantern in the aisle."""
    knots = [(0, 0.12), (0.05, 0.11), (0.08, 0.05), (0.14, 0.09), (0.2, 0.03), (0.23, 0.05), (0.26, 0)]
    rosette = lathe(smooth_profile(knots, 12), 16).turned(0.0, lean=90.0)
    roses = copies(rosette, [(x, _FLOOR_2 - 0.85, 0.3) for x in (-1.62, 1.62)])
    boss = join([ball(0.2, 16, 10).scaled(1.0, 1.3, 0.7), ring(0.24, 0.04, 20, 6).turned(0.0, lean=90.0)])
    lantern_knots = [(0, -0.5), (0.06, -0.45), (0.2, -0.3), (0.16, 0), (0.04, 0.1), (0.015, 0.2), (0.015, 0.75)]
    lantern = lathe(smooth_profile(lantern_knots, 14), 14)
    stone = join([roses, boss.moved(y=_SPRING_1 + 1.75, z=0.33)]).made_of("marble")
    return join([stone, lantern.made_of("lantern").moved(y=4.6, z=-_AISLE / 2)])


def _curtain() -> Part:
    """A curtain of 2,400 triangles in half the arch and a banner of 448 below the balustrade."""
    sheet = cloth(1.75, 3.5, 40, 30, 6.0, 0.1).moved(-1.6, 0.25, -0.1)
    banner = cloth(0.9, 1.7, 16, 14, 1.5, 0.05).moved(-0.45, 4.2, 0.5)
    rod = tube([(x, 3.78, -0.1) for x in np.linspace(-1.6, 1.6, 4)], 0.03, 8, (0.0, 1.0, 0.0))
    return join([sheet.made_of("curtain"), banner.made_of("banner"), rod.made_of("iron")])


def _pot() -> Part:
    """A pot with a bush of 40 leaves before the column."""
    knots = [(0.2, 0), (0.16, 0.08), (0.3, 0.35), (0.26, 0.5), (0.34, 0.56), (0.34, 0.62), (0.26, 0.6), (0, 0.52)]
    turn, rise = 360.0 * spread(40, 0), spread(40, 1)
    at = np.stack([0.08 * np.sin(np.radians(turn)), 0.55 + 0.5 * rise, 0.08 * np.cos(np.radians(turn))], 1)
    bush = copies(leaf(0.5, 0.13, 5, 0.6), at, frames(turn, -40.0 * rise, 0.7 + 0.5 * spread(40, 2)))
    pot = lathe(smooth_profile(knots, 16), 20).made_of("clay")
    return join([pot, bush.made_of("leaf")]).moved(_BAY / 2, 0.0, 0.95)


def _lamps() -> Part:
    """Five hanging lamps on chains of links over the court."""
    knots = [(0, -0.6), (0.05, -0.5), (0.25, -0.3), (0.35, 0), (0.33, 0), (0.2, -0.25), (0, -0.35)]
    bowl = lathe(smooth_profile(knots, 20), 28)
    link = ring(0.12, 0.02, 12, 5).scaled(0.6, 1.0, 1.3).turned(0.0, lean=90.0)
    count = 22
    high = np.linspace(0.45, 5.9, count)
    chain = copies(link, np.stack([0 * high, high, 0 * high], 1), frames(90.0 * (np.arange(count) % 2)))
    stays = [tube([(0.34 * c, 0, 0.34 * s), (0.17 * c, 0.2, 0.17 * s), (0, 0.4, 0)], 0.01, 5, (-s, 0, c))
             for c, s in ((1.0, 0.0), (-0.5, 0.866025), (-0.5, -0.866025))]  # fmt: skip
    globe = ball(0.15, 16, 10).moved(y=-0.12)
    lamp = join([join([bowl, chain, *stays]).made_of("brass"), globe.made_of("globe")])
    return copies(lamp, [(x, 6.1, 0.0) for x in (-8.0, -4.0, 0.0, 4.0, 8.0, 12.0)])


def _ivy(leaves: int) -> Part:
    """Exactly `leaves` single triangles that hang in garlands from the upper floor along both sides."""
    side = np.where(np.arange(leaves) % 2, 1.0, -1.0)
    x = (2 * spread(leaves, 0) - 1) * _HALF_LENGTH
    within = np.abs(np.modf(x / _BAY + _BAYS)[0] - 0.5) * 2.0  # 1 at a column, 0 in the middle of a bay
    drop = 1.3 * within**3 * spread(leaves, 1)
    z = side * (_HALF_WIDTH - 0.42 - 0.1 * spread(leaves, 2))
    feet = np.stack([x, _FLOOR_2 + 0.05 - drop, z], 1)
    return blades(feet, 0.06, -0.09 - 0.05 * spread(leaves, 3))
