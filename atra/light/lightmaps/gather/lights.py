"""Lights of a bake: those of hybrid rendering, spots, emitting faces, and a panorama sky where rays are aimed at it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.light.lightmaps.gather import tables_kernels as words
from atra.light.lights import Light, light_row
from atra.light.sky import PanoramaSky, Sky

_LARGEST = 1e30
"""Upper limit of an estimated intensity; keeps float32 sums finite."""


@dataclass(frozen=True, eq=False)
class Aims:
    """A distribution of rays, proportional to brightness.

    shares: running sums up to 1, of faces or of cells of the sky. density: of a point on a face, or of a direction.
    row: (LIGHT_WORDS,) float32, the whole as one light.
    """

    shares: NDArray[np.float64]
    density: NDArray[np.float32]
    row: NDArray[np.float32]


def light_rows(lights: tuple[Light, ...], others: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """(L, LIGHT_WORDS) float32 for kernels. others: rows of all emitting faces together, and of the sky, put at the
    end."""
    rows = np.zeros((len(lights) + len(others), words.LIGHT_WORDS), np.float32)
    for row, light in zip(rows, lights, strict=False):
        row[: words.COLOUR] = light_row(light)
        row[words.COLOUR :] = light.power * np.array(light.colour)
    rows[len(lights) :] = np.array(others, np.float32).reshape(-1, words.LIGHT_WORDS)
    if not np.isfinite(rows).all():
        number = int(np.argmin(np.isfinite(rows).all(axis=1)))
        raise InputError(f"light {number} is {lights[number]!r:.200}, beyond what float32 can hold")
    return rows


def _row(kind: int, colour: NDArray[np.float64], place: NDArray[np.float64], spread: float) -> NDArray[np.float32]:
    row = np.zeros(words.LIGHT_WORDS)
    row[words.KIND], row[words.PLACE : words.SIZE], row[words.SIZE] = kind, place, spread
    row[words.COLOUR :] = colour
    return np.clip(row, -_LARGEST, _LARGEST).astype(np.float32)


def aims_at_emitters(emission: NDArray[np.float32], corners: NDArray[np.float64]) -> tuple[NDArray[np.int32], Aims]:
    """(E,) int32, emitting faces, and their distribution. emission: (F, 3). corners: (F, 3, 3)."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    power = emission.astype(np.float64) @ np.array(words.LUMINANCE, np.float64) * areas
    faces = np.flatnonzero(power > 0.0)
    density = np.zeros(len(areas), np.float32)
    if not len(faces):
        return faces.astype(np.int32), Aims(np.zeros(0), density, np.zeros(words.LIGHT_WORDS, np.float32))
    share = power[faces] / power.sum()
    shares = np.cumsum(share)
    shares[-1] = 1.0
    density[faces] = share / areas[faces]
    centres = corners[faces].mean(axis=1)
    middle = share @ centres
    spread = float(np.sqrt(share @ ((centres - middle) ** 2).sum(axis=1)))
    colour = areas[faces] @ emission[faces].astype(np.float64) / np.pi
    return faces.astype(np.int32), Aims(shares, density, _row(words.EMITTERS, colour, middle, spread))


def aims_at_sky(sky: Sky) -> Aims | None:
    """The distribution over a panorama's texels; None for a black sky or a gradient, which scattered rays find as
    well."""
    if not isinstance(sky, PanoramaSky) or sky.power == 0.0:
        return None
    rows, columns, _ = sky.texels.shape
    bands = -np.diff(np.cos(np.linspace(0.0, np.pi, rows + 1))) * (2.0 * np.pi / columns)
    power = sky.texels.astype(np.float64) @ np.array(words.LUMINANCE, np.float64) * bands[:, None]
    if not power.sum() > 0.0:
        return None
    shares = np.cumsum(power.ravel()) / power.sum()
    shares[-1] = 1.0
    mean = sky.power * (sky.texels.astype(np.float64).sum(axis=1) * bands[:, None]).sum(axis=0) / (4.0 * np.pi)
    density = (power / power.sum() / bands[:, None]).astype(np.float32)
    return Aims(shares, density, _row(words.SKY, mean, np.zeros(3), 0.0))
