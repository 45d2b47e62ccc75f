"""The renderer of the BOP toolkit, and the labels of its datasets: depth, masks, visible shares and boxes."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.geometry.calibration import image_plane_of, pose_of
from atra.geometry.camera import CalibratedCamera
from atra.geometry.image_plane import ImagePlane
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import as_number
from atra.raster.tracer import RasterTracer
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number

NO_BOX = [-1, -1, -1, -1]
"""The box of what has no pixel."""


class ObjectPose(NamedTuple):
    """An object in a frame.

    Attributes
    ----------
    obj_id : hashable
        Of `Renderer.add_object`.
    R, t : (3, 3) and (3,) array_like of float
        Model to camera, OpenCV's axes; t in millimetres.
    """

    obj_id: Hashable
    R: ArrayLike
    t: ArrayLike


@dataclass(frozen=True, eq=False)
class FrameLabels:
    """What the objects of a frame look like; lists are in the order of the poses.

    Attributes
    ----------
    depth : (H, W) float32
        Millimetres along the view axis, 0 = nothing.
    masks, visible : list of (H, W) bool
        The whole object, and without what others hide.
    info : list of dict
        Entries of the toolkit's `scene_gt_info.json`.
    """

    depth: NDArray[np.float32]
    masks: list[NDArray[np.bool_]]
    visible: list[NDArray[np.bool_]]
    info: list[dict[str, Any]]


class _Window(NamedTuple):
    """Depths in a part of the canvas, inf = nothing; left, top: its place, pixels of the image."""

    left: int
    top: int
    depth: NDArray[np.float32]


_NOTHING = _Window(0, 0, np.full((1, 1), np.inf, np.float32))


class Renderer:
    """The interface of the BOP toolkit's renderers, by the rasteriser: depth is exact, and no OpenGL is needed.

        renderer = atra.compat.bop.Renderer(640, 480)
        renderer.add_object(1, "models/obj_000001.ply")
        depth = renderer.render_object(1, R, t, fx, fy, cx, cy)["depth"]

    Parameters
    ----------
    width, height : int
        Size of the images, pixels.
    mode : {"depth"}
        All there is.
    pixel_centre : float
        Place of the first pixel's centre in the pixels of cx and cy: 0 as OpenCV and the toolkit's own functions count,
        0.5 as its OpenGL renderers draw.

    Raises
    ------
    InputError
        For a size below 1, another mode, and a pixel_centre that is no number.

    Notes
    -----
    Source: T. Hodan et al., BOP toolkit, `renderer.py`.
    """

    def __init__(self, width: int, height: int, mode: str = "depth", *, pixel_centre: float = 0.0) -> None:
        for name, size in (("width", width), ("height", height)):
            if not is_whole_number(size) or size < 1:
                raise InputError(f"{name} is {size!r}, expected a whole number of pixels of at least 1")
        if mode != "depth":
            raise InputError(f"mode is {mode!r}, expected depth: this renderer makes no colours")
        if not np.isfinite(as_number(pixel_centre)):
            raise InputError(f"pixel_centre is {pixel_centre!r}, expected a number of pixels")
        self.width, self.height, self.pixel_centre = int(width), int(height), float(pixel_centre)
        self._meshes: dict[Hashable, Mesh] = {}
        self._tracers: dict[Hashable, Tracer] = {}

    def add_object(self, obj_id: Hashable, model_path: str | PathLike[str] | Mesh, **kwargs: Any) -> None:
        """Load a model.

        Parameters
        ----------
        obj_id : hashable
            Its name; a model of this name is replaced.
        model_path : path-like or Mesh
            A file in millimetres, or a mesh.
        **kwargs :
            `surf_color` and others of the toolkit do nothing.

        Raises
        ------
        InputError
            As `atra.load_mesh`.
        """
        given = model_path if isinstance(model_path, Mesh) else load_mesh(str(model_path))
        self.remove_object(obj_id)
        self._meshes[obj_id] = given

    def remove_object(self, obj_id: Hashable) -> None:
        """Forget a model; one that is not there is no error."""
        self._meshes.pop(obj_id, None)
        tracer = self._tracers.pop(obj_id, None)
        if tracer is not None:
            tracer.close()

    def render_object(
        self, obj_id: Hashable, R: ArrayLike, t: ArrayLike, fx: float, fy: float, cx: float, cy: float
    ) -> dict[str, NDArray[np.float32]]:
        """Draw one object.

        Parameters
        ----------
        obj_id : hashable
        R, t : (3, 3) and (3,) array_like of float
            Model to camera, OpenCV's axes.
        fx, fy, cx, cy : float
            Pixels.

        Returns
        -------
        dict
            "depth": (H, W) float32, in the model's unit along the view axis, 0 = nothing.

        Raises
        ------
        InputError
            For an unknown object, and as `Camera.from_opencv`.
        """
        window = self._window(ObjectPose(obj_id, R, t), (fx, fy, cx, cy), beyond=0)
        depth = np.zeros((self.height, self.width), np.float32)
        rows, columns, part = self._inside(window)
        np.copyto(depth[rows, columns], part, where=np.isfinite(part))
        return {"depth": depth}

    def label(self, poses: Sequence[ObjectPose], fx: float, fy: float, cx: float, cy: float) -> FrameLabels:
        """The labels of a frame. Objects hide each other; of equally near ones the first counts as in front.

        As in the toolkit, `px_count_all` and `bbox_obj` include what lies outside the image, up to its size on every
        side, and `visib_fract` is `px_count_visib` over `px_count_all`. There is no captured depth, so
        `px_count_valid` counts the pixels in the image.

        Parameters
        ----------
        poses : sequence of ObjectPose
        fx, fy, cx, cy : float
            Pixels.

        Returns
        -------
        FrameLabels

        Raises
        ------
        InputError
            As `render_object`.
        """
        windows = [self._window(pose, (fx, fy, cx, cy), beyond=1) for pose in poses]
        nearest = np.full((self.height, self.width), np.inf, np.float32)
        owner = np.full((self.height, self.width), -1, np.int64)
        for number, window in enumerate(windows):
            rows, columns, part = self._inside(window)
            nearer = part < nearest[rows, columns]
            nearest[rows, columns][nearer] = part[nearer]
            owner[rows, columns][nearer] = number
        masks, visible, info = list[NDArray[np.bool_]](), list[NDArray[np.bool_]](), list[dict[str, Any]]()
        for number, window in enumerate(windows):
            rows, columns, part = self._inside(window)
            whole, seen = np.isfinite(window.depth), owner[rows, columns] == number
            for drawn, images in ((np.isfinite(part), masks), (seen, visible)):
                images.append(np.zeros((self.height, self.width), np.bool_))
                images[-1][rows, columns] = drawn
            pixels, seen_pixels = int(whole.sum()), int(seen.sum())
            info.append({
                "bbox_obj": _box(whole, window.left, window.top),
                "bbox_visib": _box(seen, columns.start, rows.start),
                "px_count_all": pixels,
                "px_count_valid": int(np.isfinite(part).sum()),
                "px_count_visib": seen_pixels,
                "visib_fract": seen_pixels / pixels if pixels else 0.0,
            })  # fmt: skip
        return FrameLabels(np.where(np.isfinite(nearest), nearest, np.float32(0.0)), masks, visible, info)

    def close(self) -> None:
        """Forget all models."""
        for obj_id in list(self._meshes):
            self.remove_object(obj_id)

    def _inside(self, window: _Window) -> tuple[slice, slice, NDArray[np.float32]]:
        """Rows and columns of the image that a window covers, and its depths there."""
        height, width = window.depth.shape
        top, left = max(window.top, 0), max(window.left, 0)
        bottom, right = min(window.top + height, self.height), min(window.left + width, self.width)
        rows, columns = slice(top, max(bottom, top)), slice(left, max(right, left))
        part = window.depth[rows.start - window.top :, columns.start - window.left :]
        return rows, columns, part[: rows.stop - rows.start, : columns.stop - columns.start]

    def _window(self, pose: ObjectPose, intrinsics: tuple[float, float, float, float], beyond: int) -> _Window:
        """Draw an object in the part of the canvas where it may be seen. beyond: sizes of the image that the canvas
        has on every side of it."""
        if pose.obj_id not in self._meshes:
            raise InputError(f"object {pose.obj_id!r} is unknown, expected one of {sorted(map(str, self._meshes))}")
        mesh = self._meshes[pose.obj_id]
        plane = _plane(*intrinsics, self.pixel_centre)
        eye, axes = pose_of(pose.R, np.asarray(pose.t, np.float64).ravel())
        sizes = np.array([self.width, self.height])
        low, high = -beyond * sizes, (1 + beyond) * sizes
        corners = (np.array(list(product(*mesh.bounds.T.astype(np.float64)))) - eye) @ axes.T
        if not (corners[:, 2] > 0.0).any():
            return _NOTHING
        if (corners[:, 2] > 0.0).all():  # otherwise it reaches behind the eye and may be anywhere
            seen = corners[:, :2] / corners[:, 2:] / (plane.pitch_x, plane.pitch_y) + plane.axis_in_image
            low, high = (
                np.clip(ends, low, high).astype(int)
                for ends in (np.floor(seen.min(axis=0)) - 1, np.ceil(seen.max(axis=0)) + 1)
            )
        if (high <= low).any():
            return _NOTHING
        (width, height), (left, top) = (high - low).tolist(), low.tolist()
        camera = CalibratedCamera.at(eye, axes, replace(plane, left=left, top=top), width, height)
        tracer = self._tracers.get(pose.obj_id)
        if tracer is None:
            tracer = self._tracers[pose.obj_id] = RasterTracer(mesh, camera, threads=1, ties="any")
        else:
            tracer.look(camera)
        return _Window(left, top, tracer.trace().depth)


@lru_cache(maxsize=16)  # objects of a frame share it
def _plane(fx: float, fy: float, cx: float, cy: float, off: float) -> ImagePlane:
    return image_plane_of([(fx, 0.0, cx - off), (0.0, fy, cy - off), (0.0, 0.0, 1.0)])


def _box(mask: NDArray[np.bool_], left: int, top: int) -> list[int]:
    """x, y, width and height of the pixels of a mask, whose own place is given."""
    if not mask.any():
        return list(NO_BOX)
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    return [left + int(columns[0]), top + int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]
