"""Kernels of lenses: where a direction is seen on the sensor, and which direction a place on the sensor sees.

A lens first maps a direction to a plane (u, v), by tan(theta) (perspective) or by theta (fisheye) of the angle theta to
the view axis. Then it distorts the plane: radially, tangentially, by a thin prism and by a tilted sensor. (a, b) are
sensor coordinates: pixels from the principal point over the focal length. NaN stands for no ray.
"""

from __future__ import annotations

from math import asin, atan, atan2, cos, hypot, pi, sin, sqrt, tan

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.lenses.folds_kernels import along_radius, is_before_fold, polynomial
from atra.geometry.lenses.lens_numbers import EQUIDISTANT, EQUIRECTANGULAR, FIELD_OF_VIEW, PERSPECTIVE

_NARROWEST = 4e-16
"""Relative change of a radius at which Newton's method ends."""

_STEPS = 60
"""Upper limit of Newton's steps; quadratic convergence needs about six, halvings of the bracket at most 55."""

_ACCEPTED = 2e-14
"""Largest difference between a place on the sensor and the one that its direction is projected to, relative to 1 + its
distance from the axis."""

_HALVINGS = 12
"""Upper limit of halvings of one of Newton's steps in the plane."""

_STARTS = 4
"""Places along the radius from which the inverse is sought where the first start fails."""


@njit(error_model="numpy")
def _distorted(lens, u, v):  # type: ignore[no-untyped-def]
    """(u, v) after all but the tilt of the sensor."""
    q = u * u + v * v
    factor = polynomial(lens.over, q) / polynomial(lens.under, q)
    if lens.is_radial:
        return u * factor, v * factor
    uv = 2.0 * u * v
    return (
        u * factor + lens.p1 * uv + lens.p2 * (q + 2.0 * u * u) + q * (lens.s1 + lens.s2 * q),
        v * factor + lens.p2 * uv + lens.p1 * (q + 2.0 * v * v) + q * (lens.s3 + lens.s4 * q),
    )


@njit(error_model="numpy")
def _jacobian(lens, u, v):  # type: ignore[no-untyped-def]
    """The derivative of `_distorted`: of the first by u and v, of the second by u and v."""
    r = hypot(u, v)
    c, s = (u / r, v / r) if r > 0.0 else (1.0, 0.0)
    q, under = r * r, polynomial(lens.under, r * r)
    factor, slope = polynomial(lens.over, q) / under, polynomial(lens.rise, q) / (under * under)
    uu, uv, vu, vv = along_radius(lens, c, s)
    both, cubed = c * s * (slope - factor), r * q
    return (
        s * s * factor + c * c * slope + uu[0] * r + uu[1] * cubed,
        both + uv[0] * r + uv[1] * cubed,
        both + vu[0] * r + vu[1] * cubed,
        c * c * factor + s * s * slope + vv[0] * r + vv[1] * cubed,
    )


@njit(error_model="numpy")
def _moved(homography, a, b):  # type: ignore[no-untyped-def]
    """(a, b) under a homography; NaN for what it sends to infinity or beyond."""
    m = homography
    w = m[2, 0] * a + m[2, 1] * b + m[2, 2]
    if not w > 0.0:
        return np.nan, np.nan
    return (m[0, 0] * a + m[0, 1] * b + m[0, 2]) / w, (m[1, 0] * a + m[1, 1] * b + m[1, 2]) / w


@njit(error_model="numpy")
def _radius_of(lens, distorted):  # type: ignore[no-untyped-def]
    """The r that a radial lens moves to `distorted`, before the fold; NaN if there is none.

    Newton's method within a bracket that halves where Newton's step leaves it.
    """
    low, high = 0.0, lens.surely
    highest = high * polynomial(lens.over, high * high) / polynomial(lens.under, high * high)
    if not distorted <= highest:
        return np.nan
    r = min(distorted, high)
    for _ in range(_STEPS):
        q, under = r * r, polynomial(lens.under, r * r)
        off = r * polynomial(lens.over, q) / under - distorted
        if off > 0.0:
            high = r
        else:
            low = r
        slope = polynomial(lens.rise, q) / (under * under)
        following = r - off / slope if slope > 0.0 else np.inf
        if not low <= following <= high:
            following = 0.5 * (low + high)
        if abs(following - r) <= _NARROWEST * r:
            return following
        r = following
    return r


