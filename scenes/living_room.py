"""A living room made of numbers: a stand-in of 143,173 triangles for the paper's Fireplace room."""

from __future__ import annotations

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import upright_camera
from scenes.shapes import (
    Part,
    ball,
    blades,
    box,
    cloth,
    copies,
    cushion,
    frames,
    join,
    lathe,
    leaf,
    quad,
    ring,
    smooth_profile,
    spread,
    tube,
)

LIVING_ROOM_CAMERA = upright_camera((2.55, 1.35, 2.0), (-0.7, 0.75, -0.75), 58.0)
"""From the corner by the door across the room."""

_TRIANGLES = 143_173
_X, _Y, _Z = 2.8, 2.7, 2.2  # half width, height, half length of the room
_SILL, _LINTEL, _WINDOW_Z = 0.85, 2.25, 1.15  # the window in the wall x = -_X
_RUG = (-0.75, 0.1, 1.0, 0.75)  # x, z of its middle, half sizes


def living_room() -> Mesh:
    """A furnished room seen from inside: few large walls, and most triangles in small things.

    143,173 triangles; the pile of the rug, one triangle a tuft, makes the number exact. y is up, metres.
    Depth complexity from its own camera, square image: a ray of a 32 x 32 grid crosses 2.9 triangles on average
    (the paper's scene, in Bitterli's view of it: 1.6, as its furniture has fewer sides that nobody sees).
    """
    return furnished_room().to_mesh("living_room")


def furnished_room() -> Part:
    """The triangles of `living_room`, with what they are made of: keys of `scenes.lit.interiors.ROOM`."""
    furnished = join([
        _walls(),
        _window(),
        _curtains(),
        _fireplace(),
        _pictures(),
        _shelves(),
        _sofa().turned(90.0).moved(-2.2, 0.0, 0.1),
        _armchair().turned(-60.0).moved(0.95, 0.0, -0.25),
        _table().moved(_RUG[0], 0.0, _RUG[1]),
        _plant(150).moved(-2.25, 0.0, -1.7),
        _plant(110).scaled(0.6, 0.6, 0.6).moved(2.25, 0.0, -1.75),
        _floor_lamp().moved(-2.35, 0.0, 1.65),
        _pendant().moved(_RUG[0], 0.0, _RUG[1]),
    ])  # fmt: skip
    return join([furnished, _rug(_TRIANGLES - furnished.triangle_count)])


def _walls() -> Part:
    x, y, z, w = _X, _Y, _Z, _WINDOW_Z
    whole = [
        quad((-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z)).made_of("floor"),
        quad((-x, y, -z), (x, y, -z), (x, y, z), (-x, y, z)).made_of("white"),
        quad((-x, 0, -z), (x, 0, -z), (x, y, -z), (-x, y, -z)),
        quad((x, 0, z), (-x, 0, z), (-x, y, z), (x, y, z)),
        quad((x, 0, -z), (x, 0, z), (x, y, z), (x, y, -z)),
    ]
    pierced = [
        quad((-x, 0, z), (-x, 0, -z), (-x, _SILL, -z), (-x, _SILL, z)),
        quad((-x, _LINTEL, z), (-x, _LINTEL, -z), (-x, y, -z), (-x, y, z)),
        quad((-x, _SILL, z), (-x, _SILL, w), (-x, _LINTEL, w), (-x, _LINTEL, z)),
        quad((-x, _SILL, -w), (-x, _SILL, -z), (-x, _LINTEL, -z), (-x, _LINTEL, -w)),
    ]
    skirting = [
        box(2 * x, 0.1, 0.02).moved(z=-z + 0.01),
        box(0.02, 0.1, 2 * z).moved(-x + 0.01),
        box(0.02, 0.1, 2 * z).moved(x - 0.01),
        box(2 * x, 0.08, 0.06).moved(y=y - 0.08, z=-z + 0.03),
        box(0.06, 0.08, 2 * z).moved(-x + 0.03, y - 0.08),
    ]
    return join([join([*whole, *pierced]).made_of("wall"), join(skirting).made_of("white")])


