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

    Any real array-like is copied. All arrays are float64 where origins or directions are given so, and float32
    otherwise; C-contiguous, private copies and read-only. Numbers below 1.4e-45 in size, float32's smallest, become 0,
    a tnear beyond 1e38 becomes that, and a tfar beyond it inf.

    Parameters
    ----------
    origins : (N, 3)
        Scene units, of at most 1e11 in size.
    directions : (N, 3)
        The largest component of each is from 1e-20 to 1e20 in size.
    tnear, tfar : (N,), or a number for all
        In lengths of the direction: 0 or more, and anything, inf included. A ray hits what lies from tnear on up to,
        not including, tfar; where tfar is not above tnear it hits nothing.

    Raises
    ------
    InputError
        For a wrong shape or dtype, and naming the first ray, and its value, with: an origin that is not finite, or too
        far away; a direction that is not finite, zero, too short or too long; a tnear that is not finite, or negative;
        a tfar that is NaN.
    """

    origins: NDArray[np.floating]
    directions: NDArray[np.floating]
    tnear: NDArray[np.floating] = 0.0  # type: ignore[assignment]
    tfar: NDArray[np.floating] = np.inf  # type: ignore[assignment]

    def __post_init__(self) -> None:
        origins, directions = vectors("origins", self.origins), vectors("directions", self.directions)
        if len(origins) != len(directions):
            raise InputError(f"there are {len(origins)} origins and {len(directions)} directions, expected as many")
        ends = ("tnear", self.tnear), ("tfar", self.tfar)
        tnear, tfar = (np.atleast_1d(_numbers(name, given, (len(origins),))) for name, given in ends)
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
        """The same rays with origins that count from `origin`, (3,) float64: in float64 unless that is the world's."""
        if not origin.any():
            return self
        moved = object.__new__(Rays)
        numbers = self.origins - origin, self.directions, self.tnear, self.tfar
        arrays = (np.ascontiguousarray(array, np.float64) for array in numbers)
        moved.__setstate__(dict(zip(("origins", "directions", "tnear", "tfar"), arrays, strict=True)))
        return moved

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Copies and unpickled arrays can be written to, whatever the original was.
        self.__dict__.update(state)
        for array in (self.origins, self.directions, self.tnear, self.tfar):
            array.setflags(write=False)


@dataclass(frozen=True, eq=False)
class RayHits:
    """The closest hit of every ray of a batch.

    All arrays have the leading shape of the rays as given, (N,) for `Rays`. The properties are computed when first
    asked for.

    Attributes
    ----------
    t : float32
        In lengths of the ray's direction, inf = miss.
    prim_id : uint32
        In the mesh's own numbering, `MISS` (0xFFFFFFFF) = miss.
    rays, mesh
        What was traced. Of a scene of several meshes, `mesh` is all of them joined, and `geometries` tells which.
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
        points, hit = np.full((*self.t.shape, 3), np.nan), self.hit
        u, v = (weight[:, None] for weight in self._weights)
        corners = self.mesh.local.triangles(self._named[hit])
        first, edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
        origins, directions = self._lines
        along = origins + self.t[hit].astype(np.float64)[:, None] * directions
        points[hit] = np.where(np.isnan(u), along, first + u * edges[:, 0] + v * edges[:, 1] + self.mesh.origin)
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

    @property
    def _lines(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and directions of the rays that hit."""
        hit = self.hit.reshape(-1)
        return self.rays.origins[hit].astype(np.float64), self.rays.directions[hit].astype(np.float64)

    @cached_property
    def _weights(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Weights of the second and third corners of the triangles hit, as `mesh` numbers these; NaN: seen edge-on."""
        intersection = intersect_rays(self.mesh, *self._lines, self._named[self.hit])
        return intersection.u, intersection.v

    @cached_property
    def _barycentric(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        u, v = (np.full(self.t.shape, np.nan, np.float32) for _ in range(2))
        u[self.hit], v[self.hit] = self._weights
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
    starts, ways = vectors("origins", origins, ndim=None), vectors("directions", directions, ndim=None)
    try:
        shape = np.broadcast_shapes(starts.shape[:-1], ways.shape[:-1])
    except ValueError:
        raise InputError(
            f"origins have shape {starts.shape} and directions {ways.shape}, expected as many, or one of either for all"
        ) from None
    flat = [np.broadcast_to(vectors, (*shape, 3)).reshape(-1, 3) for vectors in (starts, ways)]
    ends = {name: _numbers(name, value, shape) for name, value in interval.items()}
    return Rays(flat[0], flat[1], **ends), shape


def vectors(name: str, given: ArrayLike, ndim: int | None = 2) -> NDArray[Any]:
    """(N, 3), or (..., 3) where `ndim` is None, real numbers. Raises InputError for anything else."""
    array = _real(name, given)
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim == 0 or array.shape[-1] != 3 or (ndim is not None and array.ndim != ndim):
        raise InputError(f"{name} have shape {array.shape}, expected {'(..., 3)' if ndim is None else '(N, 3)'}")
    return array


def _numbers(name: str, given: ArrayLike, shape: tuple[int, ...]) -> NDArray[Any]:
    """A number, or as many as rays of a leading shape, (N,). Raises InputError for anything else."""
    array = _real(name, given)
    if array.shape not in ((), shape):
        raise InputError(f"{name} has shape {array.shape}, expected a number, or {shape} like the rays")
    return array.reshape(-1) if array.ndim else array


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


def hits_memory(out: RayHits | None, shape: tuple[int, ...]) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Memory for t and prim_id of hits, that of an earlier result if there is one. Raises as `checked_out`."""
    if out is None:
        return np.empty(shape, np.float32), np.empty(shape, np.uint32)
    t = checked_out("out.t", getattr(out, "t", None), np.float32, shape)
    prim_id = checked_out("out.prim_id", getattr(out, "prim_id", None), np.uint32, shape)
    if np.may_share_memory(t, prim_id):
        raise InputError("out has one memory for t and prim_id: pass a result of `intersect`")
    return t, prim_id
