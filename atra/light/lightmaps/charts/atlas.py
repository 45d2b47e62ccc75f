"""The atlas: where the triangles of a mesh lie on a lightmap."""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from math import frexp
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import AtraError, InputError
from atra.files.paths import write_atomically
from atra.geometry.mesh import Mesh
from atra.light.checks import check_whole
from atra.light.lightmaps.charts.unwrap import UNMAPPED
from atra.whole_numbers import is_whole_number

MOST_TEXELS = 1 << 14
"""Most texels along a side of a map. All maps together have at most its square, which 32 bits can count."""

_VERSION = 3
"""Version of the files that keep atlases."""

_SMALL, _FAR = 0.1, 256.0
"""xatlas computes in float32 and treats lengths below fixed limits as zero. A mesh smaller than the first is enlarged
for it; one farther from the origin than the second times its size is moved there."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """Charts of a mesh, on one map or on several of one size, stacked vertically.

    uv: (F, 3, 2) float64, each triangle's corners in texels, row 0 on top; NaN without a place. chart: (F,) int32,
    `UNMAPPED` without a place. width: texels of a map. height: texels of all maps together. maps: their number. Raises
    InputError for shapes and sizes that do not fit, and for a face outside its map, naming the first.
    """

    uv: NDArray[np.float64]
    chart: NDArray[np.int32]
    width: int
    height: int
    maps: int = 1

    def __post_init__(self) -> None:
        check_whole("number of maps", self.maps, 1)
        for name, size, maps in (("width", self.width, 1), ("height", self.height, self.maps)):
            if not is_whole_number(size) or not maps <= size <= maps * MOST_TEXELS or size % maps:
                of_what = "a map" if maps == 1 else f"{maps} maps together"
                expected = f"a whole number from 1 to {MOST_TEXELS} for each"
                raise InputError(f"{name} of {of_what} is {size!r}, expected {expected}")
        if self.width * self.height > MOST_TEXELS**2:
            raise InputError(f"{self.maps} maps have {self.width * self.height:,} texels, expected at most 2^28")
        uv = np.array(self.uv, np.float64, order="C")
        chart = np.array(self.chart, np.int32)
        if uv.ndim != 3 or uv.shape[1:] != (3, 2) or chart.shape != uv.shape[:1]:
            raise InputError(f"uv and charts have shapes {uv.shape} and {chart.shape}, expected (F, 3, 2) and (F,)")
        outside = (chart != UNMAPPED) & ~((uv >= 0.0) & (uv <= (self.width, self.height))).all(axis=(1, 2))
        if outside.any():
            face = int(np.argmax(outside))
            place = (uv[face] / (self.width, self.height)).tolist()
            raise InputError(f"uv of face {face} are {place}, expected numbers from 0 to 1")
        uv[chart == UNMAPPED] = np.nan
        for name, array in (("uv", uv), ("chart", chart)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        first, last = (ends(uv[..., 1], axis=1) / self.map_height for ends in (np.min, np.max))
        across = (chart != UNMAPPED) & (last > self.map_of + 1)
        if across.any():
            face = int(np.argmax(across))
            raise InputError(f"face {face} lies on maps {int(first[face])} and {int(last[face])}, expected one")

    @property
    def map_height(self) -> int:
        """Texels of one map."""
        return self.height // self.maps

    @cached_property
    def map_of(self) -> NDArray[np.int64]:
        """(F,) int64, each triangle's map; 0 without a place."""
        top = np.nan_to_num(self.uv[..., 1].min(axis=1)) // self.map_height
        return np.minimum(top.astype(np.int64), self.maps - 1)

    def texels_around(
        self, points: NDArray[np.float64], face: NDArray[np.integer]
    ) -> tuple[list[NDArray[np.int64]], list[NDArray[np.int64]], NDArray[np.float64], NDArray[np.float64]]:
        """The four texels around points (P, 2) of triangles (P,), on each triangle's map: two rows, two columns, and
        the point's fractions between the rows and between the columns, 0 to 1; (P,) each."""
        shifted = points - 0.5
        corner = np.floor(shifted)
        right, below = (shifted - corner).T
        x, y = corner.astype(np.int64).T
        top = self.map_height * self.map_of[face]
        rows = [np.clip(y + k, top, top + self.map_height - 1) for k in (0, 1)]
        columns = [np.clip(x + k, 0, self.width - 1) for k in (0, 1)]
        return rows, columns, below, right

    @property
    def charts(self) -> int:
        """Number of charts."""
        return int(self.chart.max(initial=UNMAPPED)) + 1

    @classmethod
    def of_uv(cls, uv: ArrayLike, width: int, height: int, map_of: ArrayLike = 0) -> Atlas:
        """An atlas from uv of one's own; triangles of a map that share an edge make a chart.

        uv: (F, 3, 2), each triangle's corners in [0, 1], v upwards as in model files. width, height: texels of a map.
        map_of: (F,), each triangle's map, from 0; 0: all on one. Raises InputError as `Atlas`.
        """
        try:
            given = np.array(uv, np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"uv cannot be read as an array: {error}") from None
        if given.ndim != 3 or given.shape[1:] != (3, 2):
            raise InputError(f"uv have shape {given.shape}, expected (F, 3, 2), one row per corner of a triangle")
        bad = ~np.isfinite(given).all(axis=(1, 2))
        if bad.any():
            raise InputError(f"uv of face {int(np.argmax(bad))} are not finite, expected numbers from 0 to 1")
        numbers = np.asarray(map_of)
        if numbers.shape not in ((), (len(given),)) or numbers.dtype.kind not in "iu" or numbers.min(initial=0) < 0:
            raise InputError(f"map_of has shape {numbers.shape} of {numbers.dtype}, expected (F,) numbers from 0 on")
        on_map = np.broadcast_to(numbers.reshape(-1, 1), given.shape[:2])
        outside = ~((given >= 0.0) & (given <= 1.0)).all(axis=(1, 2))
        if outside.any():
            face = int(np.argmax(outside))
            raise InputError(f"uv of face {face} are {given[face].tolist()}, expected numbers from 0 to 1")
        placed = np.stack([given[..., 0] * width, (1.0 - given[..., 1] + on_map) * height], axis=-1)
        maps = int(numbers.max(initial=0)) + 1
        return cls(placed, _connected(np.dstack([given, on_map])), width, height * maps, maps)

    @classmethod
    def unwrap(
        cls, mesh: Mesh, size: int = 512, *, padding: int = 2, texels_per_unit: float = 0.0,
        kept_in: Path | None = None, time_limit_s: float = 600.0,
    ) -> Atlas:  # fmt: skip
        """Charts by xatlas, on square maps of `size` texels.

        padding: texels between charts. texels_per_unit: resolution, with as many maps as that needs; 0: what fills one
        map. kept_in: a folder that caches the result by a hash of the mesh. time_limit_s: seconds after which the
        unwrapping process is stopped. Raises InputError for bad numbers and without the package xatlas, AtraError past
        the limit. Source: https://github.com/jpcy/xatlas, by its Python bindings.
        """
        check_whole("size of a map", size, 8, MOST_TEXELS)
        check_whole("padding", padding, 0, 64)
        kept = None if kept_in is None else Path(kept_in) / f"{_key(mesh, size, padding, texels_per_unit)}.npz"
        if kept is not None:
            with suppress(Exception):  # a damaged archive may raise anything
                return _loaded(kept)
        content = _unwrapped(mesh, size, padding, texels_per_unit, time_limit_s)
        if kept is not None:
            write_atomically(kept, content)
        return _loaded(io.BytesIO(content))