def _window() -> Part:
    """Frame, bars and a pane that closes the opening, so that no ray leaves the room."""
    height, w = _LINTEL - _SILL, _WINDOW_Z
    bars = [box(0.04, height, 0.04).moved(z=at) for at in np.linspace(-w, w, 5)]
    rungs = [box(0.04, 0.04, 2 * w).moved(y=at) for at in np.linspace(0.0, height - 0.04, 4)]
    pane = quad((-0.15, 0, w), (-0.15, 0, -w), (-0.15, height, -w), (-0.15, height, w)).made_of("pane")
    reveal = [
        quad((0, 0, w), (0, 0, -w), (-0.15, 0, -w), (-0.15, 0, w)),
        quad((0, height, w), (0, height, -w), (-0.15, height, -w), (-0.15, height, w)),
        quad((0, 0, w), (-0.15, 0, w), (-0.15, height, w), (0, height, w)),
        quad((0, 0, -w), (-0.15, 0, -w), (-0.15, height, -w), (0, height, -w)),
    ]
    sill = box(0.22, 0.04, 2 * w + 0.2).moved(0.08, -0.04)
    return join([*bars, *rungs, pane, *reveal, sill]).made_of("white").moved(-_X, _SILL)


def _curtains() -> Part:
    """Two sheets beside the window, 2 x 7,680 triangles, on a rod with rings."""
    sheet = cloth(0.62, 2.36, 80, 48, 6.5, 0.055).turned(90.0)
    at = [(-_X + 0.16, 0.04, -_WINDOW_Z + 0.25), (-_X + 0.16, 0.04, _WINDOW_Z + 0.37)]
    rod = tube([(-_X + 0.16, 2.46, z) for z in np.linspace(-1.75, 1.75, 5)], 0.015, 12, (0.0, 1.0, 0.0))
    hoop = Part(ring(0.026, 0.005, 16, 6).vertices[:, [0, 2, 1]], ring(0.026, 0.005, 16, 6).faces)
    hoops = [(-_X + 0.16, 2.436, z0 - step) for _, _, z0 in at for step in np.linspace(0.03, 0.59, 8)]
    return join([copies(sheet, at).made_of("curtain"), join([rod, copies(hoop, hoops)]).made_of("brass")])


def _fireplace() -> Part:
    """Chimney breast with a dark opening, mantel, columns, logs, and things on the mantel."""
    cheeks = [box(0.35, 1.15, 0.4).moved(side * 0.6) for side in (-1, 1)]
    lintel = box(1.55, 0.35, 0.4).moved(y=0.9)
    breast = [*cheeks, lintel, _open_backed(1.3, _Y - 1.25, 0.3).moved(y=1.25, z=-0.05)]
    mantel = [box(1.8, 0.07, 0.55).moved(y=1.25, z=0.06), box(1.7, 0.05, 0.5).moved(y=1.2, z=0.04)]
    hearth = box(1.7, 0.05, 0.9).moved(z=0.2)
    profile = smooth_profile([(0.09, 0), (0.09, 0.1), (0.055, 0.14), (0.05, 0.95), (0.08, 1.05), (0.08, 1.15)], 25)
    columns = copies(lathe(profile, 24), [(-0.66, 0.05, 0.25), (0.66, 0.05, 0.25)])
    log = lathe(smooth_profile([(0, 0), (0.06, 0), (0.055, 0.5), (0, 0.5)], 13), 16)
    laid = Part((log.vertices - (0, 0.25, 0))[:, [1, 0, 2]], log.faces)
    turn = np.array([0.0, 12.0, -15.0, 30.0, -28.0])
    places = [(0, 0.11, 0.0), (0.02, 0.11, 0.13), (-0.02, 0.21, 0.06), (0, 0.3, 0.02), (0.04, 0.3, 0.1)]
    logs = copies(laid, places, frames(turn)).made_of("log")
    vase_at = [(x, 1.32, 0.12) for x in (-0.75, -0.6, 0.62, 0.77)]
    vases = copies(_vase(24, 22).made_of("blue"), vase_at, frames(0, 0, [0.8, 0.5, 0.6, 1]))
    clock = [box(0.3, 0.04, 0.14), cushion(0.22, 0.26, 0.1, 8, 0.25).moved(y=0.04), ring(0.07, 0.01, 32, 8)]
    clock[2] = clock[2].turned(0.0, lean=90.0).moved(y=0.18, z=0.06)
    candles = copies(lathe([(0.02, 0), (0.02, 0.2), (0.0, 0.21)], 16), [(x, 1.32, 0.16) for x in (-0.35, -0.27, 0.32)])
    things = [logs, vases, join(clock).moved(y=1.32, z=0.1).made_of("brass"), candles.made_of("wax")]
    stone = [join(breast).made_of("brick"), join(mantel).made_of("walnut"), hearth.made_of("slate")]
    return join([*stone, columns.made_of("white"), *things]).moved(-0.75, 0.0, -_Z + 0.2)


