"""The fold of a lens: the border up to which its distortion is one-to-one, found by interval arithmetic.

The distortion is one-to-one around the view axis up to the fold: along each radius, the first place where the
determinant of its Jacobian is 0. Beyond it the model shows directions a second time, and no lens does so.
"""

from __future__ import annotations

from math import hypot

from atra.compiled.store import kernel, njit

FINEST = 1e-4
"""Width of an interval, relative to its place, below which a fold and its end are not told from none."""


@njit(error_model="numpy")
def polynomial(coefficients, q):  # type: ignore[no-untyped-def]
    value = 0.0
    for place in range(len(coefficients) - 1, -1, -1):
        value = value * q + coefficients[place]
    return value


@njit(error_model="numpy")
def _range(coefficients, low, high):  # type: ignore[no-untyped-def]
    """Bounds of a polynomial between two numbers that are not negative."""
    least = most = 0.0
    of_low = of_high = 1.0
    for coefficient in coefficients:
        least += coefficient * (of_low if coefficient > 0.0 else of_high)
        most += coefficient * (of_high if coefficient > 0.0 else of_low)
        of_low, of_high = of_low * low, of_high * high
    return least, most


@njit(error_model="numpy")
def _times(number, interval):  # type: ignore[no-untyped-def]
    a, b = number * interval[0], number * interval[1]
    return min(a, b), max(a, b)


@njit(error_model="numpy")
def _product(a, b):  # type: ignore[no-untyped-def]
    w, x, y, z = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
    return min(w, x, y, z), max(w, x, y, z)


@njit(error_model="numpy")
def along_radius(lens, c, s):  # type: ignore[no-untyped-def]
    """Factors of r and of r^3 in the four entries of the Jacobian, at the angle with cosine c and sine s."""
    across = 2.0 * (lens.p1 * c + lens.p2 * s)
    return (
        (2.0 * lens.p1 * s + 6.0 * lens.p2 * c + 2.0 * c * lens.s1, 4.0 * c * lens.s2),
        (across + 2.0 * s * lens.s1, 4.0 * s * lens.s2),
        (across + 2.0 * c * lens.s3, 4.0 * c * lens.s4),
        (6.0 * lens.p1 * s + 2.0 * lens.p2 * c + 2.0 * s * lens.s3, 4.0 * s * lens.s4),
    )


@njit(error_model="numpy")
def _bend(lens, c, s):  # type: ignore[no-untyped-def]
    """What is not radial in the determinant along a radius: with B r + B' r^3 the part of the Jacobian that is not, the
    entries of B and B' along the radius (twice two), across it, and the coefficients of r^2 and r^4 in det B."""
    uu, uv, vu, vv = along_radius(lens, c, s)
    cc, cs, ss = c * c, c * s, s * s
    return (
        cc * uu[0] + cs * (uv[0] + vu[0]) + ss * vv[0],
        cc * uu[1] + cs * (uv[1] + vu[1]) + ss * vv[1],
        ss * uu[0] - cs * (uv[0] + vu[0]) + cc * vv[0],
        ss * uu[1] - cs * (uv[1] + vu[1]) + cc * vv[1],
        uu[0] * vv[0] - uv[0] * vu[0],
        uu[0] * vv[1] + uu[1] * vv[0] - uv[0] * vu[1] - uv[1] * vu[0],
    )


@njit(error_model="numpy")
def _is_regular(lens, bend, low, high):  # type: ignore[no-untyped-def]
    """Whether the determinant of the Jacobian is positive all along a radius between two r; by interval arithmetic, so
    True is certain, and False may mean that the interval is too wide."""
    q_low, q_high = low * low, high * high
    if not _range(lens.under, q_low, q_high)[0] > 0.0:
        return False
    if lens.is_radial:
        return _range(lens.over, q_low, q_high)[0] > 0.0 and _range(lens.rise, q_low, q_high)[0] > 0.0
    r, cubed, fourth = (low, high), (low * q_low, high * q_high), (q_low * q_low, q_high * q_high)
    along, along_3 = _times(bend[0], r), _times(bend[1], cubed)
    across, across_3 = _times(bend[2], r), _times(bend[3], cubed)
    both, both_4 = _times(bend[4], (q_low, q_high)), _times(bend[5], fourth)
    parts = lens.parts
    return (
        _range(parts[0], q_low, q_high)[0]
        + _product(_range(parts[1], q_low, q_high), (along[0] + along_3[0], along[1] + along_3[1]))[0]
        + _product(_range(parts[2], q_low, q_high), (across[0] + across_3[0], across[1] + across_3[1]))[0]
        + _product(_range(parts[3], q_low, q_high), (both[0] + both_4[0], both[1] + both_4[1]))[0]
    ) > 0.0


@njit(error_model="numpy")
def _first_fold(lens, c, s, far):  # type: ignore[no-untyped-def]
    """The first r along a radius at which the lens folds, or `far` where it does not before.

    Intervals without a fold are passed over, as wide as can be proved. Where one would be narrower than FINEST its end
    is tested alone, and the fold is found by halving.
    """
    bend = _bend(lens, c, s)
    start, width = 0.0, far
    while start < far:
        end, finest = min(start + width, far), FINEST * max(start, FINEST)
        if _is_regular(lens, bend, start, end):
            start, width = end, 2.0 * width
        elif width > finest:
            width *= 0.5
        elif _is_regular(lens, bend, end, end):
            start = end
        else:
            while True:
                middle = 0.5 * (start + end)
                if not start < middle < end:
                    return start
                if _is_regular(lens, bend, middle, middle):
                    start = middle
                else:
                    end = middle
    return far


@kernel
def find_folds(lens, cosines, sines, folds):  # type: ignore[no-untyped-def]
    """folds[i] = r of the first fold at angle i; (N,) float64 each; the lens's limit where there is none."""
    for i in range(len(folds)):
        folds[i] = _first_fold(lens, cosines[i], sines[i], lens.limit)


@njit(error_model="numpy")
def is_before_fold(lens, u, v):  # type: ignore[no-untyped-def]
    r = hypot(u, v)
    if r <= lens.surely:
        return True
    if lens.is_radial or not r < lens.limit:
        return False
    return bool(_first_fold(lens, u / r, v / r, r) >= r)
