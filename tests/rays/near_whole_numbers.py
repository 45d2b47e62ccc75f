"""The nearest hit of a ray among some triangles, and what it touches, as whole numbers: float64 times powers of 2."""

from __future__ import annotations

from fractions import Fraction
from math import ldexp

import numpy as np


def shift_of(*arrays):
    """The power of two that makes whole numbers of all."""
    least = min(float(np.abs(array[array != 0]).min(initial=1.0)) for array in arrays)
    return 53 - int(np.frexp(least)[1])


def whole(numbers, shift):
    return [int(ldexp(x, shift)) for x in numbers]


def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _side(d, at, way, major):
    """The side of an edge, which starts at `at` as seen from the ray's origin, that the ray passes on; of a ray through
    it that of one moved by (e, e^2) along the axes after the major one."""
    found = _dot(d, _cross(at, way))
    for step in (1, 2):
        if found == 0:
            m, n = (major + step + 1) % 3, (major + step + 2) % 3
            found = d[m] * way[n] - d[n] * way[m]
    return (found > 0) - (found < 0)


class ExactRay:
    """A ray and the triangles of a mesh, (F, 3, 3) float64 corners, in whole numbers.

    shifts: `shift_of` corners and origins, and of directions.
    """

    def __init__(self, corners, origin, direction, shifts):
        self._corners = corners
        self._shift, self._other = shifts
        self._o, self._d = whole(origin.tolist(), self._shift), whole(direction.tolist(), self._other)
        sizes = [abs(x) for x in self._d]
        self._major = sizes.index(max(sizes))

    def _placed(self, face):
        a, b, c = (_minus(whole(corner, self._shift), self._o) for corner in self._corners[face].tolist())
        normal = _cross(_minus(b, a), _minus(c, a))
        return (a, b, c), _dot(normal, a), _dot(normal, self._d)

    def _parameter(self, ahead, facing):
        scale = self._other - self._shift
        return Fraction(ahead << max(scale, 0), facing << max(-scale, 0))

    def crosses(self, face):
        """t of the triangle that the ray crosses by the tie rule, at 0 or more; None: it does not."""
        (a, b, c), ahead, facing = self._placed(face)
        if facing == 0 or (ahead != 0 and (ahead > 0) != (facing > 0)):
            return None
        sign = 0
        for p, q in ((a, b), (b, c), (c, a)):
            found = _side(self._d, p, _minus(q, p), self._major)
            if found == 0 or found == -sign:
                return None
            sign = found
        return self._parameter(ahead, facing)

    def touches(self, face):
        """t of the triangle where the ray meets it anywhere, edges and corners included; None: it does not."""
        (a, b, c), ahead, facing = self._placed(face)
        if facing == 0 or (ahead != 0 and (ahead > 0) != (facing > 0)):
            return None
        sides = [_dot(self._d, _cross(p, q)) for p, q in ((a, b), (b, c), (c, a))]
        if min(sides) < 0 < max(sides):
            return None
        return self._parameter(ahead, facing)

    def nearest(self, faces):
        """(t, face) of the nearest hit among some triangles, in ascending order; None: there is none."""
        best = None
        for face in faces:
            t = self.crosses(face)
            if t is not None and (best is None or t < best[0]):
                best = t, face
        return best


def exact_ray(corners, origin, direction):
    """A ray and triangles, (F, 3, 3), of any float32 or float64 numbers."""
    corners, origin, direction = (np.asarray(one, np.float64) for one in (corners, origin, direction))
    return ExactRay(corners, origin, direction, (shift_of(corners, origin), shift_of(direction)))


def hits_without_rounding(mesh, origin, direction, tnear=0.0, tfar=np.inf):
    """(t, prim_id) of all hits of a ray, the nearest first, of equally near ones the lowest prim_id."""
    ray = exact_ray(mesh.triangles(np.arange(mesh.triangle_count)), origin, direction)
    found = ((ray.crosses(prim_id), prim_id) for prim_id in range(mesh.triangle_count))
    near, far = Fraction(float(tnear)), None if tfar == np.inf else Fraction(float(tfar))
    return sorted((t, prim_id) for t, prim_id in found if t is not None and near <= t and (far is None or t < far))


def crosses(corners, origin, direction):
    """Whether a ray crosses a triangle, (3, 3)."""
    return exact_ray(corners[None], origin, direction).crosses(0) is not None
