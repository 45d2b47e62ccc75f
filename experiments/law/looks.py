"""Looks at views, kept as rows of a table, so that a fit needs neither the scenes nor new looks."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pandas as pd

from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from experiments.law.model.choice import Choice
from experiments.law.model.copying import Copied
from experiments.law.model.looking import Look, look_at
from scenes.directory import PAPER_SCENES
from scenes.generated import FAMILIES
from scenes.loading import SceneSource, load_scene, scene_is_available
from scenes.views import view_fields

COUNTS = ("boxes", "tested", "met")

FIELDS = ("width", "height", "triangles", "vertices", "is_parallel", "hit", "raster_s", "raster_bytes",
          "bvh_bytes")  # fmt: skip


@dataclass(frozen=True)
class KeptLook:
    """A look, without its sample of triangles but with what was copied of it.

    look_s: processor seconds of a look. frame_s: of its raster frame at the same time; `look.raster_s` was measured
    beside the methods' times.
    """

    look: Look
    look_s: float
    frame_s: float


def choice_of(row: Any) -> Choice:
    """The choice of a measured row."""
    method = "instanced" if row["geometry"] == "instanced" else str(row["method"])
    culling = not (method in ("aligned", "instanced") and str(row["culling"]) == "False")
    return Choice(method, (int(row["split_x"]), int(row["split_y"])), int(row["packet_width"]), culling)


def told_of(look: Look, choices: list[Choice]) -> dict[str, Any]:
    """A look in plain values, and what is copied for each choice."""
    told = {name: getattr(look, name) for name in FIELDS}
    told |= {name: getattr(look, name).ravel().tolist() for name in COUNTS}
    keys = dict.fromkeys((choice.method, choice.split, choice.culling) for choice in choices)
    copied = [[*key, *look.copied(*key)] for key in keys]
    return {**told, "shapes": json.dumps(look.shapes), "copied": json.dumps(copied)}


def look_of(told: Any) -> Look:
    """What `told_of` told of; its sample is lost."""
    shapes = tuple(tuple(shape) for shape in json.loads(told["shapes"]))
    counts = [np.array(told[name], np.float64).reshape(len(shapes), 2, -1) for name in COUNTS]
    copied = {
        (method, tuple(split), culling): Copied(*numbers)
        for method, split, culling, *numbers in json.loads(told["copied"])
    }
    return Look(
        shapes=shapes, boxes=counts[0], tested=counts[1][..., 0], met=counts[2][..., 0],
        sample=None,  # type: ignore[arg-type]
        counted=copied, **{name: told[name] for name in FIELDS},
    )  # fmt: skip


def look_at_view(scene: str, view: str, size: int, choices: list[Choice]) -> dict[str, Any]:
    """A look at a view of size x size pixels and what is copied for these choices, as a row of looks.parquet."""
    mesh, camera = mesh_and_camera(scene, view, size)
    look_at(mesh, camera)  # loads kernels
    start = thread_time()
    look = look_at(mesh, camera)
    times = {"look_s": thread_time() - start, "frame_s": look.raster_s}
    return {"scene": scene, "view": view, **times, **told_of(look, choices)}


def mesh_and_camera(name: str, view: str, size: int) -> tuple[Mesh, Camera]:
    """What a view of a scene of the paper, a built-in or a generated one shows. Raises InputError for one that is not
    on this machine."""
    family = name.rpartition("_")[0]
    made = SceneSource.generated if family in FAMILIES else SceneSource.procedural
    source = made if scene_is_available(made, name) and name not in PAPER_SCENES else SceneSource.directory
    scene = load_scene(source, name, None)
    return scene.mesh, Camera(**view_fields(scene.mesh, scene.camera, view), width=size, height=size)


def kept_looks(path: Path) -> dict[tuple[str, str, str], KeptLook]:
    """All looks, by instruction set, scene and view."""
    return {
        (row["instruction_set"], row["scene"], row["view"]): KeptLook(look_of(row), row["look_s"], row["frame_s"])
        for row in pd.read_parquet(path).to_dict("records")
    }