@njit(error_model="numpy")
def _approach(lens, a, b, u, v, accepted):  # type: ignore[no-untyped-def]
    """Newton's method for `_distorted`(u, v) = (a, b), from a start before the fold; steps are halved until they come
    nearer and stay where the Jacobian's determinant is positive. Returns (u, v) and the distance that is left; up to
    `accepted` a step that comes no nearer is not halved."""
    x, y = _distorted(lens, u, v)
    left = hypot(x - a, y - b)
    for _ in range(_STEPS):
        j11, j12, j21, j22 = _jacobian(lens, u, v)
        determinant = j11 * j22 - j12 * j21
        step_u, step_v = (j22 * (a - x) - j12 * (b - y)) / determinant, (j11 * (b - y) - j21 * (a - x)) / determinant
        came_nearer = False
        for _halving in range(_HALVINGS):
            at_u, at_v = u + step_u, v + step_v
            at_x, at_y = _distorted(lens, at_u, at_v)
            k11, k12, k21, k22 = _jacobian(lens, at_u, at_v)
            if hypot(at_x - a, at_y - b) < left and k11 * k22 > k12 * k21:
                u, v, x, y, left = at_u, at_v, at_x, at_y, hypot(at_x - a, at_y - b)
                came_nearer = True
                break
            if left <= accepted:
                break
            step_u, step_v = 0.5 * step_u, 0.5 * step_v
        if not came_nearer:
            break
    return u, v, left


@njit(error_model="numpy")
def _undistorted(lens, a, b):  # type: ignore[no-untyped-def]
    """The inverse of `_distorted` and of the tilt; NaN where the lens folds before it gets there."""
    if lens.is_tilted:
        a, b = _moved(lens.untilt, a, b)
    distance = hypot(a, b)
    if not distance > 0.0:
        return a, b  # the axis, or NaN
    if lens.is_radial:
        scale = _radius_of(lens, distance) / distance
        return a * scale, b * scale
    if distance > lens.farthest:
        return np.nan, np.nan
    accepted = _ACCEPTED * (1.0 + distance)
    reach = min(distance, lens.surely)
    for start in range(_STARTS + 1):  # the first at the place itself, the others along its radius
        share = reach / distance if start == 0 else reach / distance * (1.0 - (start - 1.0) / _STARTS)
        u, v, left = _approach(lens, a, b, a * share, b * share, accepted)
        if left <= accepted:
            return (u, v) if is_before_fold(lens, u, v) else (np.nan, np.nan)
    return np.nan, np.nan


@njit(error_model="numpy")
def direction_at(lens, a, b):  # type: ignore[no-untyped-def]
    """The direction that sensor coordinates (a, b) see: X, Y, Z, with Z = 1 for perspective lenses, otherwise of unit
    length; NaN for none."""
    if lens.kind == EQUIRECTANGULAR:
        if not (abs(a) <= pi and abs(b) <= 0.5 * pi):
            return np.nan, np.nan, np.nan
        return cos(b) * sin(a), sin(b), cos(b) * cos(a)
    if lens.kind == FIELD_OF_VIEW:
        distorted = hypot(a, b)
        if not distorted * lens.omega < 0.5 * pi:
            return np.nan, np.nan, np.nan
        scale = 1.0
        if distorted > 0.0:
            scale = tan(distorted * lens.omega) / (2.0 * tan(0.5 * lens.omega)) / distorted
        return a * scale, b * scale, 1.0
    u, v = _undistorted(lens, a, b)
    if lens.kind == PERSPECTIVE:
        return u, v, 1.0 + 0.0 * u  # NaN where u is
    theta = hypot(u, v)
    if not theta > 0.0:
        return u, v, 1.0 + 0.0 * u
    scale = sin(theta) / theta
    return u * scale, v * scale, cos(theta)


