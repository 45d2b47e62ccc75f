"""Models as our path tracer shows them, beside Blender's Cycles, which reads the files by itself.

    python -m experiments.studies models_beside TABLE.csv SHEET.png MODEL...

Both see the model under the same gradient sky, without lights of the file, by the same camera. Cycles needs the package
`bpy`. The table has the mean luminance of what the camera hits in both pictures and their ratio, and how far apart
blocks of 16 x 16 pixels are at most.
"""

from __future__ import annotations

import csv
import tempfile
import warnings
from importlib import import_module
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra import RasterTracer
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.light import PathRenderer, Scene, load_scene
from atra.light.numbers_kernels import LUMINANCE
from atra.light.pictures.files import srgb_of
from atra.light.sky import NEUTRAL, read_panorama
from experiments.light.equal_error.measure import block_differences

_SIDE, _BOUNCES = 128, 8


def shown(path: Path) -> tuple[Scene, Camera]:
    """The model under the sky alone, seen as a whole."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = load_scene(path, sky=NEUTRAL, lights=())
    return scene, Camera.framing(scene.mesh, fov_y_degrees=30, width=_SIDE, height=_SIDE)


def of_cycles(bpy: Any, path: Path, camera: Camera, samples: int) -> NDArray[np.float64]:
    """(H, W, 3), the picture that Cycles makes of a file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if path.suffix.lower() == ".obj":
            bpy.ops.wm.obj_import(filepath=str(path))
        else:
            import_module("addon_utils").enable("io_scene_gltf2")
            bpy.ops.import_scene.gltf(filepath=str(path))
    scene = bpy.context.scene
    for one in [one for one in bpy.data.objects if one.type in ("LIGHT", "CAMERA")]:
        bpy.data.objects.remove(one)
    scene.world = _sky(bpy)
    eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
    x, y, z = (np.asarray(axis, np.float64) for axis in _axes(camera))
    for column, axis in enumerate((x, y, z, np.asarray(camera.eye))):
        for row, value in enumerate((axis[0], -axis[2], axis[1])):  # from y upwards to z upwards
            eye.matrix_world[row][column] = value
    distance = float(np.linalg.norm(np.subtract(camera.target, camera.eye)))
    eye.data.sensor_fit, eye.data.angle_y = "VERTICAL", radians(camera.fov_y_degrees)
    eye.data.clip_start, eye.data.clip_end = distance * 1e-3, distance * 1e3
    scene.collection.objects.link(eye)
    scene.camera, render, cycles = eye, scene.render, scene.cycles
    render.engine, render.resolution_x, render.resolution_y = "CYCLES", _SIDE, _SIDE
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.pixel_filter_type = "BOX"
    for name in ("max", "diffuse", "glossy", "transmission", "transparent_max"):
        setattr(cycles, f"{name}_bounces", _BOUNCES)
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    with tempfile.TemporaryDirectory() as folder:
        render.filepath = str(Path(folder) / "picture.exr")
        bpy.ops.render.render(write_still=True)
        return read_panorama(render.filepath).astype(np.float64)


def _axes(camera: Camera) -> tuple[Any, Any, Any]:
    """Right, up, and backwards."""
    back = np.subtract(camera.eye, camera.target)
    back = back / np.linalg.norm(back)
    right = np.cross(camera.up, back)
    right = right / np.linalg.norm(right)
    return right, np.cross(back, right), back


def _sky(bpy: Any) -> Any:
    """NEUTRAL as a world: linear in the height of the direction."""
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    direction, split, height = (nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "MapRange"))
    for name, value in (("From Min", -1), ("From Max", 1), ("To Min", NEUTRAL.below[0]), ("To Max", NEUTRAL.above[0])):
        height.inputs[name].default_value = value
    links.new(direction.outputs["Generated"], split.inputs[0])
    links.new(split.outputs["Z"], height.inputs["Value"])
    links.new(height.outputs[0], nodes["Background"].inputs["Color"])
    return world


def study(table: str, sheet: str, *models: str, samples: int = 64) -> None:
    """Draw every model twice, ours first, into one sheet, and write a row of each into a table."""
    from PIL import Image as Picture

    try:
        bpy = import_module("bpy")
    except ImportError:
        raise InputError("models_beside needs Blender as a package; run: pip install bpy") from None
    rows, pairs = [], []
    for path in map(Path, models):
        row: dict[str, Any] = {"model": f"{path.parent.name}/{path.name}"}
        rows.append(row)
        try:
            scene, camera = shown(path)
            with PathRenderer(scene, camera, bounces=_BOUNCES, jitter="pixel") as renderer:
                renderer.add(samples)
                own = renderer.image.astype(np.float64)
            theirs = of_cycles(bpy, path.resolve(), camera, samples)
        except Exception as error:  # a row says so, and the others go on
            row["failure"] = " ".join(str(error).split())[:200]
        else:
            with RasterTracer(scene.mesh, camera) as tracer:
                hit = np.asarray(tracer.trace().hit)
            ours, others = (float((picture[hit] @ np.array(LUMINANCE)).mean()) for picture in (own, theirs))
            apart = block_differences(own, theirs).max()
            row |= {"hit": hit.mean(), "atra": ours, "cycles": others, "ratio": ours / others, "blocks_apart": apart}
            pairs.append(np.concatenate([srgb_of(one.astype(np.float32)) for one in (own, theirs)], axis=1))
            row["left_out"] = "; ".join(scene.left_out)
        print(*(f"{value:.4f}" if isinstance(value, float) else value for value in row.values()), flush=True)
        with Path(table).open("w", encoding="utf-8", newline="") as file:
            names = dict.fromkeys(name for one in rows for name in one)
            writer = csv.DictWriter(file, list(names))
            writer.writeheader()
            writer.writerows(rows)
        if pairs:
            padded = pairs + [np.zeros_like(pairs[0])] * (-len(pairs) % 6)
            lines = [np.concatenate(padded[k : k + 6], axis=1) for k in range(0, len(padded), 6)]
            Picture.fromarray(np.concatenate(lines, axis=0)).save(sheet)