def _open_backed(x: float, y: float, z: float) -> Part:
    """A box without the sides that wall, floor and ceiling hide: 6 triangles."""
    w, d = x / 2, z / 2
    front = quad((-w, 0, d), (w, 0, d), (w, y, d), (-w, y, d))
    sides = [quad((at, 0, -d), (at, 0, d), (at, y, d), (at, y, -d)) for at in (-w, w)]
    return join([front, *sides])


def _pictures() -> Part:
    def framed(width: float, height: float) -> list[Part]:
        bars = [box(width, 0.05, 0.04).moved(y=y) for y in (0.0, height - 0.05)]
        posts = [box(0.05, height, 0.04).moved(x) for x in (-width / 2 + 0.025, width / 2 - 0.025)]
        canvas = box(width - 0.05, height - 0.05, 0.01).moved(y=0.025).made_of("canvas")
        return [join([*bars, *posts]).made_of("walnut"), canvas]

    over_mantel = join(framed(0.9, 0.75)).moved(-0.75, 1.62, -_Z + 0.33)
    beside = [join(framed(0.42, 0.55)).moved(-2.1, y, -_Z + 0.03) for y in (1.2, 1.85)]
    return join([over_mantel, *beside])


def _vase(segments: int, points: int) -> Part:
    """A vase with an inside: segments * (2 * points - 4) triangles, 0.24 m tall."""
    knots = [(0, 0), (0.05, 0), (0.085, 0.1), (0.035, 0.19), (0.05, 0.24), (0.042, 0.24)]
    knots += [(0.028, 0.19), (0.07, 0.1), (0, 0.02)]
    return lathe(smooth_profile(knots, points), segments)


def _shelves() -> Part:
    """A case of 5 x 2 boards by the fireplace: books, vases, bowls and balls."""
    width, height, depth, levels = 1.9, 2.3, 0.34, 6
    case = [box(0.04, height, depth).moved(x) for x in (-width / 2, 0.0, width / 2)]
    case += [box(width, 0.035, depth).moved(y=y) for y in np.linspace(0.0, height - 0.035, levels)]
    base = np.linspace(0.0, height - 0.035, levels)[:-1] + 0.035
    books, things = [], []
    for row, y in enumerate(base):
        for half in (0, 1):
            left, room = -width / 2 + 0.03 + half * width / 2, width / 2 - 0.06
            if (row + half) % 3 == 1:
                things.append(_things(row).moved(left + room / 2, y))
            else:
                books.append(_books(room, 7 * row + half).moved(left, y, -0.02))
    return join([join(case).made_of("oak"), *books, *things]).moved(1.35, 0.0, -_Z + depth / 2 + 0.02)


def _books(room: float, first: int) -> Part:
    """A row of books with swollen backs filling about `room` metres; `first` picks their sizes."""
    count = 17
    size = spread(count + first, 1)[first:], spread(count + first, 2)[first:], spread(count + first, 0)[first:]
    thick = (0.6 + 0.8 * size[0]) * room / count * 0.97
    left = np.cumsum(thick) - thick
    scale = np.zeros((count, 3, 3))
    scale[:, 0, 0], scale[:, 1, 1], scale[:, 2, 2] = thick, 0.2 + 0.1 * size[1], 0.19 + 0.07 * size[2]
    book = cushion(0.96, 1.0, 1.0, 3, 0.06).moved(x=0.5)
    keep = left + thick < room
    at = np.stack([left, np.zeros(count), np.zeros(count)], 1)
    colours = np.array(["green", "red", "wax", "blue", "walnut"])[(np.arange(count) * 7 + first) % 5]
    return copies(book, at[keep], scale[keep]).made_of(np.repeat(colours[keep], book.triangle_count))


def _things(row: int) -> Part:
    """Vases, a bowl of balls, a ring: one shelf of ornaments."""
    bowl_knots = [(0, 0), (0.05, 0), (0.11, 0.07), (0.105, 0.07), (0.045, 0.01), (0, 0.01)]
    bowl = lathe(smooth_profile(bowl_knots, 18), 28)
    turn = np.arange(5) * 72.0
    fruit = [(0.055 * np.cos(np.radians(t)), 0.06, 0.055 * np.sin(np.radians(t))) for t in turn] + [(0, 0.1, 0)]
    dish = join([bowl.made_of("porcelain"), copies(ball(0.034, 20, 10), fruit).made_of("fruit")])
    vases = copies(_vase(28, 24), [(-0.3, 0, 0), (-0.12, 0, 0.03)], frames(0, 0, [1.1 + 0.1 * (row % 3), 0.7]))
    standing_ring = ring(0.09, 0.02, 36, 14).turned(35.0, lean=90.0).moved(0.36, 0.11)
    return join([dish.moved(0.13, 0, 0.02), vases.made_of("blue"), standing_ring.made_of("brass")])


