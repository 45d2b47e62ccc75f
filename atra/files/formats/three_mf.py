"""3MF files. Source: 3MF Consortium, "3MF Core Specification", and "Production Extension" for parts in other models."""

from __future__ import annotations

import io
import zipfile
from array import array
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.meshes.parts import MeshFile, Part, check_indices, check_rows, placed_part
from atra.files.reading import Allowance

_ROOT_MODEL = "3d/3dmodel.model"
_UNITS = ("micron", "millimeter", "centimeter", "inch", "foot", "meter")
_LEFT_OUT = ("beamlattice", "trianglesets", "slicestack", "volumetricstack", "displacementmesh")

_BYTES_PER_BYTE = 4
"""Memory for a byte of XML, with its numbers."""

_BYTES_PER_PART = 5_000
"""Memory for a placed object, more than it takes: the bound then covers the time, too."""

_DEEPEST = 100
"""Upper limit of components inside of components."""

_Placed = tuple[str, str, NDArray[np.float64]]
"""Model and number of an object, and its transform (4, 4)."""


class _Object(NamedTuple):
    """Numbers of its vertices, indices of its triangles, and components."""

    numbers: array[float]
    indices: array[int]
    components: list[_Placed]


class _Model:
    """The objects and items of one model of an archive."""

    def __init__(self, name: str, content: bytes) -> None:
        self.name, self.units = name, "millimeter"
        self.objects: dict[str, _Object] = {}
        self.items: list[_Placed] = []
        self.left_out: dict[str, None] = {}
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.StartElementHandler, parser.EntityDeclHandler = self._start, _refuse_entities
        try:
            parser.Parse(content, True)
        except expat.ExpatError as error:
            raise InputError(f"{name} is no XML: {error}") from None

    def _start(self, tag: str, given: dict[str, str]) -> None:
        """Take in an element; names are without those of their namespaces."""
        tag = tag.rpartition(" ")[2]
        if tag == "object":
            if given["id"] in self.objects:
                raise InputError(f"object {given['id']!r:.50} is there twice")
            self.objects[given["id"]] = _Object(array("d"), array("q"), [])
        elif tag in ("vertex", "triangle", "component") and self.objects:
            last = next(reversed(self.objects.values()))
            if tag == "vertex":
                last.numbers.extend((float(given["x"]), float(given["y"]), float(given["z"])))
            elif tag == "triangle":
                last.indices.extend((int(given["v1"]), int(given["v2"]), int(given["v3"])))
            else:
                last.components.append(self._placed(given))
        elif tag == "item":
            self.items.append(self._placed(given))
        elif tag == "model":
            self.units = given.get("unit", self.units)
        elif tag in _LEFT_OUT:
            self.left_out[tag] = None

    def _placed(self, given: dict[str, str]) -> _Placed:
        path = next((value for key, value in given.items() if key.rpartition(" ")[2] == "path"), self.name)
        transform = np.eye(4)
        if "transform" in given:
            numbers = [float(word) for word in given["transform"].split()]
            if len(numbers) != 12 or not np.isfinite(numbers).all():
                raise InputError(f"a transform is {given['transform']!r:.100}, expected 12 finite numbers")
            transform[:3] = np.reshape(numbers, (4, 3)).T
        return _key(path), given["objectid"], transform


def read_3mf_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The triangles of a 3MF's items, in their order, each object's components in theirs, in the unit that it states.

    A transform that mirrors turns the winding of its faces. Raises InputError for objects that are missing, or parts of
    themselves.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except (zipfile.BadZipFile, NotImplementedError) as error:
        raise InputError(f"it is no ZIP archive: {error}") from None
    members = {_key(one.filename): one for one in archive.infolist()}
    models: dict[str, _Model] = {}

    def model(name: str) -> _Model:
        if name not in models:
            if name not in members:
                raise InputError(f"it has no model {name!r:.100}")
            unpacked = sum(members[one].file_size for one in (*models, name))
            allowance.check(f"{unpacked:,} bytes unpacked", unpacked * _BYTES_PER_BYTE)
            models[name] = _Model(name, archive.read(members[name]))
        return models[name]

    root = model(_ROOT_MODEL)
    if root.units not in _UNITS:
        raise InputError(f"its unit is {root.units!r:.50}, expected one of {', '.join(_UNITS)}")
    parts = list(_parts(model, root.items, allowance))
    left_out = dict.fromkeys(tag for one in models.values() for tag in one.left_out)
    return MeshFile(parts, units=root.units, notes=tuple(f"{tag} is left out" for tag in left_out))


def _key(name: str) -> str:
    return name.replace("\\", "/").lstrip("/").lower()


def _refuse_entities(*_: Any) -> None:
    raise InputError("its XML declares entities, which are not read")


def _parts(model: Callable[[str], _Model], items: list[_Placed], allowance: Allowance) -> Iterator[Part]:
    made: dict[tuple[str, str], tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
    waiting = [(item, np.eye(4), 0) for item in reversed(items)]
    count = rows = 0
    while waiting:
        (name, number, transform), outer, depth = waiting.pop()
        if depth > _DEEPEST:
            raise InputError(f"object {number!r:.50} has components nested deeper than {_DEEPEST}, or contains itself")
        count += 1
        allowance.check(f"{count + len(waiting):,} parts and more", (count + len(waiting)) * _BYTES_PER_PART)
        if number not in (objects := model(name).objects):
            raise InputError(f"it names object {number!r:.50}, which is not in {name}")
        found, place = objects[number], outer @ transform
        if len(found.indices):
            if (name, number) not in made:
                vertices, faces = np.array(found.numbers).reshape(-1, 3), np.array(found.indices, np.int64)
                check_indices(np.broadcast_to(3, len(faces) // 3), faces, len(vertices))
                made[name, number] = vertices, faces.reshape(-1, 3)
            vertices, faces = made[name, number]
            rows += len(vertices) + len(faces)
            check_rows(rows, allowance)
            yield placed_part(vertices, faces, place)
        waiting += [(component, place, depth + 1) for component in reversed(found.components)]