def _key(mesh: Mesh, *settings: float) -> str:
    digest = hashlib.sha256(repr((_VERSION, *settings)).encode())
    for array in (mesh.vertices, mesh.faces):
        digest.update(repr(array.shape).encode() + array.tobytes())
    return digest.hexdigest()[:32]


def _loaded(file: IO[bytes] | Path) -> Atlas:
    with np.load(file) as kept:
        return Atlas(kept["uv"], kept["chart"], *kept["size"].tolist())


def _unwrapped(mesh: Mesh, size: int, padding: int, texels_per_unit: float, time_limit_s: float) -> bytes:
    """An archive of the fields of `Atlas`."""
    if find_spec("xatlas") is None:
        raise InputError("charts need the package xatlas; run: pip install xatlas, or pass uv of your own")
    job = io.BytesIO()
    vertices, scale = _in_reach(mesh)
    density = texels_per_unit / scale
    np.savez(job, vertices=vertices, faces=mesh.faces, size=size, padding=padding, texels_per_unit=density)
    # A process: xatlas cannot be interrupted, and may crash.
    command = [sys.executable, "-P", str(Path(__file__).with_name("unwrap.py"))]
    paths = {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    try:
        done = subprocess.run(
            command, input=job.getvalue(), capture_output=True, timeout=time_limit_s, env=os.environ | paths
        )
    except subprocess.TimeoutExpired:
        late = f"xatlas found no charts of {mesh!r} in {time_limit_s:g} s; allow more time, or pass uv"
        raise AtraError(late) from None
    if done.returncode or not done.stdout:
        told = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise AtraError(f"xatlas ended without charts of {mesh!r} (code {done.returncode}): {told}")
    return done.stdout


def _in_reach(mesh: Mesh) -> tuple[NDArray[np.float32], float]:
    """(V, 3) float32, the vertices placed and scaled so that xatlas tells them apart, and the scale."""
    mesh = mesh.local
    low, high = mesh.bounds
    size = float((high - low).max())
    is_small, is_far = 0.0 < size < _SMALL, float(np.abs(mesh.bounds).max()) > _FAR * size > 0.0
    if not (is_small or is_far):
        return mesh.vertices, 1.0
    middle = (low + high) / 2.0 if is_far else np.zeros(3)
    scale = 2.0 ** -frexp(size)[1] if is_small else 1.0  # a power of two is exact
    return ((mesh.vertices - middle) * scale).astype(np.float32), scale


def _connected(places: NDArray[np.float64]) -> NDArray[np.int32]:
    """(F,) chart numbers: triangles that share an edge share a chart. places: (F, 3, 3), u, v and map."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    _, corner = np.unique(places.reshape(-1, 3), axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    edges = np.sort(np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1)
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    faces, edge_count = len(places), int(edge.max()) + 1
    rows = np.tile(np.arange(faces), 3)
    links = coo_matrix((np.ones(len(rows)), (rows, edge.ravel())), (faces, edge_count)).tocsr()
    _, chart = connected_components(links @ links.T, directed=False)
    return np.asarray(chart, np.int32)
