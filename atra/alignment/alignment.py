"""Alignment: which rays one set of reference rays stands for, and the affine maps that carry them there (paper
§3.1-3.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.numbers import Vector
from atra.geometry.ray_space import from_eye_space, ray_axes
from atra.geometry.split import Split
from atra.geometry.view import View

REFERENCES = ("off_axis", "first_cell")
"""The reference cell: one a quarter of the image from its centre, or the first cell, as in the paper."""

TOLERANCE_PIXELS = 1e-6
"""Largest distance in pixels between a mapped ray and its reference ray: well above float64's rounding, well below that
of float32 tracing."""


@dataclass(frozen=True, eq=False)
class Part:
    """One cell of one image and the map that carries its rays onto the reference rays.

    image, i, j: the image and the cell's column and row. first_x, first_y: the cell's upper left pixel; reference ray
    (c, r) belongs to pixel (first_x + c, first_y + r). transform: (3, 4) float64, world points -> ray space of the
    first camera.
    """

    image: int
    i: int
    j: int
    first_x: int
    first_y: int
    transform: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Alignment:
    """Images whose rays, cell by cell, coincide with one set of reference rays after an affine map.

    A linear map per image carries its eye space into the first camera's ray space, where all images have the same rays.
    A shear per cell then lays the cell onto the reference cell; in camera space, for pinhole cameras,

        X' = X - shift_x[i] Z,    Y' = Y - shift_y[j] Z,    Z' = Z

    and for parallel rays the same with 1 in place of Z. Every ray keeps its parameter, which is the depth. The paper's
    reference cell is cell (0, 0) (§3.1). Any translate of it works; its place decides how tightly axis-aligned boxes
    fit the rays.

    cameras: one per image, all pinhole or all orthographic, of equal size in pixels. split: the cells of every image.
    linear: (K, 3, 3) float64, applied to the eye space of image k's camera. first_x_pixels, first_y_pixels: left and
    top border of the reference cell on the first camera's image plane, in pixels from the view axis. shift_x: (nx,)
    float64, on the image plane. shift_y: (ny,) float64, on the image plane.

    Raises InputError for cameras of different sizes or kinds, and, naming a ray, unless the maps carry the rays of
    every part one-to-one onto the reference rays, parameter kept: the paper's condition (§3.3).
    """

    cameras: tuple[View, ...]
    split: Split
    linear: NDArray[np.float64]
    first_x_pixels: float
    first_y_pixels: float
    shift_x: NDArray[np.float64]
    shift_y: NDArray[np.float64]

    def __post_init__(self) -> None:
        check_same_grid(self.cameras)
        _check_shapes(self)
        _check_images(self)
        _check_cells(self)

    @classmethod
    def of_cells(cls, camera: View, split: Split, reference: str = "off_axis") -> Self:
        """The cells of one image: the paper's shears (§3.1), or translations for parallel rays.

        reference: one of `REFERENCES`. Raises InputError for any other.
        """
        return cls._of_images((camera,), split, reference)

    @classmethod
    def of_eyes(cls, left: Camera, right: Camera, split: Split, reference: str = "off_axis") -> Self:
        """Two eyes side by side: the right eye's geometry is translated onto the left's (paper §6).

        reference: as for `of_cells`. Raises InputError unless the cameras differ in the eye's position alone.
        """
        if not (np.allclose(left.axes, right.axes, rtol=0, atol=1e-9) and left.plane == right.plane):
            raise InputError(
                "the two eyes look in different directions or have different fields of view or principal points, "
                "expected parallel views of one image plane; use Alignment.of_frames for other pairs"
            )
        return cls._of_images((left, right), split, reference)

    @classmethod
    def of_frames(cls, cameras: Sequence[View], split: Split, reference: str = "off_axis") -> Self:
        """Frames of a camera that may move, turn and change its field of view (paper §6, Fig. 8).

        reference: as for `of_cells`. Raises InputError, naming the frame, for a camera of another size or kind.
        """
        return cls._of_images(tuple(cameras), split, reference)

    @classmethod
    def _of_images(cls, cameras: tuple[View, ...], split: Split, reference: str) -> Self:
        """Off the axis, the reference cell starts a quarter of the image from the centre, away from the world axis
        nearest to the view.

        Closer to the border the frustum is more slanted and boxes fit it less tightly. Closer to where a direction
        component vanishes, the reciprocals in a packet, with which Embree tests boxes, differ more. An image axis that
        is not split stays as it is. The centre is the image's own, even if the view axis meets the plane elsewhere.
        """
        check_same_grid(cameras)
        if reference not in REFERENCES:
            raise InputError(f"reference is {reference!r}, expected one of {', '.join(REFERENCES)}")
        camera, plane = cameras[0], cameras[0].plane
        right, down, forward = camera.axes
        first_x_pixels, first_y_pixels = float(plane.columns(0)), float(plane.rows(0))
        centre_x, centre_y = first_x_pixels + camera.width / 2, first_y_pixels + camera.height / 2
        # Where the central ray heads; parallel rays all head forward.
        slope_x, slope_y = (0.0, 0.0) if camera.is_parallel else (centre_x * plane.pitch_x, centre_y * plane.pitch_y)
        towards = forward + slope_x * right + slope_y * down
        nearest = np.argmax(np.abs(towards))
        if reference == "off_axis" and split.nx > 1:
            side = -1 if (right - slope_x * forward)[nearest] * forward[nearest] >= 0 else 1
            first_x_pixels = centre_x + side * camera.width / 4
        if reference == "off_axis" and split.ny > 1:
            side = -1 if (down - slope_y * forward)[nearest] * forward[nearest] >= 0 else 1
            first_y_pixels = centre_y + side * camera.height / 4
        return cls._at(cameras, split, first_x_pixels, first_y_pixels)

    @classmethod
    def _at(cls, cameras: tuple[View, ...], split: Split, first_x_pixels: float, first_y_pixels: float) -> Self:
        first, plane = cameras[0], cameras[0].plane
        shift_x = (plane.columns(np.arange(split.nx) * split.cell_width) - first_x_pixels) * plane.pitch_x
        shift_y = (plane.rows(np.arange(split.ny) * split.cell_height) - first_y_pixels) * plane.pitch_y
        linear = np.stack([_onto(first, camera) for camera in cameras])
        return cls(cameras, split, linear, first_x_pixels, first_y_pixels, shift_x, shift_y)

    @property
    def image_count(self) -> int:
        """Number of images, K."""
        return len(self.cameras)

    @property
    def shears(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(nx, 3) and (ny, 3) float64, ray space: the shift of a point by its column and row of cells, per unit of
        depth; for parallel rays the whole shift."""
        right, down, _ = ray_axes(self.cameras[0])
        return np.outer(self.shift_x, right), np.outer(self.shift_y, down)

    def parts(self) -> Iterator[Part]:
        """All cells of all images: image by image, row by row."""
        transforms = self.transforms_from((0.0, 0.0, 0.0))
        for image, j, i in product(range(self.image_count), range(self.split.ny), range(self.split.nx)):
            first = i * self.split.cell_width, j * self.split.cell_height
            yield Part(image, i, j, *first, transforms[image, j, i])

    def transforms_from(self, origin: Vector) -> NDArray[np.float64]:
        """(K, ny, nx, 3, 4) float64: points relative to `origin`, along the world's axes -> ray space."""
        shears_x, shears_y = self.shears
        shifts = shears_y[:, None] + shears_x
        first, split = self.cameras[0], self.split
        transforms = np.zeros((self.image_count, split.ny, split.nx, 3, 4))
        if first.is_parallel:
            transforms[..., :3] = self.linear[:, None, None]
            transforms[..., 3] = -shifts
        else:
            shears = np.eye(3) - shifts[..., None] * ray_axes(first)[2]
            transforms[..., :3] = shears @ self.linear[:, None, None]
        from_eyes = np.array([np.subtract(origin, camera.eye) for camera in self.cameras])
        transforms[..., 3] += (transforms[..., :3] @ from_eyes[:, None, None, :, None])[..., 0]
        return transforms

    def shear_points(self, points_camera: NDArray[np.floating], i: int, j: int) -> NDArray[np.float64]:
        """(N, 3) points of the first camera's space -> float64, as cell (i, j) shears them onto the reference rays."""
        sheared = np.array(points_camera, np.float64)
        per_depth = 1.0 if self.cameras[0].is_parallel else sheared[:, 2]
        sheared[:, 0] -= self.shift_x[i] * per_depth
        sheared[:, 1] -= self.shift_y[j] * per_depth
        return sheared


