"""Rays and their hits: what a batch is made of, and what is found."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.exact.intersection import intersect_rays
from atra.geometry.mesh import Mesh, unit_normals
from atra.geometry.ray_space import FARTHEST_FROM_EYE
from atra.prim_ids import MISS
from atra.rays.geometries import Geometries
from atra.rays.rays_kernels import first_unfit

_DOUBLE_BYTES = 8

SHORTEST, LONGEST = 1e-20, 1e20
"""Sizes of a direction's largest component that are traced: float32 then has room for the t of every hit."""

SMALLEST = 2.0**-149
"""float32's smallest number. Products of smaller ones, which float64 has, would leave the range of exact sums."""

_LATEST = 1e38
"""A parameter beyond that of any hit: the farthest origin and mesh, with the shortest direction, give 1e32."""


@dataclass(frozen=True, eq=False)
class Rays:
    """N rays in world space, each from `tnear` to `tfar`; the point at t is origin + t direction.

    origins: (N, 3), scene units. directions: (N, 3), of any length from 1e-20 to 1e20. tnear, tfar: (N,), or a number
    for all, in lengths of the direction: 0 or more, and anything, inf included. A ray hits what lies from tnear on up
    to, not including, tfar; where tfar is not above tnear it hits nothing.

    Any real array-like is copied. All arrays are float64 where origins or directions are given so, and float32
    otherwise; C-contiguous, private copies and read-only. Numbers below 1.4e-45 in size, float32's smallest, become 0,
    a tnear beyond 1e38 becomes that, and a tfar beyond it inf.
    Raises InputError for a wrong shape or dtype, and naming the first ray, and its value, with: an origin that is not
    finite, or beyond 1e11 in size; a direction that is not finite, or zero, or of another length; a tnear that is not
    finite, or negative; a tfar that is NaN.
    """

    origins: NDArray[np.floating]
    directions: NDArray[np.floating]
    tnear: NDArray[np.floating] = 0.0  # type: ignore[assignment]
    tfar: NDArray[np.floating] = np.inf  # type: ignore[assignment]

    def __post_init__(self) -> None:
        origins, directions = _vectors("origins", self.origins), _vectors("directions", self.directions)
        if len(origins) != len(directions):
            raise InputError(f"there are {len(origins)} origins and {len(directions)} directions, expected as many")
        tnear, tfar = _numbers("tnear", self.tnear, len(origins)), _numbers("tfar", self.tfar, len(origins))
        _check("tnear", tnear, (tnear >= 0.0) & (tnear < np.inf), "a finite number of at least 0")
        _check("tfar", tfar, ~np.isnan(tfar), "a number (inf: no limit; not above tnear: the ray hits nothing)")
        tnear, tfar = np.broadcast_to(tnear, len(origins)), np.broadcast_to(tfar, len(origins))
        given = {"origins": origins, "directions": directions, "tnear": tnear, "tfar": tfar}
        kind = np.float64 if max(origins.dtype.itemsize, directions.dtype.itemsize) >= _DOUBLE_BYTES else np.float32
        with np.errstate(over="ignore", under="ignore"):  # a tfar beyond float32 is inf, and means the same
            copies: dict[str, NDArray[Any]] = {name: np.array(array, kind, order="C") for name, array in given.items()}
        near, far = copies["tnear"], copies["tfar"]
        near[near < SMALLEST], far[np.abs(far) < SMALLEST] = 0.0, 0.0
        near[near > _LATEST], far[far > _LATEST] = _LATEST, np.inf
        for name, low, high, expected in (
            ("origins", 0.0, FARTHEST_FROM_EYE, f"finite numbers of at most {FARTHEST_FROM_EYE:g} in size"),
            (
                "directions",
                SHORTEST,
                LONGEST,
                f"finite numbers, the largest of a size from {SHORTEST:g} to {LONGEST:g}",
            ),
        ):
            ray = first_unfit(copies[name], kind(low), kind(high), kind(SMALLEST))
            if ray < len(origins):
                raise _refusal(name.removesuffix("s"), given[name], ray, expected)
        for name, copied in copies.items():
            copied.setflags(write=False)
            object.__setattr__(self, name, copied)

    def __len__(self) -> int:
        return len(self.origins)

    def counted_from(self, origin: NDArray[np.float64]) -> Rays:
        """The same rays in float64 with origins that count from `origin`, (3,) float64."""
        moved = object.__new__(Rays)
        numbers = self.origins - origin, self.directions, self.tnear, self.tfar
        arrays = (np.ascontiguousarray(array, np.float64) for array in numbers)
        moved.__setstate__(dict(zip(("origins", "directions", "tnear", "tfar"), arrays, strict=True)))
        return moved

    def as_float32(self) -> Rays:
        """The same rays rounded to float32, as Embree takes them."""
        if self.origins.dtype == np.float32:
            return self
        with np.errstate(over="ignore", under="ignore"):
            kept = (self.origins, self.directions, self.tnear, self.tfar)
            return Rays(*(array.astype(np.float32) for array in kept))

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Copies and unpickled arrays can be written to, whatever the original was.
        self.__dict__.update(state)
        for array in (self.origins, self.directions, self.tnear, self.tfar):
            array.setflags(write=False)


