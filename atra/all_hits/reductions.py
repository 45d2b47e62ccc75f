"""Reductions: what `gather` computes from all hits of a ray.

A ray crosses a triangle if its sample lies in the triangle's projection, in front of the eye. A sample on an edge or
corner counts as moved right, and by far less down, by an infinitesimal distance. So it crosses exactly the triangles
that some nearby ray crosses, and leaves a closed mesh as often as it enters. All methods decide this exactly, on
corners projected in float64 (`atra.exact.edges_kernels`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.all_hits.closed import check_closed
from atra.all_hits.results import CountResult, LayersResult, ThicknessResult, TransmittanceResult
from atra.all_hits.taking_kernels import COUNT, LAYERS, THICKNESS, TRANSMITTANCE
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.prim_ids import MISS
from atra.whole_numbers import is_whole_number

MOST_LAYERS = 1024
"""Most layers of an image; a layer takes eight bytes per pixel."""

Gathered = TypeVar("Gathered", bound=CountResult | ThicknessResult | TransmittanceResult | LayersResult)


class Plane(NamedTuple):
    """An array of a result. before: its leading shape, before (H, W). kind: its dtype. start: its value without a
    hit."""

    before: tuple[int, ...]
    kind: type[np.generic]
    start: float


class Reduction(ABC, Generic[Gathered]):
    """A reduction over all hits of a ray. result: type of `gather`'s result. kind: its number in kernels."""

    result: type[Gathered]
    kind: ClassVar[int]

    @abstractmethod
    def planes(self) -> dict[str, Plane]:
        """The arrays of the result, by name."""

    def weights(self, mesh: Mesh) -> NDArray[np.float32] | None:
        """(F,) float32, a number per triangle, or None. Raises InputError for an unsuitable mesh."""
        return None


@dataclass(frozen=True)
class Count(Reduction[CountResult]):
    """The number of triangles each ray crosses.

    Examples
    --------
    >>> import atra
    >>> import trimesh
    >>> mesh = atra.Mesh.from_trimesh(trimesh.creation.box())
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> with atra.RasterTracer(mesh, camera) as tracer:
    ...     count = tracer.gather(atra.Count()).count
    >>> int(count.max())
    2
    """

    result = CountResult
    kind = COUNT

    def planes(self) -> dict[str, Plane]:
        return {"count": Plane((), np.uint32, 0)}


@dataclass(frozen=True)
class Thickness(Reduction[ThicknessResult]):
    """The length of each ray inside closed meshes, whose triangles are counterclockwise seen from outside.

    Raises
    ------
    InputError
        In `gather`, for a mesh with open edges, naming some, and for one that is inside out.

    Examples
    --------
    >>> import atra
    >>> import trimesh
    >>> mesh = atra.Mesh.from_trimesh(trimesh.creation.box())
    >>> camera = atra.OrthographicCamera(eye=(0, 0, 3), target=(0, 0, 0), width=3, height=3)
    >>> with atra.RasterTracer(mesh, camera) as tracer:
    ...     thickness = tracer.gather(atra.Thickness()).thickness
    >>> float(thickness[1, 1])
    1.0
    """

    result = ThicknessResult
    kind = THICKNESS

    def planes(self) -> dict[str, Plane]:
        return {"thickness": Plane((), np.float32, 0.0)}

    def weights(self, mesh: Mesh) -> None:
        check_closed(mesh)


@dataclass(frozen=True, eq=False)
class Transmittance(Reduction[TransmittanceResult]):
    """The product of a factor for each triangle that the ray crosses.

    Parameters
    ----------
    factors : a number for all triangles, or (F,)
        From 0 to 1 each, kept as float32.

    Raises
    ------
    InputError
        For a factor outside, naming it; `gather` raises it for the wrong number of factors.

    Examples
    --------
    >>> import atra
    >>> import trimesh
    >>> mesh = atra.Mesh.from_trimesh(trimesh.creation.box())
    >>> camera = atra.OrthographicCamera(eye=(0, 0, 3), target=(0, 0, 0), width=3, height=3)
    >>> with atra.RasterTracer(mesh, camera) as tracer:
    ...     light = tracer.gather(atra.Transmittance(0.5)).transmittance
    >>> float(light[1, 1])  # through two sides
    0.25
    """

    factors: NDArray[np.float32] = field(repr=False)
    result = TransmittanceResult
    kind = TRANSMITTANCE

    def __init__(self, factors: ArrayLike) -> None:
        object.__setattr__(self, "factors", _checked_factors(factors))

    def planes(self) -> dict[str, Plane]:
        return {"transmittance": Plane((), np.float32, 1.0)}

    def weights(self, mesh: Mesh) -> NDArray[np.float32]:
        if self.factors.ndim == 0:
            return np.full(mesh.triangle_count, self.factors, np.float32)
        if len(self.factors) != mesh.triangle_count:
            raise InputError(
                f"transmittance has {len(self.factors)} factors, expected one for each of the {mesh.triangle_count} "
                f"triangles of {mesh.name!r}, or one number for all"
            )
        return self.factors


@dataclass(frozen=True)
class Layers(Reduction[LayersResult]):
    """The k nearest hits of each ray, sorted by depth, and the number of all its hits.

    Parameters
    ----------
    k
        Number of layers, from 1 to 1024.

    Raises
    ------
    InputError
        For any other k.

    Examples
    --------
    >>> import atra
    >>> import trimesh
    >>> mesh = atra.Mesh.from_trimesh(trimesh.creation.box())
    >>> camera = atra.OrthographicCamera(eye=(0, 0, 3), target=(0, 0, 0), width=3, height=3)
    >>> with atra.RasterTracer(mesh, camera) as tracer:
    ...     layers = tracer.gather(atra.Layers(2))
    >>> layers.depth[:, 1, 1].tolist()
    [2.5, 3.5]
    """

    k: int
    result = LayersResult
    kind = LAYERS

    def __post_init__(self) -> None:
        if not is_whole_number(self.k) or not 1 <= self.k <= MOST_LAYERS:
            raise InputError(f"k is {self.k!r}, expected a whole number of layers from 1 to {MOST_LAYERS}")
        object.__setattr__(self, "k", int(self.k))

    def planes(self) -> dict[str, Plane]:
        return {
            "depth": Plane((self.k,), np.float32, np.inf),
            "prim_id": Plane((self.k,), np.uint32, int(MISS)),
            "count": Plane((), np.uint32, 0),
        }


def check_reduction(what: Any) -> None:
    """Raise InputError for anything that is not a reduction."""
    if not isinstance(what, Reduction):
        raise InputError(
            f"cannot gather {what!r:.100}, expected atra.Count(), Thickness(), Transmittance(factors) or Layers(k)"
        )


def _checked_factors(given: ArrayLike) -> NDArray[np.float32]:
    try:
        factors = np.array(given, np.float64)
    except (TypeError, ValueError):
        raise InputError(
            f"transmittance is {given!r:.100}, expected a number, or an array of one per triangle"
        ) from None
    if factors.ndim > 1:
        raise InputError(f"transmittance has factors of shape {factors.shape}, expected (F,), or one number")
    outside = np.flatnonzero(~((factors >= 0.0) & (factors <= 1.0)))  # NaN, too
    if len(outside):
        which = f" of triangle {outside[0]}" if factors.ndim else ""
        raise InputError(f"transmittance{which} is {factors.flat[outside[0]]:g}, expected a factor in [0, 1]")
    kept = factors.astype(np.float32)
    kept.setflags(write=False)
    return kept