def check_same_grid(cameras: Sequence[View]) -> None:
    """Raise InputError, naming the frame, unless all cameras are of one kind and size."""
    if not cameras:
        raise InputError("no camera was given, expected at least one")
    first = cameras[0]
    for frame, camera in enumerate(cameras):
        if (camera.width, camera.height) != (first.width, first.height):
            raise InputError(
                f"frame {frame} has {camera.width} x {camera.height} pixels, frame 0 has {first.width} x "
                f"{first.height}; frames of other sizes have other rays, which no affine map carries onto each other"
            )
        if camera.is_parallel != first.is_parallel:
            raise InputError(
                f"frame {frame} is a {type(camera).__name__}, frame 0 a {type(first).__name__}; no affine map carries "
                "rays through one point onto parallel ones"
            )


def _onto(first: View, camera: View) -> NDArray[np.float64]:
    """(3, 3): eye space of `camera` -> ray space of `first`, so that each pixel has the same ray in both.

    In camera space the rays of a pixel differ by the ratio of pixel pitches and, unless parallel, by where the view
    axes meet the image planes.
    """
    plane, own = first.plane, camera.plane
    apart_x, apart_y = float(plane.columns(0) - own.columns(0)), float(plane.rows(0) - own.rows(0))
    same_pixels = (plane.pitch_x, plane.pitch_y, apart_x, apart_y) == (own.pitch_x, own.pitch_y, 0.0, 0.0)
    if same_pixels and np.array_equal(camera.axes, first.axes):
        return from_eye_space(first)  # exact, so that axis-aligned walls stay flat
    onto = np.diag([plane.pitch_x / own.pitch_x, plane.pitch_y / own.pitch_y, 1.0])
    if not first.is_parallel:
        onto[:2, 2] = plane.pitch_x * apart_x, plane.pitch_y * apart_y
    return ray_axes(first).T @ onto @ camera.axes