def _sofa() -> Part:
    """Length along x, looking along +z: frame, arms, three seats, three backs, four loose cushions, feet."""
    seats = copies(cushion(0.62, 0.2, 0.72, 10, 0.14), [(x, 0.26, 0.04) for x in (-0.63, 0.0, 0.63)])
    backs = copies(
        cushion(0.62, 0.48, 0.22, 10, 0.2), [(x, 0.44, -0.25) for x in (-0.63, 0.0, 0.63)], frames([0] * 3, -10)
    )
    arms = copies(cushion(0.22, 0.6, 0.92, 11, 0.16), [(-1.06, 0.06, 0.0), (1.06, 0.06, 0.0)])
    loose_at = [(-0.75, 0.44, -0.02), (-0.42, 0.44, 0.0), (0.5, 0.44, 0.0), (0.8, 0.44, -0.03)]
    loose = copies(cushion(0.4, 0.4, 0.15, 11, 0.4), loose_at, frames([15, -10, 20, -15], [-22, -28, -25, -20]))
    body = [box(2.0, 0.2, 0.85).moved(y=0.08), cushion(2.2, 0.72, 0.16, 8, 0.1).moved(y=0.08, z=-0.42)]
    foot = copies(lathe([(0.02, 0), (0.035, 0.08)], 12), [(x, 0, z) for x in (-1, 1) for z in (-0.35, 0.35)])
    return join([seats, backs, arms, loose.made_of("mustard"), *body, foot.made_of("walnut")]).made_of("linen")


def _armchair() -> Part:
    seat = cushion(0.62, 0.2, 0.66, 12, 0.15).moved(y=0.26, z=0.03)
    back = cushion(0.66, 0.62, 0.2, 12, 0.2).turned(0.0, lean=-12.0).moved(y=0.3, z=-0.32)
    arms = copies(cushion(0.16, 0.52, 0.76, 11, 0.15), [(-0.4, 0.08, 0), (0.4, 0.08, 0)])
    feet = copies(lathe([(0.02, 0), (0.03, 0.12)], 12), [(x, 0, z) for x in (-0.36, 0.36) for z in (-0.3, 0.3)])
    return join([seat, back, arms, box(0.7, 0.16, 0.68).moved(y=0.1), feet.made_of("walnut")]).made_of("leather")


def _table() -> Part:
    """A low table with turned legs, laid with cups, a teapot, a bowl of fruit and books."""
    top = [box(1.15, 0.04, 0.65).moved(y=0.4), box(1.0, 0.06, 0.5).moved(y=0.34)]
    leg_knots = [(0.02, 0), (0.03, 0.06), (0.018, 0.1), (0.035, 0.2), (0.02, 0.27), (0.03, 0.34)]
    legs = copies(lathe(smooth_profile(leg_knots, 21), 20), [(x, 0, z) for x in (-0.46, 0.46) for z in (-0.21, 0.21)])
    cup_knots = [(0, 0.005), (0.07, 0.012), (0.03, 0.015), (0.045, 0.07), (0.04, 0.07), (0.0, 0.02)]
    handle = ring(0.02, 0.005, 20, 8).turned(0.0, lean=90.0).moved(0.055, 0.045)
    cup = join([lathe(smooth_profile(cup_knots, 24), 32), handle])
    cup_at = [(-0.42, 0.44, 0.2), (-0.15, 0.44, 0.24), (0.3, 0.44, 0.2), (0.42, 0.44, -0.15)]
    cups = copies(cup, cup_at, frames([20, 140, 260, 80]))
    pot_knots = [(0, 0), (0.07, 0), (0.1, 0.07), (0.06, 0.14), (0.03, 0.15), (0.012, 0.165), (0.016, 0.185), (0, 0.19)]
    spout = tube([(0.09, 0.06, 0), (0.12, 0.08, 0), (0.14, 0.11, 0), (0.16, 0.14, 0)], 0.012, 12, (0.0, 0.0, 1.0))
    grip = ring(0.045, 0.008, 28, 10).turned(0.0, lean=90.0).moved(-0.1, 0.085)
    teapot = join([lathe(smooth_profile(pot_knots, 36), 40), spout, grip]).turned(30.0).moved(0.05, 0.44, 0.03)
    dish = join([_things(1)]).scaled(0.95, 0.95, 0.95).moved(-0.35, 0.44, -0.12)
    books = copies(box(0.26, 0.025, 0.18), [(0.3, 0.44 + 0.026 * i, -0.08) for i in range(3)], frames([5, 14, -6]))
    china = join([cups, teapot]).made_of("porcelain")
    return join([join([*top, legs]).made_of("walnut"), china, dish, books.made_of("red")])