@dataclass(frozen=True, eq=False)
class RayHits:
    """The closest hit of every ray of a batch.

    All arrays have the leading shape of the rays as given, (N,) for `Rays`.
    t: float32, in lengths of the ray's direction, inf = miss.
    prim_id: uint32 in the mesh's own numbering, `MISS` (0xFFFFFFFF) = miss.
    rays, mesh: what was traced; the properties are computed from them when first asked for. geometries: of a scene of
    several meshes, which are joined to `mesh`.
    """

    t: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    rays: Rays = field(repr=False)
    mesh: Mesh = field(repr=False)
    geometries: Geometries | None = field(default=None, repr=False)
    traced_id: NDArray[np.uint32] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """bool, True where the ray hits."""
        return self.prim_id != MISS

    @property
    def geometry_id(self) -> NDArray[np.uint32]:
        """uint32, which of the scene's meshes is hit, `MISS` = miss."""
        if self.geometries is None or self.traced_id is None:
            return np.where(self.hit, np.uint32(0), MISS)
        return self.geometries.geometry_ids(self.traced_id)

    @property
    def u(self) -> NDArray[np.float32]:
        """float32 barycentric weight of the triangle's second vertex, NaN = miss."""
        return self._barycentric[0]

    @property
    def v(self) -> NDArray[np.float32]:
        """float32 barycentric weight of the triangle's third vertex, NaN = miss."""
        return self._barycentric[1]

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(..., 3) float64, places of the hits on their triangles, scene units; NaN = miss. Where a ray lies all but in
        the plane of its triangle, the place at t."""
        points = np.full((*self.t.shape, 3), np.nan)
        hit = self.hit
        corners = self.mesh.local.triangles(self._named[hit])
        found = intersect_rays(self.mesh, *self._lines(hit), self._named[hit])
        edges = corners[:, 1:] - corners[:, :1]
        on_plane = corners[:, 0] + found.u[:, None] * edges[:, 0] + found.v[:, None] * edges[:, 1]
        origins, directions = self._lines(hit)
        along = origins + self.t[hit].astype(np.float64)[:, None] * directions
        points[hit] = np.where(np.isnan(found.u)[:, None], along, on_plane + self.mesh.origin)
        return points

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(..., 3) float64, unit normals of the triangles hit, towards where their corners are counterclockwise; NaN =
        miss."""
        normals = np.full((*self.t.shape, 3), np.nan)
        normals[self.hit] = unit_normals(self.mesh, self._named[self.hit])
        return normals

    @property
    def _named(self) -> NDArray[np.uint32]:
        """The triangles in the numbering of `mesh`."""
        return self.prim_id if self.traced_id is None else self.traced_id

    def _lines(self, hit: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        one = hit.reshape(-1)
        return self.rays.origins[one].astype(np.float64), self.rays.directions[one].astype(np.float64)

    @cached_property
    def _barycentric(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        u, v = np.full(self.t.shape, np.nan, np.float32), np.full(self.t.shape, np.nan, np.float32)
        hit = self.hit
        found = intersect_rays(self.mesh, *self._lines(hit), self._named[hit])
        u[hit], v[hit] = found.u, found.v
        return (u, v) if self.geometries is None else self.geometries.own_weights(u, v, self._named)


def rays_of(
    origins: Rays | ArrayLike, directions: ArrayLike | None, tnear: ArrayLike | None, tfar: ArrayLike | None
) -> tuple[Rays, tuple[int, ...]]:
    """The rays that a caller gives, in any way, and their leading shape.

    Raises InputError for several ways at once, and as `Rays` does.
    """
    interval = {name: value for name, value in (("tnear", tnear), ("tfar", tfar)) if value is not None}
    if isinstance(origins, Rays):
        if directions is not None or interval:
            raise InputError("directions, tnear and tfar are part of atra.Rays, expected nothing beside them")
        return origins, (len(origins),)
    if directions is None:
        both = _real("rays", origins)
        if both.ndim == 0 or both.shape[-1] != 6:
            raise InputError(
                f"rays is {origins!r:.100}, expected atra.Rays, or origins and directions, or one array (..., 6)"
            )
        origins, directions = both[..., :3], both[..., 3:]
    starts, ways = _triples("origins", origins), _triples("directions", directions)
    try:
        shape = np.broadcast_shapes(starts.shape[:-1], ways.shape[:-1])
    except ValueError:
        raise InputError(
            f"origins have shape {starts.shape} and directions {ways.shape}, expected as many, or one of either for all"
        ) from None
    flat = [np.broadcast_to(one, (*shape, 3)).reshape(-1, 3) for one in (starts, ways)]
    ends = {name: _flat(name, value, shape) for name, value in interval.items()}
    return Rays(flat[0], flat[1], **ends), shape


def _triples(name: str, given: ArrayLike) -> NDArray[Any]:
    array = _real(name, given)
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{name} have shape {array.shape}, expected (..., 3)")
    return array


def _flat(name: str, given: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    array = _real(name, given)
    if array.shape not in ((), shape):
        raise InputError(f"{name} has shape {array.shape}, expected a number, or {shape} like the rays")
    return array.reshape(-1) if array.ndim else array


def _vectors(name: str, given: ArrayLike) -> NDArray[Any]:
    array = _real(name, given)
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} have shape {array.shape}, expected (N, 3)")
    return array


def _numbers(name: str, given: ArrayLike, count: int) -> NDArray[Any]:
    array = _real(name, given)
    if array.shape not in ((), (count,)):
        raise InputError(f"{name} has shape {array.shape}, expected a number, or ({count},) like the rays")
    return array.reshape(-1) if count else array.reshape(-1)[:0]


def _real(name: str, given: ArrayLike) -> NDArray[Any]:
    try:
        array = np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as an array: {error}") from None
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} have dtype {array.dtype}, expected real numbers")
    return array if array.dtype.kind == "f" else array.astype(np.float64)


def _check(name: str, values: NDArray[Any], good: NDArray[np.bool_], expected: str) -> None:
    if not good.all():
        raise _refusal(name, values, int(np.argmin(good)), expected)


def _refusal(name: str, values: NDArray[Any], ray: int, expected: str) -> InputError:
    value = values[ray].tolist()
    return InputError(
        f"ray {ray} has the {name} {tuple(value) if isinstance(value, list) else value}, expected {expected}"
    )


def checked_out(name: str, array: Any, kind: type, shape: tuple[int, ...]) -> NDArray[Any]:
    """The array `out` of a query. Raises InputError for one of another type or shape, or that cannot be written."""
    expected = f"expected {np.dtype(kind)} of {shape}, contiguous and writable: pass an earlier result"
    if not isinstance(array, np.ndarray):
        raise InputError(f"{name} is {array!r:.100}, {expected}")
    if (array.dtype, array.shape) != (kind, shape) or not array.flags.c_contiguous or not array.flags.writeable:
        raise InputError(
            f"{name} is {array.dtype} of {array.shape}{'' if array.flags.c_contiguous else ', not contiguous'}"
            f"{'' if array.flags.writeable else ', read-only'}, {expected}"
        )
    return array