def _check_shapes(alignment: Alignment) -> None:
    split, first = alignment.split, alignment.cameras[0]
    if (split.width, split.height) != (first.width, first.height):
        raise InputError(
            f"the split is of an image of {split.width} x {split.height} pixels, the camera has "
            f"{first.width} x {first.height}"
        )
    for name, array, shape in (
        ("linear", alignment.linear, (len(alignment.cameras), 3, 3)),
        ("shift_x", alignment.shift_x, (split.nx,)),
        ("shift_y", alignment.shift_y, (split.ny,)),
    ):
        if array.shape != shape:
            raise InputError(f"{name} has shape {array.shape}, expected {shape}")


def _check_images(alignment: Alignment) -> None:
    """Every image must have the first one's rays. Rays are linear in the pixel, so checking the corners is enough."""
    first = alignment.cameras[0]
    x, y = np.array([0, first.width, 0, first.width]), np.array([0, 0, first.height, first.height])
    wanted = [side @ ray_axes(first) for side in first.rays(x, y, (0.0, 0.0))]
    for image, camera in enumerate(alignment.cameras):
        found = [side @ camera.axes @ alignment.linear[image].T for side in camera.rays(x, y, (0.0, 0.0))]
        for corner, (name, mapped, expected) in product(
            range(4), zip(("origin", "direction"), found, wanted, strict=True)
        ):
            beside = np.linalg.norm(mapped[corner] - expected[corner]) / first.pixel_pitch
            if not beside <= TOLERANCE_PIXELS * max(1.0, float(np.linalg.norm(expected[corner]))):
                raise InputError(
                    f"image {image}: its map carries the {name} of the ray of pixel {(int(x[corner]), int(y[corner]))} "
                    f"to {mapped[corner].tolist()}, expected {expected[corner].tolist()} as in image 0: affine maps "
                    "must carry each ray onto its reference ray, parameter kept (paper §3.3)"
                )


def _check_cells(alignment: Alignment) -> None:
    """The borders of every cell must coincide with the reference cell's."""
    split, first = alignment.split, alignment.cameras[0]
    plane = first.plane
    for axis, shifts, cell, on_plane, pitch, start, pixels in (
        ("x", alignment.shift_x, split.cell_width, plane.columns, plane.pitch_x, alignment.first_x_pixels, split.width),
        ("y", alignment.shift_y, split.cell_height, plane.rows, plane.pitch_y, alignment.first_y_pixels, split.height),
    ):
        borders = np.arange(len(shifts)) * cell
        beside = on_plane(borders) - shifts / pitch - start
        wrong = ~(np.abs(beside) <= TOLERANCE_PIXELS * pixels)
        if wrong.any():
            index = int(np.nonzero(wrong)[0][0])
            raise InputError(
                f"shift_{axis}[{index}] is {shifts[index]}: it maps the rays of pixels with {axis} = {borders[index]} "
                f"{beside[index]:g} pixels away from the reference rays, expected onto them (paper §3.3)"
            )