def _plant(leaves: int) -> Part:
    """A pot with `leaves` arching leaves of 28 triangles on stems."""
    pot_knots = [(0, 0), (0.15, 0), (0.19, 0.3), (0.21, 0.32), (0.21, 0.36), (0.18, 0.36), (0.17, 0.32), (0, 0.32)]
    pot = lathe(smooth_profile(pot_knots, 26), 36)
    turn, rise = 360.0 * spread(leaves, 0), spread(leaves, 1)
    place = np.radians(turn)
    out = 0.04 + 0.13 * spread(leaves, 2)
    at = np.stack([out * np.sin(place), 0.36 + 1.0 * rise**0.8, out * np.cos(place)], 1)
    foliage = copies(leaf(0.5, 0.11, 8, 0.75), at, frames(turn, -35.0 * rise + 10.0, 0.75 + 0.4 * spread(leaves, 3)))
    stem = tube([(0, y, 0.02 * np.sin(4 * y)) for y in np.linspace(0.3, 1.38, 9)], 0.012, 8, (1.0, 0.0, 0.0))
    stems = copies(stem, [(0.05 * np.cos(a), 0, 0.05 * np.sin(a)) for a in np.arange(5) * 1.2566])
    return join([pot.made_of("clay"), foliage.made_of("leaf"), stems.made_of("leaf")])


def _floor_lamp() -> Part:
    foot = lathe([(0, 0), (0.16, 0), (0.16, 0.02), (0.02, 0.05), (0.012, 0.1), (0.012, 1.5), (0, 1.5)], 24)
    shade = lathe([(0.22, 1.35), (0.14, 1.68), (0.135, 1.68), (0.215, 1.35)], 48)
    return join([foot.made_of("brass"), shade.made_of("shade"), ball(0.05, 20, 12).moved(y=1.52).made_of("bulb")])


def _pendant() -> Part:
    """A chandelier: hub, eight arms with candles, and strings of beads between them."""
    hub_knots = [(0, 1.95), (0.05, 2.0), (0.03, 2.06), (0.07, 2.12), (0.015, 2.2), (0.015, _Y), (0, _Y)]
    hub = lathe(smooth_profile(hub_knots, 40), 28)
    turn = np.linspace(0.0, np.pi, 17)
    arm = tube(
        np.stack([0.22 - 0.2 * np.cos(turn), 2.08 - 0.09 * np.sin(turn), 0 * turn], 1), 0.008, 10, (0.0, 0.0, 1.0)
    )
    cup = lathe([(0, 2.08), (0.035, 2.1), (0.04, 2.12), (0.012, 2.12), (0.012, 2.21), (0, 2.22)], 16).moved(x=0.42)
    cup = cup.made_of(np.repeat(["brass", "wax", "flame"], [cup.triangle_count - 48, 32, 16]))
    eight = np.arange(8) * 45.0
    arms = copies(join([arm, cup]), np.zeros((8, 3)), frames(eight))
    t = np.linspace(0.0, 1.0, 15)[:-1]
    corner = np.radians(eight)
    here, there = (0.42 * np.stack([np.cos(a), 0 * a, np.sin(a)], 1) for a in (corner, corner + np.pi / 4))
    beads = here[:, None] * (1 - t)[:, None] + there[:, None] * t[:, None]
    beads[..., 1] = 2.09 - 0.32 * t * (1 - t)
    strings = copies(ball(0.011, 8, 5), beads.reshape(-1, 3)).made_of("porcelain")
    return join([join([hub, arms]).made_of("brass"), strings])


def _rug(triangles: int) -> Part:
    """A rug of exactly `triangles`: a flat box and one tuft for every further triangle."""
    x, z, half_x, half_z = _RUG
    flat = box(2 * half_x, 0.01, 2 * half_z).moved(x, 0.0, z)
    count = triangles - flat.triangle_count
    across, along = (2 * spread(count, 0) - 1) * half_x, (2 * spread(count, 2) - 1) * half_z
    feet = np.stack([x + across, np.full(count, 0.01), z + along], 1)
    tufts = blades(feet, 0.014, 0.022 + 0.012 * spread(count, 1))
    edge = np.minimum(half_x - np.abs(across), half_z - np.abs(along))
    return join([flat.made_of("wool"), tufts.made_of(np.where((edge > 0.07) & (edge < 0.13), "red", "wool"))])