@njit(error_model="numpy")
def place_of(lens, x, y, z):  # type: ignore[no-untyped-def]
    """The sensor coordinates at which a direction in camera space is seen; NaN where it is not."""
    across = hypot(x, y)
    if lens.kind == EQUIRECTANGULAR:
        length = sqrt(across * across + z * z)
        if not length > 0.0:
            return np.nan, np.nan
        longitude = atan2(x, z)
        return (longitude if longitude < pi else -pi), asin(y / length)  # what is behind is at the left border
    if lens.kind == EQUIDISTANT:
        if not (across > 0.0 or z > 0.0):
            return np.nan, np.nan
        scale = atan2(across, z) / across if across > 0.0 else 1.0 / z
        u, v = x * scale, y * scale
    elif z > 0.0:
        u, v = x / z, y / z
    else:
        return np.nan, np.nan
    if lens.kind == FIELD_OF_VIEW:
        r, wide = hypot(u, v), 2.0 * tan(0.5 * lens.omega)
        scale = atan(r * wide) / (lens.omega * r) if r > 0.0 else wide / lens.omega
        return u * scale, v * scale
    if not is_before_fold(lens, u, v):
        return np.nan, np.nan
    a, b = _distorted(lens, u, v)
    if lens.is_tilted:
        a, b = _moved(lens.tilt, a, b)
    return a, b


@kernel
def distort(lens, planes, distorted):  # type: ignore[no-untyped-def]
    """`_distorted` of every (u, v), (N, 2) float64 each."""
    for i in range(len(planes)):
        distorted[i, 0], distorted[i, 1] = _distorted(lens, planes[i, 0], planes[i, 1])


@kernel
def see(lens, a, b, directions):  # type: ignore[no-untyped-def]
    """directions[i] = what sensor coordinates (a[i], b[i]) see. a, b: (N,), directions: (N, 3) float64."""
    for i in range(len(a)):
        directions[i, 0], directions[i, 1], directions[i, 2] = direction_at(lens, a[i], b[i])


@kernel
def place(lens, points, places):  # type: ignore[no-untyped-def]
    """places[i] = the sensor coordinates of points[i]. points: (N, 3), places: (N, 2) float64, camera space."""
    for i in range(len(points)):
        places[i, 0], places[i, 1] = place_of(lens, points[i, 0], points[i, 1], points[i, 2])


@kernel
def fill_directions(counter_address, lens, columns, rows, directions):  # type: ignore[no-untyped-def]
    """Write the direction of every pixel of an image, in camera space; threads share its rows.

    columns: (W,), rows: (H,) float64, sensor coordinates. directions: (3, H, W) float64; NaN for pixels without a ray.
    """
    while True:
        y = fetch_add(counter_address, 1)
        if y >= len(rows):
            return
        for x in range(len(columns)):
            directions[0, y, x], directions[1, y, x], directions[2, y, x] = direction_at(lens, columns[x], rows[y])


@kernel
def turn_directions(counter_address, directions, turn, table):  # type: ignore[no-untyped-def]
    """Write directions (3, H, W) float64, turned by (3, 3) float64, to a table of float32; threads share its rows."""
    while True:
        y = fetch_add(counter_address, 1)
        if y >= directions.shape[1]:
            return
        for x in range(directions.shape[2]):
            a, b, c = directions[0, y, x], directions[1, y, x], directions[2, y, x]
            for axis in range(3):
                table[axis, y, x] = turn[axis, 0] * a + turn[axis, 1] * b + turn[axis, 2] * c
