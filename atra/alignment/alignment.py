"""Alignment: which rays one set of reference rays stands for, and the affine maps that carry them there (paper
§3.1-3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.ray_space import from_eye_space, ray_axes
from atra.geometry.split import Split
from atra.geometry.view import View

REFERENCES = ("off_axis", "first_cell")
"""The reference cell: one a quarter of the image from its centre, or the first cell, as in the paper."""


@dataclass(frozen=True)
class Alignment:
    """Images whose rays, cell by cell, coincide with one set of reference rays after an affine map.

    Parameters
    ----------
    cameras : tuple of View
        One per image, all pinhole or all orthographic, of equal size in pixels.
    split : Split
        The cells of every image.
    reference : {"off_axis", "first_cell"}
        The reference cell: a quarter of the image from its centre, or the first cell, as in the paper.

    Attributes
    ----------
    corner_pixels : (float, float)
        Left and top border of the reference cell on the image plane, pixels from the view axis.
    shifts : ((nx,) float64, (ny,) float64)
        On the image plane, from the reference cell to each column and row of cells.
    shears : ((nx, 3) float64, (ny, 3) float64)
        The same in ray space, per unit of depth; for parallel rays the whole shift.
    transforms : (K, ny, nx, 3, 4) float64
        Affine maps that make the rays of each cell of each image the reference rays.

    Raises
    ------
    InputError
        For cameras of different sizes or kinds, a split of an image of another size, and another reference.

    Notes
    -----
    A linear map per image carries its eye space into the first camera's ray space, where all images have the same rays.
    A shear per cell then lays the cell onto the reference cell; in camera space, for pinhole cameras,

        X' = X - shifts[0][i] Z,    Y' = Y - shifts[1][j] Z,    Z' = Z

    and for parallel rays the same with 1 in place of Z. Every ray keeps its parameter, which is the depth. The paper's
    reference cell is cell (0, 0) (§3.1). Any translate of it works; its place decides how tightly axis-aligned boxes
    fit the rays.

    Examples
    --------
    >>> import atra
    >>> camera = atra.Camera(eye=(0, 0, 3), target=(0, 0, 0), width=64, height=48)
    >>> alignment = atra.Alignment.of_frames([camera], atra.Split.of_image((4, 1), camera))
    >>> len(alignment.cameras), alignment.split.nx
    (1, 4)
    """

    cameras: tuple[View, ...]
    split: Split
    reference: str = "off_axis"

    def __post_init__(self) -> None:
        check_choice("reference", self.reference, REFERENCES)
        if not self.cameras:
            raise InputError("no camera was given, expected at least one")
        first, split = self.camera, self.split
        for frame, camera in enumerate(self.cameras):
            if (camera.width, camera.height) != (split.width, split.height):
                raise InputError(
                    f"frame {frame} has {camera.width} x {camera.height} pixels, the split is of an image of "
                    f"{split.width} x {split.height}; no affine map carries the rays of other sizes onto each other"
                )
            if camera.is_parallel != first.is_parallel:
                raise InputError(
                    f"frame {frame} is a {type(camera).__name__}, frame 0 a {type(first).__name__}; no affine map "
                    "carries rays through one point onto parallel ones"
                )
        _ = self.corner_pixels  # a camera whose lens has no image plane is refused here

    @classmethod
    def of_cells(cls, camera: View, split: Split, reference: str = "off_axis") -> Self:
        """The cells of one image: the paper's shears (§3.1), or translations for parallel rays."""
        return cls((camera,), split, reference)

    @classmethod
    def of_eyes(cls, left: Camera, right: Camera, split: Split, reference: str = "off_axis") -> Self:
        """Two eyes side by side: the right eye's geometry is translated onto the left's (paper §6).

        Raises
        ------
        InputError
            Unless the cameras differ in the eye's position alone, and as `Alignment`.
        """
        if not (np.allclose(left.axes, right.axes, rtol=0, atol=1e-9) and left.plane == right.plane):
            raise InputError(
                "the two eyes look in different directions or have different fields of view or principal points, "
                "expected parallel views of one image plane; use Alignment.of_frames for other pairs"
            )
        return cls((left, right), split, reference)

    @classmethod
    def of_frames(cls, cameras: Sequence[View], split: Split, reference: str = "off_axis") -> Self:
        """Frames of a camera that may move, turn and change its field of view (paper §6, Fig. 8)."""
        return cls(tuple(cameras), split, reference)

    @property
    def camera(self) -> View:
        """The first camera; the reference rays are rays of its ray space."""
        return self.cameras[0]

    @cached_property
    def corner_pixels(self) -> tuple[float, float]:
        """Left and top border of the reference cell on the first camera's image plane, in pixels from the view axis.

        Off the axis, the reference cell starts a quarter of the image from its centre, away from the world axis nearest
        to the view. Closer to the border the frustum is more slanted and boxes fit it less tightly. Closer to where a
        direction component vanishes, the reciprocals in a packet, with which Embree tests boxes, differ more. An image
        axis that is not split stays as it is.
        """
        camera, plane, split = self.camera, self.camera.plane, self.split
        x, y = float(plane.columns(0)), float(plane.rows(0))
        if self.reference == "first_cell":
            return x, y
        right, down, forward = camera.axes
        centre_x, centre_y = x + camera.width / 2, y + camera.height / 2
        # Where the central ray heads; parallel rays all head forward.
        slope_x, slope_y = (0.0, 0.0) if camera.is_parallel else (centre_x * plane.pitch_x, centre_y * plane.pitch_y)
        nearest = np.argmax(np.abs(forward + slope_x * right + slope_y * down))
        if split.nx > 1:
            side = -1 if (right - slope_x * forward)[nearest] * forward[nearest] >= 0 else 1
            x = centre_x + side * camera.width / 4
        if split.ny > 1:
            side = -1 if (down - slope_y * forward)[nearest] * forward[nearest] >= 0 else 1
            y = centre_y + side * camera.height / 4
        return x, y

    @cached_property
    def shifts(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(nx,) and (ny,) float64, on the image plane: from the reference cell to each column and row of cells."""
        plane, split, (x, y) = self.camera.plane, self.split, self.corner_pixels
        columns = plane.columns(np.arange(split.nx) * split.cell_width) - x
        rows = plane.rows(np.arange(split.ny) * split.cell_height) - y
        return columns * plane.pitch_x, rows * plane.pitch_y

    @cached_property
    def shears(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(nx, 3) and (ny, 3) float64, ray space: the shift of a point by its column and row of cells, per unit of
        depth; for parallel rays the whole shift."""
        right, down, _ = ray_axes(self.camera)
        return np.outer(self.shifts[0], right), np.outer(self.shifts[1], down)

    @property
    def transforms(self) -> NDArray[np.float64]:
        """(K, ny, nx, 3, 4) float64: points relative to the first eye, along the world's axes, to ray space, so that
        the rays of each cell of each image become the reference rays."""
        first, (shears_x, shears_y) = self.camera, self.shears
        shifts = shears_y[:, None] + shears_x
        transforms = np.zeros((len(self.cameras), *shifts.shape[:2], 3, 4))
        for image, camera in zip(transforms, self.cameras, strict=True):
            linear = linear_onto(first, camera)
            if first.is_parallel:
                image[..., :3], image[..., 3] = linear, -shifts
            else:
                image[..., :3] = (np.eye(3) - shifts[..., None] * ray_axes(first)[2]) @ linear
            image[..., 3] += (image[..., :3] @ np.subtract(first.eye, camera.eye)[:, None])[..., 0]
        return transforms


def linear_onto(first: View, camera: View) -> NDArray[np.float64]:
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
