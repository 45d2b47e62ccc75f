"""The labels of whole BOP datasets, written frame by frame: many at a time, and from where an earlier run stopped."""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import local
from typing import Any, NamedTuple

import numpy as np

from atra.compat.bop import ObjectPose, Renderer
from atra.errors import InputError
from atra.files.cameras.bop import camera_of_image, image_size
from atra.files.cameras.entries import entry, number, numbers, read_json
from atra.files.meshes.loading import load_mesh
from atra.files.paths import write_atomically
from atra.files.saving import encode_png, fit_16_bits


class Frame(NamedTuple):
    """A frame of a dataset: its scene's folder, its number there, and its entries of scene_camera and scene_gt."""

    scene: Path
    number: int
    camera: dict[str, Any]
    objects: list[Any]

    @property
    def where(self) -> str:
        """How messages call it."""
        return f"{self.scene.name}, image {self.number}"


def write_labels(
    folder: Path,
    out: Path,
    workers: int,
    *,
    split: str = "test",
    models: str = "models",
    size: tuple[int, int] | None = None,
    saturate: bool = False,
) -> Iterator[tuple[Frame, str]]:
    """Write the labels of every frame of a dataset in BOP format.

    Parameters
    ----------
    folder : Path
        Holds the folders of the split and of the models.
    out : Path
        out/SPLIT/SCENE gets depth/FRAME.png (times the frame's depth_scale: millimetres), mask/FRAME_OBJECT.png,
        mask_visib/FRAME_OBJECT.png, and scene_gt_info.json, all as in the BOP format.
    workers : int
        Threads.
    size : (int, int), optional
        Width and height of the images; None: those of `camera.json`.
    saturate : bool
        Depths that do not fit 16 bits become 65,535.

    Yields
    ------
    Frame, str
        Each with "done", "kept" (written by an earlier run), or what is wrong.

    Raises
    ------
    InputError
        Before anything is drawn, for a dataset that cannot be used.
    StorageError
        If a file cannot be written.
    """
    scenes = sorted(path.parent for path in (folder / split).glob("*/scene_gt.json"))
    if not scenes:
        raise InputError(f"{folder / split} has no scene with a scene_gt.json, expected a BOP dataset")
    frames = [frame for scene in scenes for frame in _frames_of(scene)]
    used = sorted({_number_of(object_, frame) for frame in frames for object_ in frame.objects})
    meshes = {obj_id: load_mesh(folder / models / f"obj_{obj_id:06d}.ply") for obj_id in used}
    width, height = size or image_size(scenes[0] / "scene_gt.json")
    kept = local()

    def draw(frame: Frame) -> str:
        labels = out / split / frame.scene.name
        record = labels / "info" / f"{frame.number:06d}.json"
        if record.is_file():
            return "kept"
        if not hasattr(kept, "renderer"):
            kept.renderer = Renderer(width, height)
            for obj_id, mesh in meshes.items():
                kept.renderer.add_object(obj_id, mesh)
        try:
            with entry(frame.where):
                write_atomically(record, json.dumps(_label(kept.renderer, frame, labels, saturate)).encode())
        except InputError as error:
            return str(error)
        return "done"

    with ThreadPoolExecutor(workers) as pool:
        yield from zip(frames, pool.map(draw, frames), strict=True)
    for scene in scenes:
        labels = out / split / scene.name
        records = sorted((labels / "info").glob("*.json"))
        gathered = {str(int(path.stem)): json.loads(path.read_bytes()) for path in records}
        write_atomically(labels / "scene_gt_info.json", json.dumps(gathered).encode())


def _label(renderer: Renderer, frame: Frame, folder: Path, saturate: bool) -> list[dict[str, Any]]:
    """Write the images of a frame; returns its entry of scene_gt_info."""
    poses = [
        ObjectPose(
            _number_of(one, frame),
            numbers("cam_R_m2c", one.get("cam_R_m2c"), 9).reshape(3, 3),
            numbers("cam_t_m2c", one.get("cam_t_m2c"), 3),
        )
        for one in frame.objects
    ]
    camera_of_image(frame.camera, renderer.width, renderer.height)  # refuses what is no camera
    fx, _, cx, _, fy, cy, *_ = numbers("cam_K", frame.camera["cam_K"], 9).tolist()
    labels = renderer.label(poses, fx, fy, cx, cy)
    scale = number("depth_scale", frame.camera.get("depth_scale", 1.0))
    if not scale > 0.0:
        raise InputError(f"depth_scale is {scale:g}, expected a number above 0")
    depth = fit_16_bits("depths", labels.depth.astype(np.float64) / scale, saturate, "or saturate")
    name = f"{frame.number:06d}"
    write_atomically(folder / "depth" / f"{name}.png", encode_png(depth))
    for kind, masks in (("mask", labels.masks), ("mask_visib", labels.visible)):
        for place, mask in enumerate(masks):
            path = folder / kind / f"{name}_{place:06d}.png"
            write_atomically(path, encode_png(np.where(mask, 255, 0).astype(np.uint8)))
    return labels.info


def _frames_of(scene: Path) -> Iterator[Frame]:
    cameras, objects = read_json(scene / "scene_camera.json"), read_json(scene / "scene_gt.json")
    for name, given in objects.items():
        with entry(f"{scene / 'scene_gt.json'}, image {name!r:.100}"):
            if not name.isdecimal() or not isinstance(given, list):
                raise InputError("expected the number of an image and a list of objects")
            if not isinstance(cameras.get(name), dict):
                raise InputError("it has no camera in scene_camera.json")
        yield Frame(scene, int(name), cameras[name], given)


def _number_of(given: Any, frame: Frame) -> int:
    obj_id = given.get("obj_id") if isinstance(given, dict) else None
    if isinstance(obj_id, bool) or not isinstance(obj_id, int) or obj_id < 0:
        raise InputError(f"{frame.where}: obj_id is {obj_id!r:.100}, expected a whole number")
    return obj_id
